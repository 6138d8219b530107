"""Plans: matchers, Level-1 criteria and ratios, against plain re-implementations."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from phyblock.domain.scene import CandidateSet, Plan
from phyblock.scoring.plan import (
    AssemblyScorer,
    Counts,
    Goal,
    level1_counts,
    match_plan,
    most_placed,
)
from phyblock.types import LEVEL1_CRITERIA, MATCHERS, SETTINGS
from tests.scoring.cases import carriers, cases, choices, equal, greatest_tp, greedy_tp

each_setting = pytest.mark.parametrize("setting", SETTINGS)
each_matcher = pytest.mark.parametrize("matcher", MATCHERS)


def matched(case, setting, matcher):
    return match_plan(Goal(case.scene, case.candidates, setting), case.plan, matcher)


def counted(case, setting, matcher="optimal"):
    return matched(case, setting, matcher).counts


@each_setting
@given(case=cases(max_blocks=8, max_steps=12) | carriers())
def test_optimal_is_the_best_of_all_sequences_of_choices_and_paper_is_algorithm_1(setting, case):
    """The counts follow: B is never below A, nor optimal below paper, whatever the file order."""
    steps, blocks = len(case.plan), len(case.scene)
    greatest, greedy = greatest_tp(case, setting), greedy_tp(case, setting)
    assert counted(case, setting) == Counts(greatest, steps - greatest, blocks - greatest)
    assert counted(case, setting, "paper") == Counts(greedy, steps - greedy, blocks - greedy)
    assert most_placed(Goal(case.scene, case.candidates, setting), case.plan) == greatest


@each_matcher
@each_setting
@given(case=cases(max_blocks=8, max_steps=12))
def test_every_step_places_a_ready_equal_block_or_could_not(setting, matcher, case):
    match = matched(case, setting, matcher)
    placed = frozenset()
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


@each_setting
@given(case=cases(max_blocks=8), seed=st.integers(0, 2**32 - 1))
def test_every_valid_order_scores_1(setting, case, seed):
    scene = case.scene
    looks = {block.look: block for block in scene.blocks}
    candidates = CandidateSet(tuple(looks.values()))
    order = scene.graph.random_order(np.random.default_rng(seed))
    steps = [candidates.index_of(scene.blocks[vertex].look) for vertex in order]
    assert None not in steps
    plan = Plan(tuple(step for step in steps if step is not None))
    counts = match_plan(Goal(scene, candidates, setting), plan, "optimal").counts
    assert (counts.fp, counts.fn, counts.f1) == (0, 0, 1)


COUNTS = st.builds(Counts, *[st.integers(0, 1000)] * 3)


def level1(case, setting, criterion):
    return level1_counts(Goal(case.scene, case.candidates, setting), case.plan, criterion)


@each_setting
@given(case=cases())
def test_selection_is_a_one_to_one_matching_without_order(setting, case):
    left = list(case.scene.blocks)
    for index in case.plan.steps:
        hit = next((b for b in left if equal(b, case.candidates[index], setting)), None)
        if hit is not None:
            left.remove(hit)
    tp = len(case.scene) - len(left)
    assert level1(case, setting, "selection") == Counts(tp, len(case.plan) - tp, len(left))


@each_setting
@given(case=cases())
def test_membership_counts_every_step_whose_block_occurs(setting, case):
    tp = sum(
        any(equal(block, case.candidates[index], setting) for block in case.scene.blocks)
        for index in case.plan.steps
    )
    counts = level1(case, setting, "membership")
    assert counts == Counts(tp, len(case.plan) - tp, len(case.scene) - tp)


@given(counts=st.lists(COUNTS, max_size=8), data=st.data())
def test_micro_averages_sum_first_whatever_the_order(counts, data):
    total = sum(counts, Counts())
    assert total == Counts(*(sum(getattr(c, name) for c in counts) for name in ("tp", "fp", "fn")))
    assert sum(data.draw(st.permutations(counts)), Counts()) == total
    half = data.draw(st.integers(0, len(counts)))
    assert sum(counts[:half], Counts()) + sum(counts[half:], Counts()) == total


@given(counts=COUNTS)
@example(counts=Counts())
def test_f1_is_the_harmonic_mean_of_precision_and_recall(counts):
    tp, fp, fn = counts.tp, counts.fp, counts.fn
    precision = Fraction(tp, tp + fp) if tp + fp else None
    recall = Fraction(tp, tp + fn) if tp + fn else None
    if precision and recall:
        harmonic = 2 * precision * recall / (precision + recall)
        assert counts.f1 == pytest.approx(float(harmonic))
    else:
        assert counts.f1 == (None if tp + fp + fn == 0 else 0)


@given(case=cases(), level1=st.sampled_from([None, *LEVEL1_CRITERIA]))
def test_the_scorer_says_what_its_parts_say(case, level1):
    scores = AssemblyScorer(case.scene, case.candidates, SETTINGS).score(
        case.plan, MATCHERS, level1
    )
    expected = []
    for setting in SETTINGS:
        goal = Goal(case.scene, case.candidates, setting)
        for matcher in MATCHERS:
            match = match_plan(goal, case.plan, matcher)
            expected.append(("aov", setting, matcher, match.counts, match.vertices))
        if level1 is not None and 1 in case.scene.levels:
            counts = level1_counts(goal, case.plan, level1)
            expected.append((level1, setting, None, counts, None))
    found = [
        (one.criterion, one.setting, one.matcher, Counts(one.tp, one.fp, one.fn), one.placed)
        for one in scores
    ]
    assert found == expected
    for score in scores:
        if score.criterion == "aov":
            assert sum(score.errors.values()) == score.fp
            assert len(score.why) == len(case.plan)
        else:
            assert (score.errors, score.why) == (None, None)


@given(case=cases(), data=st.data())
def test_what_was_scored_before_changes_nothing(case, data):
    steps = st.lists(st.integers(1, len(case.candidates)), max_size=8)
    plans = [Plan(tuple(found)) for found in data.draw(st.lists(steps, max_size=4))]
    scorer = AssemblyScorer(case.scene, case.candidates, SETTINGS)
    first = [scorer.score(plan, MATCHERS, "selection") for plan in plans]
    again = [scorer.score(plan, MATCHERS, "selection") for plan in reversed(plans)]
    assert first == again[::-1]
