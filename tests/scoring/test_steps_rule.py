"""The rule of a step: what a move does to an assembly."""

from operator import attrgetter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain.scene import Block, Candidate, CandidateSet, Plan, Scene
from phyblock.scoring.plan import ERROR_TYPES, Goal, match_plan
from phyblock.scoring.steps import MOVE_OUTCOMES, Assembly, attempted_counts, gated, placed_counts
from phyblock.types import GATINGS, SETTINGS
from tests.scoring.cases import cases
from tests.shipped import TASKS, official_tasks

ORDERS = 20

any_setting = st.sampled_from(SETTINGS)
any_gating = st.sampled_from(GATINGS)


def assert_no_valid_order_fails(task, orders, rng, setting, gating):
    numbers = [task.candidates.index_of(block.look) for block in task.scene.blocks]
    graph = gated(task.scene, gating).graph
    for _ in range(orders):
        order = graph.random_order(rng)
        assembly = Assembly(task.scene, task.candidates, setting, gating)
        outcomes = {assembly.move(numbers[vertex]).outcome for vertex in order}
        assert outcomes == {"placed"}, (task.scene.id, setting, gating, order)
        assert assembly.is_complete
        assert assembly.vertices == tuple(range(len(task.scene)))


@pytest.mark.parametrize(
    ("source", "setting", "gating", "orders"),
    [
        ("official", "A", "aov", ORDERS),
        pytest.param("official", "B", "aov", ORDERS, marks=pytest.mark.slow),
        ("built-in", "A", "aov", ORDERS),
        pytest.param("built-in", "B", "aov", ORDERS, marks=pytest.mark.slow),
        ("built-in", "A", "layer", 2),
    ],
)
def test_no_valid_order_fails(source, setting, gating, orders, request):
    if source == "official":
        tasks = official_tasks(request.getfixturevalue("official_checkout"))
    else:
        tasks = TASKS
    rng = np.random.default_rng(0)
    for task in tasks:
        assert_no_valid_order_fails(task, orders, rng, setting, gating)


def right(case, setting):
    """For each block of the scene, candidates that stand for it; none is 0."""
    attribute = attrgetter("look" if setting == "A" else "kind")
    offered = [None, *map(attribute, case.candidates.candidates)]
    return [
        offered.index(one) if one in offered else 0 for one in map(attribute, case.scene.blocks)
    ]


@given(cases(), any_setting, any_gating, st.randoms(use_true_random=False))
def test_a_valid_order_never_fails_whatever_looks_alike(case, setting, gating, random):
    numbers = right(case, setting)
    rng = np.random.default_rng(random.getrandbits(32))
    assembly = Assembly(case.scene, case.candidates, setting, gating)
    for vertex in gated(case.scene, gating).graph.random_order(rng):
        if numbers[vertex] == 0:
            return
        assert numbers[vertex] in assembly.right_moves()
        assert assembly.move(numbers[vertex]).outcome == "placed"
    assert assembly.is_complete


@given(cases(max_steps=14), any_setting, any_gating)
def test_the_world_is_always_one_that_can_be_built(case, setting, gating):
    """Whatever is placed has all that it depends on, and the right moves are those that work."""
    assembly = Assembly(case.scene, case.candidates, setting, gating)
    graph = gated(case.scene, gating).graph
    for index in case.plan.steps:
        before, expected = assembly.vertices, index in assembly.right_moves()
        move = assembly.move(index)
        assert (move.outcome == "placed") == expected
        for vertex in assembly.vertices:
            assert graph.depends_on[vertex] <= set(assembly.vertices)
        if move.outcome == "placed":
            left = {one for one, _ in move.swapped}
            entered = {other for _, other in move.swapped} | {move.vertex}
            assert set(assembly.vertices) == set(before) - left | entered
            assert len(assembly.vertices) == len(before) + 1 == len(assembly.chosen)
        else:
            assert (assembly.vertices, move.vertex, move.swapped) == (before, None, ())


@given(cases(max_steps=14), any_setting)
def test_a_wrong_move_has_the_error_type_of_its_moment(case, setting):
    assembly = Assembly(case.scene, case.candidates, setting)
    for index in case.plan.steps:
        candidate = case.candidates[index]
        unplaced = [b for v, b in enumerate(case.scene.blocks) if v not in assembly.vertices]
        outcome = assembly.move(index).outcome
        if all(block.kind != candidate.kind for block in case.scene.blocks):
            assert outcome == "shape_not_in_gt"
        elif all(block.kind != candidate.kind for block in unplaced):
            assert outcome == "overflow"
        elif setting == "A" and all(block.look != candidate.look for block in unplaced):
            assert outcome == "incorrect_orientation"
        else:
            assert outcome in ("placed", "dependency_not_met")


@given(cases(max_steps=14), any_setting)
def test_no_more_is_placed_than_the_optimal_matcher_allows(case, setting):
    assembly = Assembly(case.scene, case.candidates, setting)
    outcomes = [assembly.move(index).outcome for index in case.plan.steps]
    placed = Plan(tuple(assembly.chosen))
    goal = Goal(case.scene, case.candidates, setting)
    assert match_plan(goal, placed, "optimal").counts.fp == 0
    assert outcomes.count("placed") <= match_plan(goal, case.plan, "optimal").counts.tp


@given(cases(), st.integers(-(10**9), 10**9))
def test_a_number_that_no_candidate_has_is_invalid(case, index):
    assembly = Assembly(case.scene, case.candidates, "A")
    outcome = assembly.move(index).outcome
    assert (outcome == "invalid") == (not 1 <= index <= len(case.candidates))
    assert outcome in MOVE_OUTCOMES


def cube(order, color, depend=(), turn=0.0):
    layer = 1 + bool(depend)
    return Block(order, "arch", color, (0, 0, 0), (0, 0, turn), depend, layer)


def two_pillars():
    """Two equal red blocks; a blue one stands on the first, a green one on the second."""
    blocks = (cube(1, "red"), cube(2, "red"), cube(3, "blue", (1,)), cube(4, "green", (2,)))
    colors = ("red", "blue", "green", "yellow")
    numbered = tuple(Candidate("arch", color, (0, 0, 0)) for color in colors)
    return Scene("pillars", (3,), blocks, ("pillars",)), CandidateSet(numbered)


@pytest.mark.parametrize(("third", "standing"), [(2, (0, 2)), (3, (1, 3))])
def test_equal_blocks_change_places_where_the_next_move_needs_it(third, standing):
    """After one red block, blue and green are both right: the picture follows the choice."""
    assembly = Assembly(*two_pillars(), "A")
    assembly.move(1)
    assert assembly.right_moves() == (1, 2, 3)
    move = assembly.move(third)
    assert move.outcome == "placed"
    assert move.swapped == (((0, 1),) if third == 3 else ())
    assert assembly.vertices == standing
    assert assembly.move(5 - third).outcome == "dependency_not_met"


def test_layers_wait_for_the_whole_layer_below():
    scene, candidates = two_pillars()
    moves = (1, 2, 1, 2)
    outcomes = {
        gating: [assembly.move(n).outcome for n in moves]
        for gating in GATINGS
        for assembly in [Assembly(scene, candidates, "A", gating)]
    }
    assert outcomes == {
        "aov": ["placed", "placed", "placed", "overflow"],
        "layer": ["placed", "dependency_not_met", "placed", "placed"],
    }


@given(cases(max_steps=14), any_setting)
def test_every_placed_block_is_right_under_the_setting_that_let_it(case, setting):
    assembly = Assembly(case.scene, case.candidates, setting)
    outcomes = [assembly.move(index).outcome for index in case.plan.steps]
    placed = placed_counts(case.scene, case.candidates, setting, assembly.chosen)
    assert (placed.tp, placed.fp) == (outcomes.count("placed"), 0)
    assert placed.tp + placed.fn == len(case.scene)
    tried = attempted_counts(placed, len(outcomes))
    assert tried.fp == sum(outcomes.count(name) for name in ERROR_TYPES)
