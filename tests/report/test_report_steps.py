"""Table 3, endings, moves and progress, out of records of episodes."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from phyblock.report import load_run
from phyblock.report.write import write_tables
from phyblock.tables.cost import cost_frame, cost_view
from phyblock.tracks.step_planning_results import (
    endings_frame,
    episodes_frame,
    moves_frame,
    progress_frame,
    step_intervals,
    step_scores_frame,
    table3_frame,
)
from tests.report.factory import manifest, record

STEPS = {"gating": "aov", "physics": "settle", "feedback": "success", "history": "text"}
TABLES = ("table3", "endings", "progress")


def score(criterion: str, tp: int, fp: int, fn: int, setting: str = "A") -> dict[str, Any]:
    counts = {"tp": tp, "fp": fp, "fn": fn}
    return {"criterion": criterion, "setting": setting, "matcher": None, "errors": None, **counts}


def episode(
    model: str, scene: str, outcomes: str, ending: str, *, seed: int = 0, **fields: Any
) -> dict[str, Any]:
    """An episode of a goal of four blocks; of `outcomes`, p is placed, o overflow, ? unread."""
    names = {"p": "placed", "o": "overflow", "?": "no_move", "d": "done", "i": "invalid"}
    told = [names[letter] for letter in outcomes]
    placed = [outcomes[: n + 1].count("p") for n in range(len(outcomes))]
    right, tried = outcomes.count("p"), sum(letter in "poi" for letter in outcomes)
    scores = [
        score(kind, right, fp, 4 - right, setting)
        for setting in "AB"
        for kind, fp in (("placed", 0), ("attempted", tried - right))
    ]
    made = record(model, scene, seed, scores, **fields)
    made |= {"sample": f"step_planning/{model}/{scene}/s{seed}", "track": "step_planning"}
    return {**made, "ending": ending, "outcomes": told, "progress": placed, "max_steps": 8}


def write(folder: Path, *records: dict[str, Any], **options: Any) -> Path:
    options = {"models": ("alpha", "beta"), "seeds": (0,), **options}
    about = manifest(items={"step_planning": 2}, **options)
    about["suite"] |= {"tracks": ["step_planning"], "steps": STEPS, "tables": list(TABLES)}
    (folder / "run.yaml").write_text(yaml.safe_dump(about), encoding="utf-8")
    lines = "".join(json.dumps(line) + "\n" for line in records)
    (folder / "records.jsonl").write_text(lines, encoding="utf-8")
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """alpha finishes one goal with a detour and gives up on another; beta fails in every way."""
    return write(
        tmp_path,
        episode("alpha", "001", "pppop", "completed"),
        episode("alpha", "002", "ppd", "done"),
        episode("beta", "001", "o?oi?", "max_failures"),
    )


def test_table_3_counts_blocks_and_moves(folder: Path) -> None:
    alpha, beta = table3_frame(load_run(folder)).to_dict("records")
    assert (alpha["placed_precision"], alpha["placed_recall"]) == (100, 75)
    assert alpha["attempted_precision"] == pytest.approx(100 * 6 / 7)
    assert alpha["attempted_recall"] == 75
    assert (alpha["completion"], alpha["detour"], alpha["n"]) == (50, 1.25, 2)
    assert beta["placed_precision"] != beta["placed_precision"]
    assert (beta["attempted_precision"], beta["placed_recall"], beta["completion"]) == (0, 0, 0)


def test_published_numbers_stand_beside(tmp_path: Path) -> None:
    write(tmp_path, models=(("gpt", "GPT-4o"), "other"))
    rows = table3_frame(load_run(tmp_path)).to_dict("records")
    assert [(row["model"], row["source"]) for row in rows] == [
        ("gpt", "run"),
        ("gpt", "published"),
        ("other", "run"),
    ]
    printed = rows[1]
    assert printed["placed_recall"] == 13.0
    rates = set(printed) - {"model", "source", "published_name", "placed_recall"}
    assert rates > {"placed_precision", "placed_f1", "attempted_f1", "completion"}
    assert all(math.isnan(printed[name]) for name in rates)
    notes = write_tables(tmp_path).views["table3"].notes
    assert any("recall alone stands beside ours" in note for note in notes)


def test_seeds_have_a_mean_and_a_spread(tmp_path: Path) -> None:
    write(
        tmp_path,
        episode("alpha", "001", "pppp", "completed", seed=0),
        episode("alpha", "001", "ppd", "done", seed=1),
        models=("alpha",),
        seeds=(0, 1),
    )
    (row,) = table3_frame(load_run(tmp_path)).to_dict("records")
    assert row["placed_recall"] == 75
    assert row["placed_recall_sd"] == pytest.approx(35.355, abs=1e-3)
    text = write_tables(tmp_path).views["table3"]
    assert text.columns[1].group == "Completed"
    assert text.columns[4].group == "F1 of attempts"
    assert text.rows[0][1] == "50.0"
    assert text.rows[0][3] == "50.0 ± 70.7"
    assert "Values pool the samples of 2 seeds." in text.notes
    assert (row["attempted_f1"], row["attempted_f1_mean"]) == pytest.approx((600 / 7, 250 / 3))


def test_endings_split_the_episodes(folder: Path) -> None:
    alpha, beta = endings_frame(load_run(folder)).to_dict("records")
    assert (alpha["completed"], alpha["done"], alpha["max_failures"]) == (1, 1, 0)
    assert (alpha["n"], alpha["expected"], alpha["steps"]) == (2, 2, 4)
    assert (alpha["steps_to_finish"], alpha["detour"]) == (5, 1.25)
    assert 0 < alpha["completed_lo"] < alpha["completed_share"] == 0.5 < alpha["completed_hi"] < 1
    assert (beta["n"], beta["expected"], beta["max_failures"]) == (1, 2, 1)


def test_moves_split_the_steps(folder: Path) -> None:
    run = load_run(folder)
    alpha, beta = moves_frame(run).to_dict("records")
    assert (alpha["steps"], alpha["placed"], alpha["overflow"], alpha["done"]) == (8, 6, 1, 1)
    assert (beta["overflow"], beta["unread"], beta["invalid"]) == (2, 2, 1)
    assert beta["unread_share"] == 0.4
    assert 0 < alpha["placed_lo"] < alpha["placed_share"] == 0.75 < alpha["placed_hi"] <= 1
    assert len(episodes_frame(run)) == 3


def test_costs_of_episodes_are_said_to_be_of_episodes(folder: Path) -> None:
    run = load_run(folder)
    said = cost_view(cost_frame(run), run).notes
    assert any("whole episode" in note for note in said)


def test_progress_is_a_curve_that_keeps_what_was_reached(folder: Path) -> None:
    table = progress_frame(load_run(folder))
    alpha = table[table["model"] == "alpha"]
    assert alpha["step"].tolist() == [1, 2, 3, 4, 5]
    assert alpha["blocks"].tolist() == [0.25, 0.5, 0.625, 0.625, 0.75]
    assert alpha["under_way"].tolist() == [1, 1, 1, 0.5, 0.5]
    assert (alpha["blocks_lo"] <= alpha["blocks"]).all()
    assert (alpha["blocks"] <= alpha["blocks_hi"]).all()
    assert (alpha["blocks_lo"] < alpha["blocks_hi"])[2:].all()
    assert table.loc[table["model"] == "beta", "blocks"].tolist() == [0] * 5


@pytest.mark.parametrize(("missing", "n"), [("count", 2), ("skip", 1)])
def test_episodes_without_a_reply_are_counted_as_the_suite_says(
    tmp_path: Path, missing: str, n: int
) -> None:
    failed = episode("alpha", "002", "", "unanswered", outcome="api_error")
    write(tmp_path, episode("alpha", "001", "pppp", "completed"), failed, missing=missing)
    run = load_run(tmp_path)
    assert endings_frame(run)["n"].tolist() == [n, 0]
    scores = step_scores_frame(run)
    assert scores["n"].tolist() == [n] * 4 + [0] * 4


def test_every_table_is_written_even_when_nothing_has_run(tmp_path: Path) -> None:
    written = write_tables(write(tmp_path))
    names = {path.name for path in written.files}
    for table in (*TABLES, "moves"):
        assert {f"{table}.csv", f"{table}.md", f"{table}.tex"} <= names
    assert "step_scores.csv" in names
    assert "table1.csv" not in names


def test_the_tables_say_what_the_simulator_went_by(folder: Path) -> None:
    view = write_tables(folder).views["table3"]
    assert "setting A, gating aov, physics settle" in view.notes[0]
    assert any("Scored of 2 episodes: beta 1." in note for note in view.notes)
    assert view.rows[0][0] == "alpha"


def test_a_model_without_any_reply_has_no_metrics(tmp_path: Path) -> None:
    silent = [
        episode("beta", scene, "", "unanswered", outcome="api_error") for scene in ("001", "002")
    ]
    write(tmp_path, episode("alpha", "001", "pp", "done"), *silent, missing="count")
    run = load_run(tmp_path)
    alpha, beta = table3_frame(run).to_dict("records")
    assert alpha["placed_recall"] == 50
    assert math.isnan(beta["placed_recall"])
    assert math.isnan(beta["completion"])
    assert progress_frame(run)["model"].unique().tolist() == ["alpha"]
    assert set(step_intervals(run)["model"]) == {"alpha"}
    counts = step_scores_frame(run).set_index(["model", "setting", "criterion"])
    assert counts.loc[("beta", "A", "placed"), ["n", "fn"]].tolist() == [2, 8]


def test_the_newest_record_of_an_episode_counts(tmp_path: Path) -> None:
    first = episode("alpha", "001", "", "unanswered", outcome="missing")
    write(tmp_path, first, episode("alpha", "001", "pp", "done"), models=("alpha",))
    (row,) = episodes_frame(load_run(tmp_path)).to_dict("records")
    assert (row["ending"], row["steps"], row["progress"]) == ("done", 2, (1, 2))
