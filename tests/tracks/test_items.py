"""Items: those that are asked about, how difficult they are, and how a seed presents them."""

import asyncio
import math
from dataclasses import replace
from itertools import pairwise, permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain.scene import AOVGraph, Candidate, CandidateSet
from phyblock.errors import DataError
from phyblock.records.record import Reply
from phyblock.tracks import base
from phyblock.tracks.base import DIFFICULTY, log_orders, presented
from tests.scoring.cases import acyclic
from tests.shipped import TASKS
from tests.tracks.conftest import track_of
from tests.workspace import call

SIZES = st.lists(st.integers(1, 200), min_size=1, max_size=4)
seeds = st.integers(0, 2**31 - 1)


@pytest.fixture(scope="module")
def track():
    return track_of("step_planning", steps={"physics": "off"})


def stratified(sizes, limit):
    """How many of `limit` places each group of these sizes gets."""
    groups = [group for group, size in enumerate(sizes) for _ in range(size)]
    chosen = [groups[position] for position in base.fair_order(groups)[:limit]]
    return [chosen.count(group) for group in range(len(sizes))]


@given(SIZES, st.integers(1, 900))
def test_shares_are_as_near_to_proportional_as_can_be(sizes, limit):
    """Webster's law: moving a place from one group to another never brings them nearer. Groups
    with their first place alone hold it whatever their size, and a higher limit takes from none.
    """
    shares = stratified(sizes, limit)
    assert sum(shares) == min(limit, sum(sizes))
    assert all(0 <= share <= size for share, size in zip(shares, sizes, strict=True))
    assert limit < len(sizes) or min(shares) >= 1
    for size, share in zip(sizes, shares, strict=True):
        for other, held in zip(sizes, shares, strict=True):
            if share < size and held >= 2:
                assert (2 * share + 1) * other >= (2 * held - 1) * size
    assert all(a <= b for a, b in zip(shares, stratified(sizes, limit + 1), strict=True))


@given(st.integers(1, 300), st.data())
def test_the_first_positions_are_spread(size, data):
    share = data.draw(st.integers(1, size))
    kept = sorted({*base.spread(size)[:share]})
    assert len(kept) == share
    assert max(b - a for a, b in pairwise([*kept, size])) <= 4 * size / share


@given(seeds)
def test_an_order_has_every_candidate_once_and_is_that_of_scene_and_seed(track, tasks, seed):
    orders = set()
    for task in tasks:
        shown = presented(task, seed, "shuffled")
        assert sorted(shown.order) == list(range(1, 17))
        assert shown.candidates.candidates == tuple(task.candidates[n] for n in shown.order)
        assert track.about(shown) == {"shown": {"order": list(shown.order), "blind": False}}
        orders.add(shown.order)
    assert len(orders) == len(tasks)


def test_orders_stay_as_they_were_drawn(tasks):
    """Stored plans are read by them."""
    orders = {0: (5, 9, 7, 4, 2, 11), 1: (14, 12, 15, 11, 13, 10)}
    for seed, order in orders.items():
        assert presented(tasks[0], seed, "shuffled").order[:6] == order
    assert all(presented(task, 5, "file") is task for task in tasks)
    for order in ([1, 1, 2], [0, 1], [17]):
        with pytest.raises(DataError, match="not an order of its candidates"):
            base.in_order(tasks[0], order)


@given(st.integers(0, 4), seeds, st.lists(st.integers(-1, 18), max_size=5))
def test_an_episode_goes_the_same_in_either_numbering(track, tasks, place, seed, moves):
    async def play(task, steps):
        episode = track.start(task, 0, {}, with_messages=False)
        for step in steps:
            if await episode.request() is None:
                break
            episode.take(Reply(text=f"Next plan: Move({step})"))
        return episode.judgement().fields

    shown = presented(tasks[place], seed, "shuffled")

    def in_file(steps):
        """Steps in the numbers of the file; a number that no candidate has is kept."""
        return [shown.order[n - 1] if 1 <= n <= 16 else n for n in steps]

    here = asyncio.run(play(shown, moves))
    there = asyncio.run(play(tasks[place], in_file(moves)))
    for name in ("scores", "outcomes", "ending"):
        assert here[name] == there[name]
    assert in_file(here["parse"]["plan"]) == there["parse"]["plan"]


@given(acyclic(6).filter(bool).map(AOVGraph))
def test_there_are_as_many_orders_as_is_said_or_more(graph):
    orders = sum(graph.is_valid(order) for order in permutations(range(len(graph))))
    assert 0 <= log_orders(graph) <= math.log10(orders) + 1e-9 or math.isclose(orders, 1)
    if all(len(below) < 2 for below in graph.depends_on):
        assert log_orders(graph) == pytest.approx(math.log10(orders), abs=1e-9)


def test_numbers_are_within_their_bounds_and_tell_scenes_apart():
    for task in TASKS[::9]:
        numbers = {name: measure(task) for name, measure in DIFFICULTY.items()}
        assert 0 < numbers["blind"] < 1
        assert 1 <= numbers["distractor"] <= 3
        assert 1 <= numbers["depth"] <= numbers["blocks"] == len(task.scene)
    needed = {b.look: Candidate(b.type, b.color, b.euler_deg) for b in TASKS[0].scene.blocks}
    alone = replace(TASKS[0], candidates=CandidateSet(tuple(needed.values())))
    assert base.distractor_distance(alone) == 3


def test_a_suite_asks_about_scenes_within_its_ranges(workspace):
    suite = {"dataset": {"path": "phyblock-400", "difficulty": {"blocks": [20, 22]}}}
    path = workspace.write_suite(models=["random"], **suite)
    assert call("run", path, "--out", workspace.out, "--no-report") == 0
    records = workspace.records()
    assert records
    assert {one["n_blocks"] for one in records} <= {20, 21, 22}
    assert call("score", workspace.out) == 0
