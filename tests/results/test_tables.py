"""Tables: each number is that of an estimate, and files that appear whole or not at all."""

import pandas as pd
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain.question import SUBTASKS
from phyblock.files import LIST
from phyblock.results.load import track_measures
from phyblock.results.tables import coverage_frame, make_tables, summary_of, write_tables
from phyblock.results.text import NO_VALUE, Column, TextTable, number, to_latex, to_markdown
from phyblock.tracks.base import kind_of
from phyblock.types import OUTCOMES
from tests.results.test_estimates import episodes, questions
from tests.web.factory import laws, manifest, record, record_lists, run_of, score, write_run


def shown_numbers(run, track):
    """Hold every number of a track's tables against the estimates of its model; return how many."""
    frame = run.estimates
    scales = {measure.name: measure.scale for measure in track_measures(track)}
    known = {}
    for one in frame.to_dict("records"):
        ends = (scales[one["measure"]] * one[end] for end in ("value", "lo", "hi"))
        known.setdefault(one["model"], set()).update(round(float(end), 6) for end in ends)
    found = 0
    for table in make_tables(run, list(kind_of(track).report().tables)).values():
        if "model" not in table.frame or "expected" in table.frame or "replies" in table.frame:
            continue
        assert len(table.frame) == len(table.rows)
        numbers = table.frame.drop(columns=["part"], errors="ignore").set_index("model")
        texts = " ".join(text for row in table.rows for text in row)
        for model, row in numbers.iterrows():
            for value in row.dropna():
                assert round(float(value), 6) in known[str(model)]
                assert number(value) in texts or number(value, 2) in texts
                found += 1
    return found


@laws
@given(record_lists(), st.sampled_from(["skip", "count"]))
def test_tables_of_plans_show_estimates(records, missing):
    shown_numbers(run_of(records, manifest(missing=missing)), "full_planning")


def test_tables_of_episodes_and_questions_show_estimates():
    assert shown_numbers(episodes(), "step_planning") > 20
    assert shown_numbers(questions({**dict.fromkeys(SUBTASKS, 0), "SH": 3, "OR": 1}), "vqa") > 20


@laws
@given(record_lists())
def test_outcomes_split_what_was_expected(records):
    table = coverage_frame(run_of(records, manifest()))
    assert table["model"].tolist() == ["alpha", "beta"]
    assert (table["recorded"] + table["not_run"] == table["expected"]).all()
    assert (table[list(OUTCOMES)].sum(axis=1) == table["recorded"]).all()
    assert (table["replies"] == table["recorded"] - table["api_error"] - table["missing"]).all()
    for outcome in OUTCOMES:
        ends = [one["outcome"] == outcome for one in records if one["model"] == "alpha"]
        assert table[outcome].iloc[0] == sum(ends)


def test_costs_are_of_what_is_known_and_say_how_much_is_not():
    records = [
        record(scene="000", prompt_tokens=10, completion_tokens=5, cost_usd=0.5, latency_s=1.0),
        record(scene="001", prompt_tokens=20, completion_tokens=7, cost_usd=0.25, latency_s=2.0),
        record(scene="002", cached=True, latency_s=9.0, attempts=0),
        record(scene="003", outcome="api_error"),
        record("beta", scene="000", prompt_tokens=0, completion_tokens=0, cost_usd=0.0, attempts=3),
        record("unknown"),
    ]
    run = run_of(records, manifest(models=["alpha", "beta", "unknown"]))
    table = coverage_frame(run).set_index("model")
    wanted = {"prompt_tokens": 15, "completion_tokens": 6, "tokens_unknown": 1, "cost_unknown": 0}
    wanted |= {"cost_usd": 0.75, "latency_median_s": 1.5, "cached": 1, "attempts": 2, "replies": 3}
    assert table.loc["alpha", list(wanted)].to_dict() == wanted
    assert pd.isna(table.loc["alpha", "reasoning_tokens"])
    assert table.loc["beta", ["cost_usd", "prompt_tokens", "attempts"]].tolist() == [0, 0, 3]
    view = make_tables(run, ["cost"])["cost"]
    places = [n for n, column in enumerate(view.columns) if column.group == "Cost (USD)"]
    assert {row[0]: tuple(row[n] for n in places) for row in view.rows} == {
        "alpha": ("0.7500", "37.50"),
        "beta": ("0.00", "0.00"),
        "unknown": (NO_VALUE, NO_VALUE),
    }


@settings(laws, max_examples=3)
@given(record_lists())
def test_writing_again_changes_nothing(tmp_path_factory, records):
    folder = write_run(tmp_path_factory.mktemp("runs") / "run", records, manifest())
    first = {file: file.read_bytes() for file in write_tables(folder).files}
    assert {file: file.read_bytes() for file in write_tables(folder).files} == first
    assert {file.name for file in folder.iterdir()} == {"run.yaml", "records.jsonl", "tables", LIST}


def test_the_summary_ranks_models_and_says_who_is_above_the_blind_baseline():
    tp = {"alpha": 1, "beta": 4, "random": 0, "goal-blind": 2}
    facts = manifest(models=list(tp), seeds=[0], levels=[3, 4], items={"full_planning": 2})
    for model in facts["models"][2:]:
        model["kind"] = "baseline"
    records = [
        record(name, scene, scores=[score(n, 4 - n, 4 - n)])
        for name, n in tp.items()
        for scene in ("002", "003")
    ]
    (table,), (sentence,), _ = summary_of(run_of(records, facts))
    assert [row[:3] for row in table.rows] == [
        ("1\N{EN DASH}2", "beta", "100.0"),
        ("", "goal-blind", "50.0"),
        ("1\N{EN DASH}2", "alpha", "25.0"),
        ("", "random", "0.0"),
    ]
    assert "goal-blind (50.0)" in sentence


TABLE = TextTable(
    "Precision & recall (%)",
    (Column("Model", is_text=True), Column("Prec", "Level-1"), Column("F1", "Level-1")),
    (
        (r"gpt_4o|x & % $ # { } ~ ^ \ < > ` -- ü", "9.5", "100.0 ± 12.5"),
        ("[b]*", NO_VALUE, "7.0 ± 0.5"),
    ),
    ("100 % of <all>.",),
)


def test_latex_and_markdown_by_hand():
    assert to_latex(TABLE, "x").splitlines()[8:-2] == [
        r"\begin{tabular}{@{}lrr@{}}",
        r"\toprule",
        r" & \multicolumn{2}{c}{Level-1} \\",
        r"\cmidrule(lr){2-3}",
        r"Model & \multicolumn{1}{c}{Prec} & \multicolumn{1}{c}{F1} \\",
        r"\midrule",
        r"gpt\_4o\textbar{}x \& \% \$ \# \{ \} \textasciitilde{} \textasciicircum{} "
        r"\textbackslash{} \textless{} \textgreater{} \textasciigrave{} -{}- ü & 9.5 & "
        r"100.0 $\pm$ 12.5 \\",
        r"{[}b{]}{*} & \textendash{} & 7.0 $\pm$ 0.5 \\",
        r"\bottomrule",
        r"\end{tabular}}}",
        r"\par\smallskip\raggedright\footnotesize",
    ]
    assert to_markdown(TABLE).splitlines() == [
        "**Precision &amp; recall (%)**",
        "",
        "| Model | Level-1 Prec | Level-1 F1 |",
        "| --- | --: | --: |",
        r"| gpt\_4o\|x &amp; % \$ \# { } \~ ^ \\ \< \> \` -- ü | 9.5 | 100.0 ± 12.5 |",
        "| \\[b\\]\\* | \N{EN DASH} | 7.0 ± 0.5 |",
        "",
        "- 100 % of \\<all\\>.",
    ]
