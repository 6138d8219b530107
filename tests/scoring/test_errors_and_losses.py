"""Wrong steps and lost goal blocks: one type for each, and the right one."""

from collections import Counter
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain.scene import Block, Candidate, CandidateSet, Plan, Scene
from phyblock.scoring.plan import (
    BLOCK_OUTCOMES,
    ERROR_TYPES,
    Goal,
    block_outcomes,
    count_errors,
    level1_counts,
    match_plan,
    step_errors,
    steps_kept,
)
from phyblock.types import LEVEL1_CRITERIA, MATCHERS, SETTINGS
from tests.scoring.cases import FLAT, TURNED, Case, acyclic, carriers, cases, equal, renumbered


def errors_of(case, setting, matcher):
    goal = Goal(case.scene, case.candidates, setting)
    match = match_plan(goal, case.plan, matcher)
    return step_errors(goal, case.plan, match)


def true_of(case, setting, index, placed):
    """The four definitions, each written out whole, of which exactly one must hold."""
    candidate = case.candidates[index]
    of_kind = [b for b in case.scene.blocks if b.kind == candidate.kind]
    free = [b for b in of_kind if b.order not in placed]
    free_equal = [b for b in free if equal(b, candidate, setting)]
    holds = {
        "shape_not_in_gt": not of_kind,
        "overflow": bool(of_kind) and not free,
        "incorrect_orientation": bool(free) and not free_equal,
        "dependency_not_met": bool(free_equal)
        and not any(placed.issuperset(b.depend) for b in free_equal),
    }
    (name,) = (name for name, true in holds.items() if true)
    return name


@pytest.mark.parametrize("matcher", MATCHERS)
@pytest.mark.parametrize("setting", SETTINGS)
@given(case=cases(max_blocks=8, max_steps=12))
def test_each_wrong_step_has_exactly_the_one_type_that_holds(setting, matcher, case):
    match = match_plan(Goal(case.scene, case.candidates, setting), case.plan, matcher)
    errors = errors_of(case, setting, matcher)
    placed = set()
    for index, vertex, error in zip(case.plan.steps, match.vertices, errors, strict=True):
        if vertex is None:
            assert error == true_of(case, setting, index, placed)
        else:
            assert error is None
            placed.add(case.scene.blocks[vertex].order)
    counted = count_errors(errors)
    assert tuple(counted) == ERROR_TYPES
    assert sum(counted.values()) == match.counts.fp


@pytest.mark.parametrize("setting", SETTINGS)
@given(case=st.one_of(cases(max_blocks=7, max_steps=10), carriers()), data=st.data())
def test_file_order_of_blocks_changes_no_type_under_optimal(setting, case, data):
    blocks = tuple(data.draw(st.permutations(case.scene.blocks)))
    shuffled = replace(case, scene=replace(case.scene, blocks=blocks))
    assert count_errors(errors_of(shuffled, setting, "optimal")) == count_errors(
        errors_of(case, setting, "optimal")
    )


@pytest.mark.parametrize("first", [0, 1])
def test_of_choices_alike_the_one_with_the_lightest_types_is_taken(first):
    # Either cube can be the one that is named, and then either arch stands; only if the turned
    # one does is the flat one, at its second naming, in no other pose than the one that is left.
    cubes = [Block(n, "cube", "red", FLAT, FLAT, (), 1) for n in (1, 2)]
    arches = [
        Block(n, "arch", "red", FLAT, turn, (n - 2,), 2) for n, turn in ((3, FLAT), (4, TURNED))
    ]
    blocks = (cubes[first], cubes[1 - first], *arches)
    looks = (("cube", FLAT), ("arch", FLAT), ("arch", TURNED))
    candidates = CandidateSet(tuple(Candidate(kind, "red", turn) for kind, turn in looks))
    case = Case(Scene("s", (3,), blocks, ("s",)), candidates, Plan((1, 2, 3, 2)))
    early = "dependency_not_met"
    assert errors_of(case, "A", "optimal") == (None, early, None, early)


each_setting = pytest.mark.parametrize("setting", SETTINGS)


def outcomes(case, setting):
    goal = Goal(case.scene, case.candidates, setting)
    (counted,) = block_outcomes(goal, case.plan, [match_plan(goal, case.plan, "optimal").counts.tp])
    return counted


def kept(case, setting):
    return steps_kept(Goal(case.scene, case.candidates, setting), case.plan)


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
    goals = {name: Goal(case.scene, case.candidates, name) for name in SETTINGS}
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

    goal = Goal(case.scene, case.candidates, "A")
    placed = set(match_plan(goal, case.plan, "optimal").vertices)
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
def test_a_valid_order_places_all_and_an_empty_plan_leaves_all_out(setting, case, seed):
    scene = case.scene
    looks = {
        block.look: Candidate(block.type, block.color, block.euler_deg) for block in scene.blocks
    }
    candidates = CandidateSet(tuple(looks.values()))
    order = scene.graph.random_order(np.random.default_rng(seed))
    steps = tuple(list(looks).index(scene.blocks[v].look) + 1 for v in order)
    right = Case(scene, candidates, Plan(steps))
    assert +Counter(outcomes(right, setting)) == {"placed": len(scene)}
    assert kept(right, setting) == len(scene)
    empty = replace(right, plan=Plan())
    assert +Counter(outcomes(empty, setting)) == {"left_out": len(scene)}
    assert kept(empty, setting) == 0


@each_setting
@given(case=cases(max_blocks=7, max_steps=10), data=st.data())
def test_file_order_and_numbering_change_neither(setting, case, data):
    shuffled = renumbered(case, data)
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
    placed = match_plan(Goal(case.scene, case.candidates, setting), case.plan, "optimal").counts.tp
    goal = Goal(case.scene, case.candidates, setting)
    assert placed <= most == steps_kept(goal, case.plan, placed)
    assert most <= level1_counts(goal, case.plan, "selection").tp


def test_a_step_that_is_no_candidate_is_refused():
    scene = Scene("s", (3,), (Block(1, "arch", "red", FLAT, FLAT, (), 1),), ("s",))
    goal, plan = Goal(scene, CandidateSet((Candidate("arch", "red", FLAT),)), "A"), Plan((1, 2))
    asked = [
        lambda: block_outcomes(goal, plan, [0]),
        lambda: steps_kept(goal, plan),
        *(lambda matcher=matcher: match_plan(goal, plan, matcher) for matcher in MATCHERS),
        *(lambda name=name: level1_counts(goal, plan, name) for name in LEVEL1_CRITERIA),
    ]
    for ask in asked:
        with pytest.raises(KeyError):
            ask()
