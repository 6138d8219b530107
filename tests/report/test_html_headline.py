"""The headline tables: the numbers of the tables, baselines behind models, published ones apart."""

from __future__ import annotations

from pathlib import Path

import pytest

from phyblock.report import Run, load_run
from phyblock.report.html.headline import headlines
from phyblock.tracks.full_planning.assembly import assembly_frame
from phyblock.tracks.step_planning.table3 import step_intervals, table3_frame
from phyblock.tracks.vqa.accuracy import questions_frame
from tests.report.factory import manifest, record, run_of, score
from tests.report.html_run import make_run


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
        overall = row.cells[headline.main]
        assert headline.columns[headline.main] == headline.strip_name == "Overall F1"
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


def test_headlines_of_questions_and_episodes(
    tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path
) -> None:
    made = make_run(tmp_path_factory.mktemp("headline"), pictures_dir)
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
        f1 = row.cells[steps.main]
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
