"""The law of the headline metric, on every scene there is: a valid order scores exactly 1."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from phyblock.data import AssemblyTask, read_builtin, read_official
from phyblock.domain import Plan
from phyblock.scoring.plan import Goal, match_plan
from phyblock.types import SETTINGS

ORDERS = 200
BUNDLED = sorted((Path(__file__).parents[2] / "benchmarks" / "data").glob("*/scenes.jsonl"))
EVERY = pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.slow)])
"""Each fifth scene, of all levels; all scenes when there is time."""


def assert_every_order_scores_1(task: AssemblyTask, rng: np.random.Generator) -> None:
    number = [task.candidates.index_of(block.look) for block in task.scene.blocks]
    steps = [index for index in number if index is not None]
    assert len(steps) == len(number), task.scene.id
    goals = [Goal(task.scene, task.candidates, setting) for setting in SETTINGS]
    for order in {task.scene.graph.random_order(rng) for _ in range(ORDERS)}:
        assert task.scene.graph.is_valid(order)
        plan = Plan(tuple(steps[vertex] for vertex in order))
        for goal in goals:
            assert match_plan(goal, plan, "optimal").counts.f1 == 1, (task.scene.id, order)


@EVERY
def test_valid_orders_of_the_official_scenes_score_1(official_checkout: Path, every: int) -> None:
    rng = np.random.default_rng(0)
    for task in read_official(official_checkout).tasks[::every]:
        assert_every_order_scores_1(task, rng)


@EVERY
@pytest.mark.parametrize("path", BUNDLED, ids=lambda path: path.parent.name)
def test_valid_orders_of_the_bundled_scenes_score_1(path: Path, every: int) -> None:
    rng = np.random.default_rng(0)
    for task in read_builtin(path.parent).tasks[::every]:
        assert_every_order_scores_1(task, rng)
