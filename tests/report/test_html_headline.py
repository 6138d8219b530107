"""The headline tables: the numbers of the tables, baselines behind models, published ones apart."""

from __future__ import annotations

from urllib.parse import urlencode

import pytest

from phyblock.report import Run, load_run
from phyblock.report.html.headline import headlines
from phyblock.report.html.leads import table_leads
from phyblock.report.html.standing import cautions, samples_done
from phyblock.report.write import make_tables
from phyblock.tables.text_table import NO_VALUE
from phyblock.tracks.full_planning_results import assembly_frame
from phyblock.tracks.step_planning_results import step_intervals, table3_frame
from phyblock.tracks.vqa_results import questions_frame
from tests.report.factory import manifest, record, run_of, score
from tests.workspace import Workspace


def planning_run() -> Run:
    facts = manifest(models=["guess", ("alpha", "GPT-4o")], seeds=[0])
    facts["models"][0]["kind"] = "baseline"
    records = [
        record(model, scene, scores=[score(tp, 1, 2), score(tp + 1, 1, 1, setting="B")])
        for model, tp in (("guess", 1), ("alpha", 3))
        for scene in ("001", "002", "003")
    ]
    return run_of(records, facts)


def test_the_headline_of_plans_says_what_the_tables_say() -> None:
    run = planning_run()
    (headline,) = headlines(run)
    assert [row.name for row in headline.rows] == [
        *("alpha", "guess", "Random, published"),
    ]
    assert [row.kind for row in headline.rows] == ["model", "baseline", "reference"]
    frame = assembly_frame(run)
    frame = frame[(frame["setting"] == "A") & frame["matcher"].isin(["", "optimal"])]
    for row in headline.rows[:2]:
        mine = frame[frame["model"] == row.name].set_index("level")
        overall = row.cells[0]
        assert headline.columns[0] == headline.strip_name == "Overall F1"
        assert overall.value == pytest.approx(100 * mine.loc["overall", "f1"])
        assert row.strip is not None
        assert row.strip[0] == overall.value
        ends = [100 * mine.loc["overall", f"f1_{end}"] for end in ("lo", "hi")]
        assert overall.below == ("{:.1f} to {:.1f}".format(*ends),)
        assert len(row.cells) == len(headline.columns)
    assert headline.rows[0].cells[-1].value is not None
    assert headline.rows[1].cells[-1].text == "–"  # noqa: RUF001
    # People solved a mix of planning and questions: no number of this table is like theirs.
    assert headline.references == {"Random": 8.8}
    assert any("94.7 % of 400 tasks" in note for note in headline.notes)


def test_a_run_has_headlines_of_its_own_tracks_alone() -> None:
    assert [headline.title for headline in headlines(planning_run())] == ["Full planning"]


def test_a_run_says_what_it_is_not() -> None:
    whole = planning_run()
    facts = {**manifest(models=["alpha", "beta"], seeds=[0]), "scenes": 3}
    facts["items"] = {"full_planning": 3}
    scenes = ("001", "002", "003")
    answered = [record("alpha", scene, scores=[score(1, 1, 1)]) for scene in scenes]
    failed = [record("beta", scene, outcome="api_error") for scene in scenes]
    assert cautions(run_of(answered, {**facts, "models": facts["models"][:1]})) == ()
    assert cautions(run_of([*answered, *failed], facts)) == (
        "beta: all 3 calls failed (HTTP 429: busy).",
    )
    assert cautions(run_of([*answered, failed[0]], facts)) == (
        "This run is not finished: 4 of 6 samples have a record.",
        "beta: the one call failed (HTTP 429: busy); 2 of 3 samples were not asked.",
    )
    assert samples_done(run_of([*answered, *failed], facts)) == "3 of 6"
    assert cautions(whole) != ()


def test_models_stand_by_rank_with_the_places_that_tests_leave_open() -> None:
    facts = {**manifest(models=["low", "high", "middle"], seeds=[0]), "scenes": 40}
    names = [f"{n:03}" for n in range(40)]
    values = {"high": (4, 0, 0), "middle": (2, 2, 2), "low": (2, 2, 2)}
    records = [
        {**record(model, name, scores=[score(*counts)]), "levels": [2], "parents": [name]}
        for model, counts in values.items()
        for name in names
    ]
    (headline,) = headlines(run_of(records, facts))
    models = [row for row in headline.rows if row.kind == "model"]
    assert models[0].name == "high"
    assert {row.name: row.rank for row in models} == {
        **{"high": "1", "middle": "2 to 3", "low": "2 to 3"},
    }
    level = dict(zip(headline.columns, models[0].cells, strict=True))["Level 2"]
    assert level.query == "track=full_planning&level=2&model=high"


def test_numbers_of_tables_of_all_tracks_lead_to_samples_of_their_own(made: Workspace) -> None:
    run = load_run(made.out, texts=False)
    _, views = make_tables(run, ())

    def leads(name: str) -> list[tuple[tuple[str, ...], str | None]]:
        return list(zip(views[name].rows, table_leads(run, name, views[name]).rows, strict=True))

    measures = leads("measures")
    for row, lead in measures:
        assert lead == urlencode({"track": row[1].replace(" ", "_"), "model": row[0]})
    assert {row[1] for row, _ in measures} == {"full planning", "step planning"}
    for row, lead in leads("floors"):
        # Nothing was asked of chance, nor of floors that were worked out.
        assert bool(lead) == (row[5] == "random"), row
    known = {row[:5]: lead for row, lead in leads("floors")}
    steps = known["step planning", "F1", "Overall", "A", "placed"]
    assert steps == "track=step_planning&setting=A&model=random"
    part = known["vqa", "Accuracy", "Property", NO_VALUE, NO_VALUE]
    assert part == "track=vqa&subtask=object_property&model=random"


def test_headlines_of_questions_and_episodes(made: Workspace) -> None:
    run = load_run(made.out, texts=False)
    by_title = {headline.title: headline for headline in headlines(run)}
    answers, steps = by_title["VQA"], by_title["Step planning"]
    accuracy = questions_frame(run).set_index(["model", "cell"])["accuracy"]
    for row in answers.rows[:2]:
        # Means are over what was asked; the other categories have no column.
        known = accuracy[row.name].dropna()
        means = ["object_property", "dynamic_reasoning", "overall"]
        assert set(known.index) == {"SH", "OR", "AD", *means}
        shown = dict(zip(answers.columns, row.cells, strict=True))
        values = [shown[name].value for name in ("Property", "Dynamics", "Overall")]
        assert values == pytest.approx((100 * known[means]).tolist())
    table = table3_frame(run).set_index("model")
    intervals = step_intervals(run).set_index(["model", "cell"])
    for row in steps.rows[:2]:
        f1 = row.cells[0]
        assert f1.value == pytest.approx(table.loc[row.name, "attempted_f1"])
        ends = intervals.loc[(row.name, "attempted"), ["lo", "hi"]]
        assert f1.below[0].startswith("{:.1f} to {:.1f}".format(*ends))
    assert steps.columns[:2] == ("F1 of attempts", "Completed")
    assert {row.name: row.cells[0].value for row in steps.rows}["oracle"] == 100
    assert not any(
        "94.7" in cell.text
        for table in (answers, steps)
        for row in table.rows
        for cell in row.cells
    )
