"""Plans: matchers, Level-1 criteria, ratios, one type for each wrong step and one outcome for each
goal block, against plain re-implementations.
"""

from collections import Counter
from fractions import Fraction
from itertools import permutations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from phyblock.domain.scene import Block, Candidate, CandidateSet, Plan, Scene
from phyblock.scoring.plan import (
    BLOCK_OUTCOMES,
    ERROR_TYPES,
    AssemblyScorer,
    Counts,
    Goal,
    block_outcomes,
    level1_counts,
    match_plan,
    most_placed,
    steps_kept,
)
from phyblock.types import LEVEL1_CRITERIA, MATCHERS, SETTINGS
from tests.scoring.cases import (
    FLAT,
    TURNED,
    Case,
    acyclic,
    best_of_all,
    carriers,
    cases,
    choices,
    equal,
    error_of,
    greedy_tp,
    renumbered,
)

each_setting = pytest.mark.parametrize("setting", SETTINGS)
each_matcher = pytest.mark.parametrize("matcher", MATCHERS)


def goal_of(case, setting):
    return Goal(case.scene, case.candidates, setting)


def matched(case, setting, matcher="optimal"):
    return match_plan(goal_of(case, setting), case.plan, matcher)


@each_setting
@given(case=cases(max_blocks=8, max_steps=12) | carriers())
def test_optimal_is_the_best_of_all_sequences_of_choices_and_paper_is_algorithm_1(setting, case):
    """The counts follow: B is never below A, nor optimal below paper, whatever the file order. Of
    choices as good as each other, the one with the lightest errors is taken.
    """
    steps, blocks = len(case.plan), len(case.scene)
    (greatest, *lightest), greedy = best_of_all(case, setting), greedy_tp(case, setting)
    assert matched(case, setting).counts == Counts(greatest, steps - greatest, blocks - greatest)
    counts = matched(case, setting, "paper").counts
    assert counts == Counts(greedy, steps - greedy, blocks - greedy)
    assert most_placed(goal_of(case, setting), case.plan) == greatest
    errors = Counter(matched(case, setting).errors)
    assert lightest == [0, errors["overflow"], errors["incorrect_orientation"]]


@each_matcher
@each_setting
@given(case=cases(max_blocks=8, max_steps=12))
def test_every_step_places_a_ready_equal_block_or_has_the_one_error_that_holds(
    setting, matcher, case
):
    match = matched(case, setting, matcher)
    placed = frozenset()
    for index, vertex, error in zip(case.plan.steps, match.vertices, match.errors, strict=True):
        possible = choices(case, index, placed, setting)
        if vertex is None:
            assert not possible
            assert error == error_of(case, index, placed, setting)
        else:
            assert case.scene.blocks[vertex] in possible
            assert error is None
            placed |= {case.scene.blocks[vertex].order}
    assert match.n_blocks == len(case.scene)
    assert sum(map(match.errors.count, ERROR_TYPES)) == match.counts.fp


COUNTS = st.builds(Counts, *[st.integers(0, 1000)] * 3)


def level1(case, setting, criterion):
    return level1_counts(goal_of(case, setting), case.plan, criterion)


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
        goal = goal_of(case, setting)
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


def outcomes(case, setting):
    placed = matched(case, setting).counts.tp
    (counted,) = block_outcomes(goal_of(case, setting), case.plan, [placed])
    return counted


def kept(case, setting):
    return steps_kept(goal_of(case, setting), case.plan)


def closed(case):
    """Every set of orders of blocks that can stand, each on all that it depends on."""
    n = len(case.scene)
    for mask in range(1 << n):
        chosen = [block for v, block in enumerate(case.scene.blocks) if mask >> v & 1]
        orders = frozenset(block.order for block in chosen)
        if all(orders.issuperset(block.depend) for block in chosen):
            yield orders


def standing(case, setting, spare):
    """The most blocks that steps stand for one to one in a set that can stand, in which so many
    more of a kind may be.
    """
    blocks = {block.order: block for block in case.scene.blocks}
    most = 0
    for orders in closed(case):
        left, more = list(case.plan.steps), Counter(spare)
        count = 0
        for block in (blocks[order] for order in orders):
            step = next((i for i in left if equal(block, case.candidates[i], setting)), None)
            if step is None:
                more[block.kind] -= 1
            else:
                left.remove(step)
                count += 1
        if min(more.values(), default=0) >= 0:
            most = max(most, count)
    return most


@each_setting
@given(case=cases())
def test_blocks_lost_are_what_each_kinder_reading_of_the_plan_wins(setting, case):
    counted = outcomes(case, setting)
    assert tuple(sorted(counted)) == tuple(sorted(BLOCK_OUTCOMES))
    assert min(counted.values()) >= 0
    n, steps = len(case.scene), len(case.plan)
    assert sum(counted.values()) == n
    goals = {name: goal_of(case, name) for name in SETTINGS}
    named = {name: level1_counts(goal, case.plan, "selection").tp for name, goal in goals.items()}
    assert counted["left_out"] == n - min(n, steps)
    assert counted["left_out"] + counted["wrong_kind"] == n - named["B"]
    assert counted["wrong_orientation"] == named["B"] - named[setting]
    assert counted["order"] + counted["placed"] == standing(case, setting, Counter())


@each_setting
@given(case=cases(max_blocks=5))
def test_missing_supports_have_the_cause_that_would_mend_them(setting, case):
    counted = outcomes(case, setting)
    blocks = Counter(block.kind for block in case.scene.blocks)
    steps = Counter(case.candidates[index].kind for index in case.plan.steps)
    looks = Counter(block.look for block in case.scene.blocks)
    exact = Counter()
    for look, times in Counter(case.candidates[i].look for i in case.plan.steps).items():
        exact[look[:2]] += min(times, looks[look])
    named = Counter({kind: min(n, steps[kind]) for kind, n in blocks.items()})
    turned = named - exact if setting == "A" else Counter()
    stand = standing(case, setting, Counter())
    assert counted["support_turned"] == standing(case, setting, Counter(turned)) - stand
    by_absent = standing(case, setting, Counter(blocks - named)) - stand
    assert counted["support_not_named"] <= by_absent
    assert counted["support_both"] == 0 or counted["support_not_named"] == by_absent


@st.composite
def distinct_cases(draw):
    """Goals of blocks of which no two are of a kind; each can be named as it is, or turned."""
    edges = draw(acyclic(5).filter(bool))
    kinds = [(shape, color) for shape in ("arch", "cuboid3") for color in ("red", "blue", "green")]
    blocks = tuple(
        Block(v + 1, *kinds[v], FLAT, FLAT, tuple(sorted(w + 1 for w in needed)), 1)
        for v, needed in enumerate(edges)
    )
    poses = [Candidate(*kind, pose) for kind in kinds for pose in (FLAT, TURNED)]
    steps = draw(st.lists(st.integers(1, len(poses)), max_size=8))
    return Case(Scene("s", (3,), blocks, ("s",)), CandidateSet(tuple(poses)), Plan(tuple(steps)))


@given(case=distinct_cases())
def test_where_no_two_blocks_are_of_a_kind_each_has_the_outcome_that_its_own_story_gives(case):
    named = {case.candidates[index].look for index in case.plan.steps}
    kinds = {look[:2] for look in named}
    blocks = {block.order: block for block in case.scene.blocks}

    def below(order):
        return {order}.union(*(below(other) for other in blocks[order].depend))

    placed = set(matched(case, "A").vertices)
    counted = Counter()
    for vertex, block in enumerate(case.scene.blocks):
        under = [blocks[order] for order in below(block.order) - {block.order}]
        is_absent = any(other.kind not in kinds for other in under)
        is_turned = any(other.look not in named and other.kind in kinds for other in under)
        if vertex in placed:
            counted["placed"] += 1
        elif block.kind not in kinds:
            counted["not named"] += 1
        elif block.look not in named:
            counted["wrong_orientation"] += 1
        elif is_absent or is_turned:
            cause = "both" if is_absent and is_turned else "turned" if is_turned else "not_named"
            counted[f"support_{cause}"] += 1
        else:
            counted["order"] += 1
    found = Counter(outcomes(case, "A"))
    found["not named"] = found.pop("left_out") + found.pop("wrong_kind")
    assert +found == counted


@each_setting
@given(case=cases(max_blocks=8), seed=st.integers(0, 2**32 - 1))
def test_every_valid_order_scores_1_and_places_all_and_an_empty_plan_leaves_all_out(
    setting, case, seed
):
    scene = case.scene
    candidates = CandidateSet(tuple({block.look: block for block in scene.blocks}.values()))
    order = scene.graph.random_order(np.random.default_rng(seed))
    steps = tuple(candidates.index_of(scene.blocks[vertex].look) for vertex in order)
    right = Case(scene, candidates, Plan(steps))
    counts = matched(right, setting).counts
    assert (counts.fp, counts.fn, counts.f1) == (0, 0, 1)
    assert +Counter(outcomes(right, setting)) == {"placed": len(scene)}
    assert kept(right, setting) == len(scene)
    empty = Case(scene, candidates, Plan())
    assert +Counter(outcomes(empty, setting)) == {"left_out": len(scene)}
    assert kept(empty, setting) == 0


@each_setting
@given(case=cases(max_blocks=7, max_steps=10) | carriers(), data=st.data())
def test_file_order_and_numbering_change_no_type_and_no_outcome(setting, case, data):
    shuffled = renumbered(case, data)
    errors = [Counter(matched(one, setting).errors) for one in (shuffled, case)]
    assert errors[0] == errors[1]
    assert outcomes(shuffled, setting) == outcomes(case, setting)
    assert kept(shuffled, setting) == kept(case, setting)


def common(plan, case, order, setting):
    """Length of the longest common subsequence of a plan and an order of blocks."""
    row = [0] * (len(order) + 1)
    for step in plan:
        before, row = row, [0]
        for n, vertex in enumerate(order):
            fits = equal(case.scene.blocks[vertex], case.candidates[step], setting)
            row.append(max(before[n] + 1 if fits else 0, before[n + 1], row[n]))
    return row[-1]


@each_setting
@given(case=cases(max_blocks=5, max_steps=7))
def test_steps_kept_are_those_common_with_the_nearest_of_all_valid_orders(setting, case):
    graph = case.scene.graph
    orders = filter(graph.is_valid, permutations(range(len(graph))))
    most = max(common(case.plan.steps, case, order, setting) for order in orders)
    assert kept(case, setting) == most
    placed, goal = matched(case, setting).counts.tp, goal_of(case, setting)
    assert placed <= most == steps_kept(goal, case.plan, placed)
    assert most <= level1_counts(goal, case.plan, "selection").tp


def test_a_step_that_is_no_candidate_is_refused():
    scene = Scene("s", (3,), (Block(1, "arch", "red", FLAT, FLAT, (), 1),), ("s",))
    goal, plan = Goal(scene, CandidateSet((Candidate("arch", "red", FLAT),)), "A"), Plan((1, 2))
    for ask in (
        lambda: block_outcomes(goal, plan, [0]),
        lambda: steps_kept(goal, plan),
        *(lambda matcher=matcher: match_plan(goal, plan, matcher) for matcher in MATCHERS),
        *(lambda name=name: level1_counts(goal, plan, name) for name in LEVEL1_CRITERIA),
    ):
        with pytest.raises(KeyError):
            ask()
