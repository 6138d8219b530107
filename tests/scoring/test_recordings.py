"""Scores of the official recordings against the counts that are known for them."""

from __future__ import annotations

import csv
import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from phyblock.data import AssemblyTask, read_official
from phyblock.domain import Plan
from phyblock.parsing.plan import parse_plan
from phyblock.scoring.plan import AssemblyScorer, Goal, match_plan
from phyblock.types import MATCHERS, PLAN_PARSERS, SETTINGS, PlanParser
from tests.official_replies import reply_texts

Row = tuple[str, str, str, str]


@pytest.fixture(scope="module")
def tasks(official_checkout: Path) -> dict[str, AssemblyTask]:
    return {task.scene.id: task for task in read_official(official_checkout).tasks}


def scored(
    checkout: Path, tasks: dict[str, AssemblyTask]
) -> Iterator[tuple[Row, tuple[int, int, int, int]]]:
    scorers = {
        name: AssemblyScorer(task.scene, task.candidates, SETTINGS) for name, task in tasks.items()
    }
    for (model, scene), text in reply_texts(checkout).items():
        plan = parse_plan(text, len(tasks[scene].candidates), "official").plan
        for score in scorers[scene].score(plan, ["paper"], "membership"):
            level = 1 if score.criterion == "membership" else tasks[scene].scene.level
            counts = score.counts
            row = (model, scene, score.setting, score.criterion)
            yield row, (level, counts.tp, counts.fp, counts.fn)


def test_known_counts_match_row_for_row(
    official_dir: Path, official_checkout: Path, tasks: dict[str, AssemblyTask]
) -> None:
    path = official_dir / "expected" / "assembly_counts.csv"
    with path.open(encoding="utf-8", newline="") as file:
        expected = {
            (row["model"], row["scene"], row["setting"], row["criterion"]): tuple(
                int(row[column]) for column in ("level", "tp", "fp", "fn")
            )
            for row in csv.DictReader(file)
        }
    models = {model for model, *_ in expected}
    found = dict(scored(official_checkout, tasks))
    assert {row: counts for row, counts in found.items() if row[0] in models} == expected
    assert len(expected) >= 6250


@pytest.mark.parametrize("share", [0.2, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("parser", PLAN_PARSERS)
def test_optimal_is_never_below_paper_on_recorded_replies(
    official_checkout: Path, tasks: dict[str, AssemblyTask], parser: PlanParser, share: float
) -> None:
    goals = {
        (name, setting): Goal(task.scene, task.candidates, setting)
        for name, task in tasks.items()
        for setting in SETTINGS
    }
    replies = reply_texts(official_checkout)
    plans: set[tuple[str, Plan]] = {
        (scene, parse_plan(text, len(tasks[scene].candidates), parser).plan)
        for (_, scene), text in replies.items()
        if random.Random(text).random() < share
    }
    assert len(plans) > 1000 * share
    for scene, plan in plans:
        tp = {}
        for setting in SETTINGS:
            goal = goals[scene, setting]
            for matcher in MATCHERS:
                tp[setting, matcher] = match_plan(goal, plan, matcher).counts.tp
            assert tp[setting, "optimal"] >= tp[setting, "paper"], (scene, plan)
        assert tp["B", "optimal"] >= tp["A", "optimal"], (scene, plan)
