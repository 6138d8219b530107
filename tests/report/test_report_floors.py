"""Floors: which is the strongest, who is above it; and what the order of candidates changes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.report import Run
from phyblock.report.floors import floor_lines, floors_frame, floors_view, headline_floors
from phyblock.report.html.headline import headlines
from phyblock.report.write import make_tables
from phyblock.tables.measures import value_key
from phyblock.tracks.estimates import track_estimates
from tests.report.factory import laws, manifest, record, run_of, score

SCENES = ("001", "002", "003")
OVERALL = "f1/overall/A/optimal/aov"


def run_with(floors: dict[str, float], seeds: tuple[int, ...] = (0,), **counts: Any) -> Run:
    """A run in which each model has the given true positives of four blocks in every scene."""
    facts = manifest(models=list(counts), seeds=seeds, levels=(2, 3, 4), settings=["A"])
    for model in facts["models"]:
        model["kind"] = "baseline" if model["name"] in ("random", "first_pose") else "litellm"
    facts["floors"] = {"full_planning": {name: {OVERALL: v} for name, v in floors.items()}}
    records = [
        record(model, scene, seed, [score(tp, 4 - tp, 4 - tp)])
        for model, per_scene in counts.items()
        for scene, tp in zip(SCENES, per_scene, strict=True)
        for seed in seeds
    ]
    return run_of(records, facts)


def verdicts(run: Run) -> dict[str, tuple[str, str]]:
    frame = floors_frame(run)
    whole = frame[(frame["cell"] == "overall") & (frame["matcher"] == "optimal")]
    return {row["model"]: (row["floor"], row["verdict"]) for row in whole.to_dict("records")}


def test_the_strongest_floor_is_named_and_whose_interval_is_above_it() -> None:
    counts = {"good": (4, 4, 3), "middling": (1, 3, 2), "bad": (0, 1, 0), "random": (1, 1, 1)}
    run = run_with({"goal-blind": 0.3, "all-candidates": 0.2}, **counts)
    assert verdicts(run) == {
        "good": ("goal-blind", "above"),
        "middling": ("goal-blind", "not above"),
        "bad": ("goal-blind", "not above"),
    }
    weaker = run_with({"all-candidates": 0.2}, **counts)
    assert {floor for floor, _ in verdicts(weaker).values()} == {"random"}
    (title, line) = floor_lines(floors_frame(run), run)
    whole = "Full planning, Overall F1: goal-blind 30.0"
    assert line == f"{whole}; above it: good; not above it: middling, bad"
    view = floors_view(floors_frame(run), run)
    assert ("F1", "Overall", "A", "aov", "goal-blind", "30.0", "good", "middling, bad") in view.rows
    assert title.startswith("Floors")


def test_a_floor_that_was_run_counts_as_it_was_run() -> None:
    """What run.yaml says of one is not taken where the run has its records."""
    run = run_with({"random": 0.9}, good=(4, 4, 4), random=(1, 1, 1))
    frame = floors_frame(run)
    assert set(frame["floor"]) == {"random"}
    assert set(frame["floor_value"]) == {0.25}


@laws
@given(
    st.dictionaries(st.sampled_from(["goal-blind", "all-candidates"]), st.floats(0, 1)),
    st.tuples(*[st.integers(0, 4)] * 3),
)
def test_above_is_an_interval_that_lies_wholly_above(
    floors: dict[str, float], tp: tuple[int, int, int]
) -> None:
    run = run_with(floors, alpha=tp)
    rows = floors_frame(run)
    assert len(rows) == bool(floors)
    found = {
        value_key(row): row for row in track_estimates(run, "full_planning").to_dict("records")
    }
    for row in rows.to_dict("records"):
        assert row["floor_value"] == max(floors.values())
        lo = found[value_key(row)]["lo"]
        wanted = "cannot tell" if np.isnan(lo) else "above" if lo > row["floor_value"] else ""
        assert row["verdict"] == (wanted or "not above")


def test_the_headline_has_the_floor_and_marks_what_is_not_above_it() -> None:
    run = run_with({"goal-blind": 0.3}, good=(4, 4, 3), bad=(0, 1, 0))
    assert headline_floors(run, "full_planning")["Overall F1"].value == 30.0
    (headline,) = headlines(run)
    rows = {row.name: row.cells[0] for row in headline.rows}
    assert rows["Floor: goal-blind"].value == 30.0
    assert rows["bad"].below[0].endswith(" †")
    assert "floor" not in rows["good"].below[0]


def test_a_run_without_floors_has_no_table_of_them() -> None:
    run = run_with({}, alpha=(1, 2, 3))
    frames, views = make_tables(run, ["table1"])
    assert "floors" not in frames
    assert "floors" not in views


def test_orders_show_the_spread_over_seeds_and_the_plans_that_stay() -> None:
    facts = manifest(models=["alpha"], seeds=(0, 1), levels=(2, 3, 4), settings=["A"])
    facts["suite"]["candidates"] = {"order": "shuffled"}
    records = []
    for scene, same in zip(SCENES, (True, True, False), strict=True):
        for seed in (0, 1):
            one = record("alpha", scene, seed, [score(2 + seed, 2 - seed, 2 - seed)])
            one["parse"]["file_plan"] = [3 if same else 3 + seed]
            one["counts"] = {"poses": [1, 2, 1, 4]}
            records.append(one)
    run = run_of(records, facts)
    (row,) = make_tables(run, ["table1"])[0]["orders"].to_dict("records")
    assert (row["order"], row["seeds"]) == ("shuffled", 2)
    assert (row["f1_least"], row["f1_mean"], row["f1_most"]) == (0.5, 0.625, 0.75)
    assert (row["same_plan"], row["plan_pairs"]) == (pytest.approx(2 / 3), 3)
    for name in ("f1", "same_plan", "pose_first", "pose_later", "pose_gap"):
        assert row[f"{name}_lo"] <= row[name] <= row[f"{name}_hi"]
    assert (row["pose_first"], row["pose_first_n"]) == (0.5, 12)
    assert (row["pose_later"], row["pose_later_n"]) == (0.25, 24)
    assert row["pose_gap"] == pytest.approx(0.25)
    caption = make_tables(run, ["table1"])[1]["orders"].caption
    assert caption.endswith("[candidates shuffled]")
