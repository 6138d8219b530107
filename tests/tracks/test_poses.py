"""How often the right pose of a kind is chosen, by where it is listed."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain import Candidate, CandidateSet, Scene
from phyblock.domain.scene import Block
from phyblock.tracks.full_planning import pose_choices, pose_counts

UP, OVER, ASIDE = (0.0, 0.0, 0.0), (90.0, 0.0, 0.0), (0.0, 0.0, 90.0)
SCENE = Scene(
    "poses",
    (2,),
    (
        Block(1, "cuboid2", "red", (0, 0, 0.025), UP, (), 1),
        Block(2, "arch", "blue", (0, 0, 0.1), UP, (1,), 2),
        Block(3, "cube", "green", (0, 0, 0.2), UP, (2,), 3),
    ),
    ("poses",),
)
CANDIDATES = CandidateSet(
    (
        Candidate("cuboid2", "red", UP),
        Candidate("cuboid2", "red", OVER),
        Candidate("arch", "blue", ASIDE),
        Candidate("arch", "blue", UP),
        Candidate("cube", "green", UP),
        Candidate("triangle", "red", UP),
        Candidate("triangle", "red", OVER),
    )
)
plans = st.lists(st.integers(-1, 9), max_size=10)


def test_the_first_pose_named_of_a_kind_counts() -> None:
    assert pose_counts(SCENE, CANDIDATES, [1, 4, 5, 6]) == (1, 1, 1, 1)
    assert pose_counts(SCENE, CANDIDATES, [2, 1, 3, 4]) == (0, 1, 0, 1)
    assert pose_counts(SCENE, CANDIDATES, [4]) == (0, 0, 1, 1)
    assert pose_counts(SCENE, CANDIDATES, [5, 6, 7, 0, 99]) == (0, 0, 0, 0)


@given(plans, st.permutations(range(1, 8)))
def test_the_order_of_the_list_moves_choices_between_first_and_later_alone(
    plan: list[int], order: list[int]
) -> None:
    shown = CandidateSet(tuple(CANDIDATES[number] for number in order))
    there = [order.index(n) + 1 if 1 <= n <= 7 else n for n in plan]
    here = sorted(is_right for _, is_right in pose_choices(SCENE, CANDIDATES, plan))
    assert here == sorted(is_right for _, is_right in pose_choices(SCENE, shown, there))


@given(plans)
def test_no_more_kinds_are_counted_than_are_named(plan: list[int]) -> None:
    first_right, first, later_right, later = pose_counts(SCENE, CANDIDATES, plan)
    assert 0 <= first_right <= first
    assert 0 <= later_right <= later
    assert first + later <= len(set(plan))
