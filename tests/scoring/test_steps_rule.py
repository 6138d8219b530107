"""The rule of a step: what a move does to an assembly."""

from dataclasses import replace
from operator import attrgetter

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain.scene import Plan
from phyblock.scoring.plan import ERROR_TYPES, Goal, match_plan
from phyblock.scoring.steps import MOVE_OUTCOMES, Assembly, gated, placed_counts
from phyblock.types import GATINGS, SETTINGS
from tests.scoring.cases import carriers, cases, choices, error_of

any_setting = st.sampled_from(SETTINGS)
any_gating = st.sampled_from(GATINGS)


@given(cases(), any_setting, any_gating, st.integers(0, 2**32 - 1))
def test_a_valid_order_never_fails_whatever_looks_alike(case, setting, gating, seed):
    look = attrgetter("look" if setting == "A" else "kind")
    offered = list(map(look, case.candidates.candidates))
    assembly = Assembly(case.scene, case.candidates, setting, gating)
    for vertex in gated(case.scene, gating).graph.random_order(np.random.default_rng(seed)):
        wanted = look(case.scene.blocks[vertex])
        if wanted not in offered:
            return
        number = 1 + offered.index(wanted)
        assert number in assembly.right_moves()
        assert assembly.move(number).outcome == "placed"
    assert assembly.is_complete


@given(cases(max_steps=14) | carriers(), any_setting, any_gating)
def test_the_world_is_always_one_that_can_be_built(case, setting, gating):
    """And holds no more than the optimal matcher allows; blocks swap only where none is ready."""
    assembly = Assembly(case.scene, case.candidates, setting, gating)
    world = replace(case, scene=gated(case.scene, gating))
    graph, blocks = world.scene.graph, world.scene.blocks
    outcomes = []
    for index in case.plan.steps:
        before, expected = assembly.vertices, index in assembly.right_moves()
        ready = choices(world, index, frozenset(blocks[v].order for v in before), setting)
        move = assembly.move(index)
        outcomes.append(move.outcome)
        assert (move.outcome == "placed") == expected
        for vertex in assembly.vertices:
            assert graph.depends_on[vertex] <= set(assembly.vertices)
        if move.outcome == "placed":
            assert not (ready and move.swapped)
            look = attrgetter("look" if setting == "A" else "kind")
            assert all(look(blocks[a]) == look(blocks[b]) for a, b in move.swapped)
            left = {one for one, _ in move.swapped}
            entered = {other for _, other in move.swapped} | {move.vertex}
            assert set(assembly.vertices) == set(before) - left | entered
            assert len(assembly.vertices) == len(before) + 1 == len(assembly.chosen)
        else:
            assert (assembly.vertices, move.vertex, move.swapped) == (before, None, ())
    n_placed = outcomes.count("placed")
    goal = Goal(case.scene, case.candidates, setting)
    assert match_plan(goal, Plan(tuple(assembly.chosen)), "optimal").counts.fp == 0
    assert n_placed <= match_plan(goal, case.plan, "optimal").counts.tp
    placed = placed_counts(case.scene, case.candidates, setting, assembly.chosen)
    assert (placed.tp, placed.fp, placed.tp + placed.fn) == (n_placed, 0, len(case.scene))
    assert len(outcomes) - n_placed == sum(outcomes.count(name) for name in ERROR_TYPES)


@given(cases())
def test_layers_wait_for_all_of_the_layers_below(case):
    waiting, layers = gated(case.scene, "layer").graph.depends_on, case.scene.graph.layers
    for needed, layer in zip(waiting, layers, strict=True):
        assert needed == {v for v, other in enumerate(layers) if other < layer}


@given(cases(max_steps=14), any_setting)
def test_a_wrong_move_has_the_error_type_of_its_moment(case, setting):
    assembly = Assembly(case.scene, case.candidates, setting)
    for index in case.plan.steps:
        placed = {case.scene.blocks[vertex].order for vertex in assembly.vertices}
        outcome = assembly.move(index).outcome
        assert outcome == "placed" or outcome == error_of(case, index, placed, setting)


@given(cases(), st.integers(-(10**9), 10**9))
def test_a_number_that_no_candidate_has_is_invalid(case, index):
    assembly = Assembly(case.scene, case.candidates, "A")
    outcome = assembly.move(index).outcome
    assert (outcome == "invalid") == (not 1 <= index <= len(case.candidates))
    assert outcome in MOVE_OUTCOMES
