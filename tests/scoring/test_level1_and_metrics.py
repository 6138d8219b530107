"""Level-1 criteria, micro averages, and the scorer that applies everything at once."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain import Block, Candidate, CandidateSet, Plan, Scene
from phyblock.scoring.counts import Counts, micro
from phyblock.scoring.plan import AssemblyScorer, Goal, level1_counts, match_plan
from phyblock.types import LEVEL1_CRITERIA, MATCHERS, SETTINGS, Level1Criterion, Setting
from tests.scoring.cases import Case, cases, equal

each_setting = pytest.mark.parametrize("setting", SETTINGS)
COUNTS = st.builds(Counts, *[st.integers(0, 1000)] * 3)


def level1(case: Case, setting: Setting, criterion: Level1Criterion) -> Counts:
    return level1_counts(Goal(case.scene, case.candidates, setting), case.plan, criterion)


@each_setting
@given(case=cases())
def test_selection_is_a_one_to_one_matching_without_order(setting: Setting, case: Case) -> None:
    left = list(case.scene.blocks)
    for index in case.plan.steps:
        hit = next((b for b in left if equal(b, case.candidates[index], setting)), None)
        if hit is not None:
            left.remove(hit)
    tp = len(case.scene) - len(left)
    assert level1(case, setting, "selection") == Counts(tp, len(case.plan) - tp, len(left))


@each_setting
@given(case=cases())
def test_membership_counts_every_step_whose_block_occurs(setting: Setting, case: Case) -> None:
    tp = sum(
        any(equal(block, case.candidates[index], setting) for block in case.scene.blocks)
        for index in case.plan.steps
    )
    counts = level1(case, setting, "membership")
    assert counts == Counts(tp, len(case.plan) - tp, len(case.scene) - tp)


@each_setting
@given(case=cases())
def test_less_is_asked_by_selection_than_by_order_and_by_membership_than_by_selection(
    setting: Setting, case: Case
) -> None:
    goal = Goal(case.scene, case.candidates, setting)
    in_order = match_plan(goal, case.plan, "optimal").counts.tp
    selection = level1(case, setting, "selection").tp
    assert in_order <= selection <= level1(case, setting, "membership").tp


@each_setting
@given(case=cases(), data=st.data())
def test_level_1_does_not_depend_on_the_order_of_steps(
    setting: Setting, case: Case, data: st.DataObject
) -> None:
    shuffled = Plan(tuple(data.draw(st.permutations(case.plan.steps))))
    goal = Goal(case.scene, case.candidates, setting)
    for criterion in LEVEL1_CRITERIA:
        assert level1_counts(goal, shuffled, criterion) == level1(case, setting, criterion)


FLAT = (0.0, 0.0, 0.0)
SCENE = Scene("s", (1, 2), (Block(1, "arch", "red", FLAT, FLAT, (), 1),), ("s",))
GOAL = Goal(SCENE, CandidateSet((Candidate("arch", "red", FLAT),)), "A")


def test_a_repeated_step_counts_again_under_membership_alone() -> None:
    assert level1_counts(GOAL, Plan((1, 1, 1)), "membership") == Counts(3, 0, -2)
    assert level1_counts(GOAL, Plan((1, 1, 1)), "selection") == Counts(1, 2, 0)


@pytest.mark.parametrize("criterion", LEVEL1_CRITERIA)
def test_a_step_that_is_no_candidate_is_refused(criterion: Level1Criterion) -> None:
    with pytest.raises(KeyError):
        level1_counts(GOAL, Plan((1, 2)), criterion)


@given(counts=st.lists(COUNTS, max_size=8), data=st.data())
def test_micro_averages_sum_first_whatever_the_order(
    counts: list[Counts], data: st.DataObject
) -> None:
    total = micro(counts)
    assert total == Counts(*(sum(getattr(c, name) for c in counts) for name in ("tp", "fp", "fn")))
    assert micro(data.draw(st.permutations(counts))) == total
    half = data.draw(st.integers(0, len(counts)))
    assert micro([micro(counts[:half]), micro(counts[half:])]) == total


@given(counts=COUNTS)
def test_precision_recall_and_f1_are_the_textbook_ratios(counts: Counts) -> None:
    tp, fp, fn = counts.tp, counts.fp, counts.fn
    precision = Fraction(tp, tp + fp) if tp + fp else None
    recall = Fraction(tp, tp + fn) if tp + fn else None
    assert counts.precision == (None if precision is None else float(precision))
    assert counts.recall == (None if recall is None else float(recall))
    if precision and recall:
        harmonic = 2 * precision * recall / (precision + recall)
        assert counts.f1 == pytest.approx(float(harmonic))
    else:
        assert counts.f1 == (None if tp + fp + fn == 0 else 0)


def test_nothing_counted_has_no_value() -> None:
    nothing = micro([])
    assert nothing == Counts()
    assert (nothing.precision, nothing.recall, nothing.f1) == (None, None, None)


@given(case=cases(), level1=st.sampled_from([None, *LEVEL1_CRITERIA]))
def test_the_scorer_says_what_its_parts_say(case: Case, level1: Level1Criterion | None) -> None:
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
    assert [(s.criterion, s.setting, s.matcher, s.counts, s.vertices) for s in scores] == expected
    for score in scores:
        if score.criterion == "aov":
            assert score.errors is not None
            assert sum(score.errors.values()) == score.counts.fp
            assert score.step_errors is not None
            assert len(score.step_errors) == len(case.plan)
        else:
            assert (score.errors, score.step_errors) == (None, None)


@given(case=cases(), data=st.data())
def test_what_was_scored_before_changes_nothing(case: Case, data: st.DataObject) -> None:
    steps = st.lists(st.integers(1, len(case.candidates)), max_size=8)
    plans = [Plan(tuple(found)) for found in data.draw(st.lists(steps, max_size=4))]
    scorer = AssemblyScorer(case.scene, case.candidates, SETTINGS)
    first = [scorer.score(plan, MATCHERS, "selection") for plan in plans]
    again = [scorer.score(plan, MATCHERS, "selection") for plan in reversed(plans)]
    assert first == again[::-1]
