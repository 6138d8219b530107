"""The headline tables: the numbers of the tables, baselines behind models, published ones apart."""

from __future__ import annotations

import math

from phyblock.results.estimates import headline_of
from phyblock.results.load import Run, load_run
from phyblock.web.report import cautions, headlines
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
        *("alpha", "guess"),
    ]
    assert [row.kind for row in headline.rows] == ["model", "baseline"]
    values = headline_of(run, "full_planning")
    for row in headline.rows:
        value, overall = values[row.name, "Overall F1"], row.cells[0]
        assert headline.columns[0] == "Overall F1"
        assert overall.value == value.value
        assert row.strip is not None
        assert row.strip[0] == overall.value
        assert overall.below == (f"{value.lo:.1f} to {value.hi:.1f}",)
        assert len(row.cells) == len(headline.columns)


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


def test_headlines_of_questions_and_episodes(made: Workspace) -> None:
    run = load_run(made.out, texts=False)
    by_title = {headline.title: headline for headline in headlines(run)}
    for title, track in (("VQA", "vqa"), ("Step planning", "step_planning")):
        values = headline_of(run, track)
        for row in by_title[title].rows[:2]:
            for heading, cell in zip(by_title[title].columns, row.cells, strict=True):
                value = values.get((row.name, heading))
                known = value is not None and not math.isnan(value.value)
                assert cell.value == (value.value if known and value else None)
    steps = by_title["Step planning"]
    assert steps.columns[:2] == ("F1 of attempts", "Completed")
    assert {row.name: row.cells[0].value for row in steps.rows}["oracle"] == 100
