"""Places for a block: on which it comes down as marked, where it stays, and all round there."""

from __future__ import annotations

import math

import pytest

from phyblock.domain import QuestionPicture
from phyblock.domain.question import Mark
from phyblock.making.questions.affordance import (
    is_on_face,
    lowered,
    lowered_round,
    sort_of,
    stays_at,
    stays_round,
)
from phyblock.making.questions.picture_view import shows_solid
from phyblock.sim.contact import bounds_m
from phyblock.sim.question_pictures import Top
from tests.sim.structures import block, tower

TOP_M = 0.075
PLANK = [*tower(1), block(2, "cuboid3", (0, 0, 0.0625), (0, 0, 90))]
"""15 cm long along y, balanced on a cube in its middle,"""
WALL = block(3, "cuboid3", (0.055, 0.05, 0.075), (0, 90, 0))
"""beside one end, where it is in the way of a block that is put across the plank."""
PUT = block(4, "cuboid3", (0, 0, 0), (90, 0, 0))
VIEW = (300.0, 35.0)


@pytest.mark.parametrize(
    ("place_m", "stays"),
    [((0, 0), True), ((0, -0.068), False), ((0, 0.05), False), ((0, -0.053), None)],
)
def test_a_block_stays_where_the_plank_does_not_tip(
    place_m: tuple[float, float], stays: bool | None
) -> None:
    """It falls off the wall as well; unsure is where the weights are nearly over the edge."""
    plain = QuestionPicture("scene", (*PLANK, WALL), VIEW, marks=(Mark("A", (*place_m, TOP_M)),))
    assert stays_at(plain, PUT, (*place_m, TOP_M)) is stays
    assert is_on_face(plain, PUT, (*place_m, TOP_M)) is (place_m[1] <= 0)


def test_a_place_where_the_block_stays_on_its_neighbors_is_none() -> None:
    posts = [
        block(n, "cube", (x, 0, z))
        for n, (x, z) in enumerate(((-0.055, 0.025), (-0.055, 0.075), (0.055, 0.025)), 5)
    ]
    between = (*tower(1), *posts, block(8, "cube", (0.055, 0, 0.075)))
    at = (0.0, 0.0, 0.05)
    plain = QuestionPicture("scene", between, VIEW, marks=(Mark("A", at),))
    put = lowered(PUT, between, 0.0, 0.0)
    assert stays_round(put, between, (0.005,)) is True
    assert is_on_face(plain, PUT, at) is False
    assert stays_at(plain, PUT, at) is None


def test_a_block_is_let_down_all_round_as_far_off_as_told() -> None:
    put = lowered(PUT, PLANK, 0.0, 0.03)
    for radius_m in (0.00125, 0.005):
        around = list(lowered_round(put, PLANK, (radius_m,)))
        steps = [bounds_m(one).mean(axis=0) - bounds_m(put).mean(axis=0) for one in around]
        assert len({(round(float(x), 5), round(float(y), 5)) for x, y, _ in steps}) == 8
        for x, y, z in steps:
            assert math.hypot(x, y) == pytest.approx(radius_m, abs=2e-6)
            assert z == pytest.approx(0.0, abs=2e-6)


def test_a_verdict_that_turns_close_by_is_none() -> None:
    """A thin slab put over a gap of 5.2 cm bridges it, and drops in where it is 1 cm off."""
    posts = [block(1, "cube", (-0.051, 0, 0.025)), block(2, "cube", (0.051, 0, 0.025))]
    put = lowered(block(3, "cuboid2", (0, 0, 0)), posts, 0.0, 0.0)
    assert stays_round(put, posts, (0.005,)) is True
    assert stays_round(put, posts, (0.03,)) is None


@pytest.mark.parametrize(
    ("shape", "azimuth_deg", "shows"),
    [
        *(("roof", 0.0, True), ("roof", 45.0, True), ("roof", 90.0, False)),
        *(("slab", 0.0, False), ("slab", 45.0, True)),
    ],
)
def test_a_block_shows_its_profile_and_more_than_one_face_or_not(
    shape: str, azimuth_deg: float, shows: bool
) -> None:
    roof, slab = block(1, "triangle", (0, 0, 0)), block(1, "cuboid3", (0, 0, 0), (0, 90, 0))
    assert shows_solid(roof if shape == "roof" else slab, (azimuth_deg, 30.0)) is shows


def test_four_places_are_of_a_sort_by_three_ranks_of_the_right_one() -> None:
    """Highest in the picture and apart from three on a low plank, not over its block's middle."""
    post = [block(n, "cube", (-0.3, 0, 0.025 + 0.05 * (n - 3))) for n in (3, 4, 5)]
    plain = QuestionPicture("scene", (*PLANK, *post), VIEW)
    right = Top((-0.31, 0.0, 0.15), 1.0, 0.01)
    wrong = [Top((0.0, y, TOP_M), 1.0, abs(y)) for y in (0.0, 0.005, 0.05)]
    assert sort_of(plain, [right, *wrong]) == "central 2, up 0, alone 3"
    assert sort_of(plain, [*wrong, right]) == "central 0, up 3, alone 1"
