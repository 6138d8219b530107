"""Tables: each number is that of an estimate, and files that appear whole or not at all."""

import shutil
import subprocess

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.files import LIST
from phyblock.results.compare import compare, write_comparison
from phyblock.results.load import load_run, track_measures
from phyblock.results.tables import coverage_frame, make_tables, summary_of, write_tables
from phyblock.results.text import NO_VALUE, Column, TextTable, number, to_latex, to_markdown
from phyblock.tracks.base import kind_of
from phyblock.types import OUTCOMES
from tests.results.test_estimates import EPISODES, complete, episodes, questions
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
    assert shown_numbers(episodes(*EPISODES), "step_planning") > 20
    assert shown_numbers(questions(complete({"SH": 3, "OR": 1})), "vqa") > 20


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


def test_replies_that_are_missing_and_seeds_that_were_refused_stand_under_tables():
    records = [
        record(scene="001", scores=[score(1, 0, 0)], seed_sent=False),
        record(scene="001", seed=1, scores=[score(0, 0, 4)], outcome="api_error"),
        record(scene="002", scores=[score(0, 0, 4)], outcome="missing"),
    ]
    for missing, how in (("count", "counted as wrong"), ("skip", "left out")):
        run = run_of(records, manifest(missing=missing))
        notes = make_tables(run, ["table1"])["table1"].notes
        assert f"Without a reply, {how}: alpha 1 API errors and 1 missing replies." in notes
        assert "alpha: seed unsupported, seeds are independent repeats." in notes
        assert "Values pool the samples of 2 seeds." in notes


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


def records_of(model):
    scores = [score(1, 1, 1), score(2, 1, 0, setting="B"), score(3, 0, 1, criterion="selection")]
    return [
        record(model, scene, seed, scores) for scene in ("000", "002", "003") for seed in (0, 1)
    ]


@settings(laws, max_examples=3)
@given(record_lists())
def test_writing_again_changes_nothing(tmp_path_factory, records):
    folder = write_run(tmp_path_factory.mktemp("runs") / "run", records, manifest())
    first = {file: file.read_bytes() for file in write_tables(folder).files}
    assert {file: file.read_bytes() for file in write_tables(folder).files} == first
    assert {file.name for file in folder.iterdir()} == {"run.yaml", "records.jsonl", "tables", LIST}


def test_the_summary_ranks_models_and_says_who_is_above_the_blind_baseline():
    tp = {"alpha": 1, "beta": 4, "random": 0, "goal-blind": 2}
    facts = manifest(models=list(tp), seeds=[0], levels=[3, 4])
    for model in facts["models"][2:]:
        model["kind"] = "baseline"
    facts["items"] = {"full_planning": 2}
    records = [
        record(name, scene, scores=[score(n, 4 - n, 4 - n)])
        for name, n in tp.items()
        for scene in ("002", "003")
    ]
    run = run_of(records, facts)
    summary = summary_of(run)
    (table,) = summary.tables
    assert [row[:3] for row in table.rows] == [
        ("1\N{EN DASH}2", "beta", "100.0"),
        ("", "goal-blind", "50.0"),
        ("1\N{EN DASH}2", "alpha", "25.0"),
        ("", "random", "0.0"),
    ]
    ranks = compare(run).ranks
    assert ranks[["model", "best", "worst"]].values.tolist() == [["beta", 1, 2], ["alpha", 1, 2]]
    (sentence,) = summary.blind
    assert sentence.endswith("of 2 models are shown to be above goal-blind (50.0).")


LATEX = next(filter(shutil.which, ("pdflatex", "lualatex")), None)


@pytest.mark.skipif(LATEX is None, reason="neither pdflatex nor lualatex is installed")
def test_latex_compiles_inside_any_document(tmp_path):
    models = [r"all & % $ # _ { } ~ ^ \ < > | \" ` ' -- [x] *", "[first]", "*star", "Ünïcode"]
    folder = write_run(
        tmp_path / "run",
        [one for model in models for one in records_of(model)],
        manifest(models=[(models[0], "GPT-4.1"), *models[1:]]),
    )
    write_tables(folder)
    write_comparison(compare(load_run(folder)), folder / "tables")
    files = sorted(file.relative_to(folder) for file in folder.glob("*/*.tex"))
    assert {"tables/comparison.tex", "tables/table1.tex"} <= {file.as_posix() for file in files}
    inputs = "".join(rf"\input{{{file.with_suffix('')}}}" for file in files)
    for number_of_columns in ("onecolumn", "twocolumn"):
        document = (
            rf"\documentclass[{number_of_columns}]{{article}}"
            rf"\usepackage{{booktabs}}\usepackage{{graphicx}}"
            rf"\begin{{document}}"
            rf"{inputs}\end{{document}}"
        )
        (folder / "paper.tex").write_text(document)
        command = [str(LATEX), "-interaction=nonstopmode", "-halt-on-error", "paper.tex"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, errors="replace")
        assert done.returncode == 0, done.stdout
        assert "Overfull" not in done.stdout
        assert "too large" not in done.stdout


TABLE = TextTable(
    "Precision & recall (%)",
    (Column("Model", is_text=True), Column("Prec", "Level-1"), Column("F1", "Level-1")),
    (("gpt_4o|x", "9.5", "100.0 ± 12.5"), ("[b]*", NO_VALUE, "7.0 ± 0.5")),
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
        r"gpt\_4o\textbar{}x & 9.5 & 100.0 $\pm$ 12.5 \\",
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
        "| gpt\\_4o\\|x | 9.5 | 100.0 ± 12.5 |",
        "| \\[b\\]\\* | \N{EN DASH} | 7.0 ± 0.5 |",
        "",
        "- 100 % of \\<all\\>.",
    ]
