"""Difficulty as numbers: what they count, and suites that ask for ranges of them."""

from __future__ import annotations

import math
from itertools import permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain.scene import AOVGraph, Candidate, CandidateSet
from phyblock.tracks.difficulty import MEASURES, distractor_distance, log_orders
from tests.shipped import TASKS
from tests.workspace import Workspace, call


@st.composite
def graphs(draw: st.DrawFn) -> AOVGraph:
    """A graph of up to six blocks, each on some of those before it."""
    return AOVGraph(
        tuple(
            frozenset(draw(st.sets(st.integers(0, v - 1), max_size=2)) if v else ())
            for v in range(draw(st.integers(1, 6)))
        )
    )


@given(graphs())
def test_there_are_as_many_orders_as_is_said_or_more(graph: AOVGraph) -> None:
    orders = sum(graph.is_valid(order) for order in permutations(range(len(graph))))
    assert 0 <= log_orders(graph) <= math.log10(orders) + 1e-9 or math.isclose(orders, 1)
    if all(len(below) < 2 for below in graph.depends_on):
        assert log_orders(graph) == pytest.approx(math.log10(orders), abs=1e-9)


def test_numbers_are_within_their_bounds_and_tell_scenes_apart() -> None:
    for task in TASKS[::9]:
        numbers = {name: measure(task) for name, measure in MEASURES.items()}
        assert 0 < numbers["blind"] < 1
        assert 1 <= numbers["distractor"] <= 3
        assert 1 <= numbers["depth"] <= numbers["blocks"] == len(task.scene)
    needed = tuple(
        {
            block.look: Candidate(block.type, block.color, block.euler_deg)
            for block in TASKS[0].scene.blocks
        }.values()
    )
    alone = type(TASKS[0])(TASKS[0].scene, CandidateSet(needed))
    assert distractor_distance(alone) == 3


def test_a_suite_asks_about_scenes_within_its_ranges(workspace: Workspace) -> None:
    suite = {"dataset": {"path": "phyblock-400", "difficulty": {"blocks": [20, 22]}}}
    path = workspace.write_suite(models=["random"], **suite)
    assert call("run", path, "--out", workspace.out, "--no-report") == 0
    records = workspace.records(workspace.out)
    assert {one["n_blocks"] for one in records} <= {20, 21, 22}
    assert call("score", workspace.out) == 0
