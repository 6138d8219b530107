"""Error types: one for each wrong step, and the right one."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain import Block, Candidate, CandidateSet, Plan, Scene
from phyblock.scoring.plan import (
    ERROR_TYPES,
    ErrorType,
    Goal,
    count_errors,
    match_plan,
    step_errors,
)
from phyblock.types import MATCHERS, SETTINGS, Matcher, Setting
from tests.scoring.cases import Case, cases, equal

FLAT, TURNED = (0.0, 0.0, 0.0), (0.0, 0.0, 90.0)


def errors_of(case: Case, setting: Setting, matcher: Matcher) -> tuple[ErrorType | None, ...]:
    goal = Goal(case.scene, case.candidates, setting)
    match = match_plan(goal, case.plan, matcher)
    return step_errors(goal, case.plan, match)


def true_of(case: Case, setting: Setting, index: int, placed: set[int]) -> ErrorType:
    """The four definitions, each written out whole, of which exactly one must hold."""
    candidate = case.candidates[index]
    of_kind = [b for b in case.scene.blocks if b.kind == candidate.kind]
    free = [b for b in of_kind if b.order not in placed]
    free_equal = [b for b in free if equal(b, candidate, setting)]
    holds: dict[ErrorType, bool] = {
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
def test_each_wrong_step_has_exactly_the_one_type_that_holds(
    setting: Setting, matcher: Matcher, case: Case
) -> None:
    match = match_plan(Goal(case.scene, case.candidates, setting), case.plan, matcher)
    errors = errors_of(case, setting, matcher)
    placed: set[int] = set()
    for index, vertex, error in zip(case.plan.steps, match.vertices, errors, strict=True):
        if vertex is None:
            assert error == true_of(case, setting, index, placed)
        else:
            assert error is None
            placed.add(case.scene.blocks[vertex].order)
    counted = count_errors(errors)
    assert tuple(counted) == ERROR_TYPES
    assert sum(counted.values()) == match.counts.fp


@pytest.mark.parametrize("matcher", MATCHERS)
@given(case=cases())
def test_orientation_is_never_wrong_where_it_is_not_compared(matcher: Matcher, case: Case) -> None:
    assert "incorrect_orientation" not in errors_of(case, "B", matcher)


def test_the_four_types() -> None:
    position = (0.0, 0.0, 0.0)
    blocks = (
        Block(1, "cuboid3", "red", position, FLAT, (), 1),
        Block(2, "arch", "red", position, FLAT, (1,), 2),
    )
    candidates = CandidateSet(
        (
            Candidate("cuboid3", "red", FLAT),
            Candidate("arch", "red", FLAT),
            Candidate("arch", "red", TURNED),
            Candidate("arch", "blue", FLAT),
        )
    )
    scene = Scene("s", (3,), blocks, ("s",))
    case = Case(scene, candidates, Plan((4, 2, 3, 1, 1, 2, 3)))
    overflow, early = "overflow", "dependency_not_met"
    assert errors_of(case, "A", "paper") == (
        "shape_not_in_gt", early, "incorrect_orientation", None, overflow, None, overflow,
    )  # fmt: skip
    assert errors_of(case, "B", "paper") == (
        "shape_not_in_gt", early, early, None, overflow, None, overflow,
    )  # fmt: skip


@st.composite
def carriers(draw: st.DrawFn) -> Case:
    """Equal cubes that carry blocks of few kinds: what the plan names depends on which it takes."""
    position = (0.0, 0.0, 0.0)
    n_cubes = draw(st.integers(2, 3))
    blocks = [Block(n + 1, "cube", "red", position, FLAT, (), 1) for n in range(n_cubes)]
    tops = [("arch", "red", FLAT), ("arch", "red", TURNED), ("arch", "blue", FLAT)]
    for cube in range(n_cubes):
        for top in draw(st.lists(st.sampled_from(tops), min_size=1, max_size=2)):
            blocks.append(Block(len(blocks) + 1, *top[:2], position, top[2], (cube + 1,), 2))
    candidates = CandidateSet((Candidate("cube", "red", FLAT), *(Candidate(*top) for top in tops)))
    tail = draw(st.lists(st.integers(1, len(candidates)), min_size=3, max_size=7))
    return Case(Scene("s", (3,), tuple(blocks), ("s",)), candidates, Plan((1, *tail)))


@pytest.mark.parametrize("setting", SETTINGS)
@given(case=st.one_of(cases(max_blocks=7, max_steps=10), carriers()), data=st.data())
def test_file_order_of_blocks_changes_no_type_under_optimal(
    setting: Setting, case: Case, data: st.DataObject
) -> None:
    blocks = tuple(data.draw(st.permutations(case.scene.blocks)))
    shuffled = replace(case, scene=replace(case.scene, blocks=blocks))
    assert count_errors(errors_of(shuffled, setting, "optimal")) == count_errors(
        errors_of(case, setting, "optimal")
    )


@pytest.mark.parametrize("first", [0, 1])
def test_of_choices_alike_the_one_with_the_lightest_types_is_taken(first: int) -> None:
    # Either cube can be the one that is named, and then either arch stands; only if the turned
    # one does is the flat one, at its second naming, in no other pose than the one that is left.
    position = (0.0, 0.0, 0.0)
    cubes = [Block(n, "cube", "red", position, FLAT, (), 1) for n in (1, 2)]
    blocks = (
        cubes[first],
        cubes[1 - first],
        Block(3, "arch", "red", position, FLAT, (1,), 2),
        Block(4, "arch", "red", position, TURNED, (2,), 2),
    )
    candidates = CandidateSet(
        (
            Candidate("cube", "red", FLAT),
            Candidate("arch", "red", FLAT),
            Candidate("arch", "red", TURNED),
        )
    )
    case = Case(Scene("s", (3,), blocks, ("s",)), candidates, Plan((1, 2, 3, 2)))
    early = "dependency_not_met"
    assert errors_of(case, "A", "optimal") == (None, early, None, early)
