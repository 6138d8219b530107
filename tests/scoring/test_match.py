"""Laws of the matchers, against plain re-implementations on small random scenes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain import Block, Candidate, CandidateSet, Plan, Scene
from phyblock.scoring.counts import Counts
from phyblock.scoring.plan import Goal, Match, match_plan, most_placed
from phyblock.types import MATCHERS, SETTINGS, Matcher, Setting
from tests.scoring.cases import Case, cases, choices, greatest_tp, greedy_tp, renumbered

each_setting = pytest.mark.parametrize("setting", SETTINGS)
each_matcher = pytest.mark.parametrize("matcher", MATCHERS)


def matched(case: Case, setting: Setting, matcher: Matcher) -> Match:
    return match_plan(Goal(case.scene, case.candidates, setting), case.plan, matcher)


def counted(case: Case, setting: Setting, matcher: Matcher = "optimal") -> Counts:
    return matched(case, setting, matcher).counts


@each_setting
@given(case=cases())
def test_optimal_is_the_best_of_all_sequences_of_choices(setting: Setting, case: Case) -> None:
    greatest = greatest_tp(case, setting)
    assert counted(case, setting).tp == greatest
    assert most_placed(Goal(case.scene, case.candidates, setting), case.plan) == greatest


@each_setting
@given(case=cases(max_blocks=8, max_steps=12))
def test_paper_is_algorithm_1(setting: Setting, case: Case) -> None:
    assert counted(case, setting, "paper").tp == greedy_tp(case, setting)


@each_matcher
@each_setting
@given(case=cases(max_blocks=8, max_steps=12))
def test_every_step_places_a_ready_equal_block_or_could_not(
    setting: Setting, matcher: Matcher, case: Case
) -> None:
    match = matched(case, setting, matcher)
    placed: frozenset[int] = frozenset()
    for index, vertex, mask in zip(case.plan.steps, match.vertices, match.placed, strict=True):
        orders = {case.scene.blocks[v].order for v in range(len(case.scene)) if mask & 1 << v}
        assert orders == placed
        possible = choices(case, index, placed, setting)
        if vertex is None:
            assert not possible
        else:
            assert case.scene.blocks[vertex] in possible
            placed |= {case.scene.blocks[vertex].order}
    assert match.n_blocks == len(case.scene)


@each_matcher
@each_setting
@given(case=cases())
def test_counts_add_up_to_steps_and_blocks(setting: Setting, matcher: Matcher, case: Case) -> None:
    counts = counted(case, setting, matcher)
    assert counts.tp + counts.fp == len(case.plan)
    assert counts.tp + counts.fn == len(case.scene)
    assert min(counts.tp, counts.fp, counts.fn) >= 0


@each_setting
@given(case=cases(max_blocks=8, max_steps=12))
def test_optimal_is_never_below_paper(setting: Setting, case: Case) -> None:
    assert counted(case, setting).tp >= counted(case, setting, "paper").tp


@given(case=cases(max_blocks=8, max_steps=12))
def test_setting_b_is_never_below_setting_a(case: Case) -> None:
    assert counted(case, "B").tp >= counted(case, "A").tp


@given(case=cases(max_blocks=8))
def test_a_plan_that_is_right_in_a_is_right_in_b(case: Case) -> None:
    if counted(case, "A").f1 == 1:
        assert counted(case, "B").f1 == 1


@each_setting
@given(case=cases(max_blocks=8), seed=st.integers(0, 2**32 - 1))
def test_every_valid_order_scores_1(setting: Setting, case: Case, seed: int) -> None:
    scene = case.scene
    looks = {block.look: block for block in scene.blocks}
    candidates = CandidateSet(tuple(looks.values()))  # type: ignore[arg-type]
    order = scene.graph.random_order(np.random.default_rng(seed))
    steps = [candidates.index_of(scene.blocks[vertex].look) for vertex in order]
    assert None not in steps
    plan = Plan(tuple(step for step in steps if step is not None))
    counts = match_plan(Goal(scene, candidates, setting), plan, "optimal").counts
    assert (counts.fp, counts.fn, counts.f1) == (0, 0, 1)


@each_setting
@given(case=cases(), data=st.data())
def test_one_more_step_anywhere_never_loses_a_block(
    setting: Setting, case: Case, data: st.DataObject
) -> None:
    at = data.draw(st.integers(0, len(case.plan)))
    extra = data.draw(st.integers(1, len(case.candidates)))
    steps = case.plan.steps
    longer = replace(case, plan=Plan((*steps[:at], extra, *steps[at:])))
    assert counted(longer, setting).tp >= counted(case, setting).tp


@each_matcher
@each_setting
@given(case=cases(), data=st.data())
def test_a_useless_step_never_raises_precision(
    setting: Setting, matcher: Matcher, case: Case, data: st.DataObject
) -> None:
    goal = Goal(case.scene, case.candidates, setting)
    useless = [index for index, vertices in goal.equal_to.items() if not vertices]
    at = data.draw(st.integers(0, len(case.plan)))
    steps = case.plan.steps
    before = match_plan(goal, case.plan, matcher).counts
    for index in useless:
        longer = match_plan(goal, Plan((*steps[:at], index, *steps[at:])), matcher).counts
        assert longer == Counts(before.tp, before.fp + 1, before.fn)
        assert longer.precision is not None
        assert before.precision is None or longer.precision <= before.precision


@each_matcher
@each_setting
@given(case=cases())
def test_a_step_that_fails_can_be_left_out(setting: Setting, matcher: Matcher, case: Case) -> None:
    match = matched(case, setting, matcher)
    right = tuple(
        index
        for index, vertex in zip(case.plan.steps, match.vertices, strict=True)
        if vertex is not None
    )
    only_right = replace(case, plan=Plan(right))
    assert counted(only_right, setting, matcher).tp == match.counts.tp


@each_setting
@given(case=cases(), data=st.data())
def test_optimal_does_not_depend_on_file_order_or_numbering(
    setting: Setting, case: Case, data: st.DataObject
) -> None:
    shuffled = renumbered(case, data)
    assert counted(shuffled, setting) == counted(case, setting)


def test_the_greedy_choice_can_punish_a_valid_order() -> None:
    # Two equal arches stand on the ground; the second in the file carries the cuboid.
    case = _two_arches(carrier=2)
    assert case.scene.graph.is_valid((1, 2, 0))
    assert counted(case, "A", "paper") == Counts(2, 1, 1)
    assert counted(case, "A", "optimal") == Counts(3, 0, 0)
    assert counted(_two_arches(carrier=1), "A", "paper") == Counts(3, 0, 0)


def _two_arches(carrier: int) -> Case:
    ground, flat = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    blocks = (
        Block(1, "arch", "red", ground, flat, (), 1),
        Block(2, "arch", "red", ground, flat, (), 1),
        Block(3, "cuboid3", "blue", ground, flat, (carrier,), 2),
    )
    candidates = CandidateSet((Candidate("arch", "red", flat), Candidate("cuboid3", "blue", flat)))
    return Case(Scene("s", (3,), blocks, ("s",)), candidates, Plan((1, 2, 1)))


def test_the_greedy_choice_can_score_less_in_b_than_in_a() -> None:
    ground, flat, turned = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 90.0)
    blocks = (
        Block(1, "arch", "red", ground, turned, (), 1),
        Block(2, "arch", "red", ground, flat, (), 1),
        Block(3, "cuboid3", "blue", ground, flat, (2,), 2),
    )
    candidates = _two_arches(carrier=2).candidates
    case = Case(Scene("s", (3,), blocks, ("s",)), candidates, Plan((1, 2)))
    assert [counted(case, setting, "paper").tp for setting in SETTINGS] == [2, 1]
    assert [counted(case, setting, "optimal").tp for setting in SETTINGS] == [2, 2]


def test_the_greedy_choice_can_lose_blocks_by_one_more_right_step() -> None:
    ground, flat, turned = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 90.0)
    blocks = (
        Block(1, "arch", "red", ground, flat, (2,), 2),
        Block(2, "cube", "red", ground, flat, (), 1),
        Block(3, "arch", "red", ground, flat, (), 1),
        Block(4, "cuboid3", "blue", ground, flat, (3,), 2),
        Block(5, "cuboid3", "blue", ground, turned, (3,), 2),
    )
    candidates = CandidateSet(
        (
            Candidate("cube", "red", flat),
            Candidate("arch", "red", flat),
            Candidate("cuboid3", "blue", flat),
            Candidate("cuboid3", "blue", turned),
        )
    )
    scene = Scene("s", (3,), blocks, ("s",))
    short = Case(scene, candidates, Plan((2, 3, 4)))
    long = Case(scene, candidates, Plan((1, 2, 3, 4)))
    assert [counted(case, "A", "paper").tp for case in (short, long)] == [3, 2]
    assert [counted(case, "A", "optimal").tp for case in (short, long)] == [3, 4]


@each_matcher
def test_a_step_that_is_no_candidate_is_refused(matcher: Matcher) -> None:
    case = _two_arches(carrier=1)
    with pytest.raises(KeyError):
        counted(replace(case, plan=Plan((1, 3))), "A", matcher)


@each_matcher
def test_an_empty_plan_leaves_every_block(matcher: Matcher) -> None:
    case = replace(_two_arches(carrier=1), plan=Plan())
    counts = counted(case, "A", matcher)
    assert counts == Counts(0, 0, 3)
    assert (counts.precision, counts.recall, counts.f1) == (None, 0, 0)
