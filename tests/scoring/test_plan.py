"""Plans against plain rules: matchers, criteria, ratios, types of wrong steps, ends of blocks."""

from collections import Counter
from fractions import Fraction
from itertools import compress, permutations, product

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from phyblock.domain.scene import Candidate, CandidateSet, Plan, Scene
from phyblock.records.record import Score
from phyblock.scoring import plan as scoring
from phyblock.scoring.plan import AssemblyScorer, Counts, Goal, match_plan
from phyblock.types import LEVEL1_CRITERIA, MATCHERS, SETTINGS
from tests.scoring import cases as made
from tests.scoring.cases import FLAT, TURNED, Case, carriers, cases, choices, equal

each_setting = pytest.mark.parametrize("setting", SETTINGS)


def goal_of(case, setting):
    return Goal(case.scene, case.candidates, setting)


def matched(case, setting, matcher="optimal"):
    return match_plan(goal_of(case, setting), case.plan, matcher)


@each_setting
@given(case=cases(max_blocks=8, max_steps=12) | carriers())
def test_optimal_is_the_best_of_all_sequences_of_choices_and_paper_is_algorithm_1(setting, case):
    """Of choices as good as each other, the one with the lightest errors is taken."""
    steps, blocks = len(case.plan), len(case.scene)
    greatest, *lightest = made.best_of_all(case, setting)
    for matcher, tp in (("optimal", greatest), ("paper", made.greedy_tp(case, setting))):
        assert matched(case, setting, matcher).counts == Counts(tp, steps - tp, blocks - tp)
    assert scoring.most_placed(goal_of(case, setting), case.plan) == greatest
    errors = Counter(matched(case, setting).errors)
    assert lightest == [0, errors["overflow"], errors["incorrect_orientation"]]


@pytest.mark.parametrize("matcher", MATCHERS)
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
            assert error == made.error_of(case, index, placed, setting)
        else:
            assert case.scene.blocks[vertex] in possible
            assert error is None
            placed |= {case.scene.blocks[vertex].order}
    assert match.n_blocks == len(case.scene)
    assert sum(map(match.errors.count, scoring.ERROR_TYPES)) == match.counts.fp


COUNTS = st.builds(Counts, *[st.integers(0, 1000)] * 3)


def level1(case, setting, criterion):
    return scoring.level1_counts(goal_of(case, setting), case.plan, criterion)


@each_setting
@given(case=cases())
def test_selection_matches_one_to_one_without_order_and_membership_counts_what_occurs(
    setting, case
):
    left, occurring = list(case.scene.blocks), 0
    for index in case.plan.steps:
        alike = [one for one in case.scene.blocks if equal(one, case.candidates[index], setting)]
        occurring += bool(alike)
        if hit := next((one for one in alike if one in left), None):
            left.remove(hit)
    steps, n = len(case.plan), len(case.scene)
    for criterion, tp in (("selection", n - len(left)), ("membership", occurring)):
        assert level1(case, setting, criterion) == Counts(tp, steps - tp, n - tp)


@given(counts=st.lists(COUNTS, max_size=8), half=st.integers(0, 8))
def test_micro_averages_sum_first_whatever_the_parts(counts, half):
    total = sum(counts[:half], Counts()) + sum(counts[half:], Counts())
    assert total == Counts(*(sum(getattr(c, name) for c in counts) for name in ("tp", "fp", "fn")))


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
    scorer = AssemblyScorer(case.scene, case.candidates, SETTINGS)
    scores, expected = scorer.score(case.plan, MATCHERS, level1), []
    for setting in SETTINGS:
        goal = goal_of(case, setting)
        for matcher in MATCHERS:
            match = match_plan(goal, case.plan, matcher)
            expected.append(("aov", setting, matcher, match.counts, match.vertices))
        if level1 is not None and 1 in case.scene.levels:
            counts = scoring.level1_counts(goal, case.plan, level1)
            expected.append((level1, setting, None, counts, None))
    found = [Score(**fields) for fields in scores]
    assert [
        (one.criterion, one.setting, one.matcher, Counts(one.tp, one.fp, one.fn), one.placed)
        for one in found
    ] == expected
    for score in found:
        if score.criterion == "aov":
            assert (sum(score.errors.values()), len(score.why)) == (score.fp, len(case.plan))
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
    (counted,) = scoring.block_outcomes(goal_of(case, setting), case.plan, [placed])
    return counted


def kept(case, setting):
    return scoring.steps_kept(goal_of(case, setting), case.plan)


def standing(case, setting, spare):
    """The most blocks that steps stand for one to one in a set that can stand, in which so many
    more of a kind may be.
    """
    most = 0
    for mask in product((False, True), repeat=len(case.scene)):
        chosen = [*compress(case.scene.blocks, mask)]
        orders = {block.order for block in chosen}
        if not all(orders.issuperset(block.depend) for block in chosen):
            continue
        left, more = list(case.plan.steps), Counter(spare)
        for block in chosen:
            step = next((i for i in left if equal(block, case.candidates[i], setting)), None)
            if step is None:
                more[block.kind] -= 1
            else:
                left.remove(step)
        if min(more.values(), default=0) >= 0:
            most = max(most, len(case.plan) - len(left))
    return most


@each_setting
@given(case=cases())
def test_blocks_lost_are_what_each_kinder_reading_of_the_plan_wins(setting, case):
    counted, n = outcomes(case, setting), len(case.scene)
    assert {*counted} == {*scoring.BLOCK_OUTCOMES}
    assert min(counted.values()) >= 0
    assert sum(counted.values()) == n
    named = {name: level1(case, name, "selection").tp for name in SETTINGS}
    assert counted["left_out"] == n - min(n, len(case.plan))
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
    edges = draw(made.acyclic(5).filter(bool))
    kinds = [*product(("arch", "cuboid3"), ("red", "blue", "green"))]
    blocks = tuple(
        made.block(v, (*kinds[v - 1], FLAT), (w + 1 for w in needed))
        for v, needed in enumerate(edges, 1)
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
    scene, n = case.scene, len(case.scene)
    candidates = CandidateSet(tuple({block.look: block for block in scene.blocks}.values()))
    order = scene.graph.random_order(np.random.default_rng(seed))
    steps = tuple(candidates.index_of(scene.blocks[vertex].look) for vertex in order)
    for plan, right, outcome in ((Plan(steps), n, "placed"), (Plan(), 0, "left_out")):
        one = Case(scene, candidates, plan)
        assert matched(one, setting).counts == Counts(right, 0, n - right)
        assert +Counter(outcomes(one, setting)) == {outcome: n}
        assert kept(one, setting) == right


@each_setting
@given(case=cases(max_blocks=7, max_steps=10) | carriers(), data=st.data())
def test_file_order_and_numbering_change_no_type_and_no_outcome(setting, case, data):
    def told(one):
        return Counter(matched(one, setting).errors), outcomes(one, setting), kept(one, setting)

    assert told(made.renumbered(case, data)) == told(case)


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
    assert placed <= most == scoring.steps_kept(goal, case.plan, placed)
    assert most <= level1(case, setting, "selection").tp


@pytest.mark.parametrize(
    ("ask", "more"),
    [
        (scoring.block_outcomes, [[0]]),
        (scoring.steps_kept, []),
        *((match_plan, [matcher]) for matcher in MATCHERS),
        *((scoring.level1_counts, [criterion]) for criterion in LEVEL1_CRITERIA),
    ],
)
def test_a_step_that_is_no_candidate_is_refused(ask, more):
    look = ("arch", "red", FLAT)
    scene = Scene("s", (3,), (made.block(1, look),), ("s",))
    with pytest.raises(KeyError):
        ask(Goal(scene, CandidateSet((Candidate(*look),)), "A"), Plan((1, 2)), *more)
