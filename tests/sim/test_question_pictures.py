"""Pictures of questions: the same bytes for one recipe, framing that is shared, clear marks."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from phyblock.domain.question import Mark, QuestionPicture
from phyblock.domain.scene import Block
from phyblock.errors import DataError
from phyblock.sim.engine import Pose, quat_xyzw_to_euler_deg
from phyblock.sim.outcomes import after, after_removal, holds
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import (
    block_mark,
    differing_pixels,
    is_inside,
    question_camera,
    question_key,
    question_png,
    seen,
    seen_order,
)
from phyblock.types import BACKGROUNDS

STYLE = PictureStyle(256)
VIEW = (45.0, 22.0)


def cube(order: int, x: float, z: float, y: float = 0.0) -> Block:
    return Block(order, "cube", "red", (x, y, z), (0.0, 0.0, 0.0), (), 1)


TOWER = (cube(1, 0.0, 0.025), cube(2, 0.0, 0.075), cube(3, 0.1, 0.025))
PLAIN = QuestionPicture("scene", TOWER, VIEW)
MARKED = replace(PLAIN, marks=(Mark("A", (0.0, 0.0, 0.1)), Mark("B", (0.1, 0.0, 0.05))))

angles = st.floats(-180, 180, allow_nan=False)


def pixels(picture: QuestionPicture, style: PictureStyle = STYLE) -> np.ndarray:
    with Image.open(io.BytesIO(question_png(picture, style))) as image:
        return np.asarray(image, dtype=np.int64)


@given(angles, st.floats(-85, 85), angles)
def test_any_orientation_comes_back_from_its_quaternion(x: float, y: float, z: float) -> None:
    pose = Pose.goal(replace(TOWER[0], euler_deg=(x, y, z)))
    back = replace(TOWER[0], euler_deg=quat_xyzw_to_euler_deg(pose.quat_xyzw))
    assert Pose.goal(back).angle_deg(pose) < 0.01


def test_a_picture_stands_on_its_own_background_or_on_the_style_s() -> None:
    for background in BACKGROUNDS:
        own, style = replace(PLAIN, background=background), replace(STYLE, background=background)
        assert question_png(own, STYLE) == question_png(PLAIN, style)
        assert question_key(own, STYLE) == question_key(PLAIN, style)
    assert len({question_key(replace(PLAIN, background=b), STYLE) for b in BACKGROUNDS}) == len(
        BACKGROUNDS
    )


@settings(max_examples=12, deadline=None)
@given(angles, angles, angles, st.floats(0, 360), st.floats(5, 90))
def test_nothing_is_cut_off_whatever_the_pose(
    x: float, y: float, z: float, azimuth: float, elevation: float
) -> None:
    tilted = replace(TOWER[1], euler_deg=(x, y, z))
    assert is_inside(QuestionPicture("scene", (TOWER[0], tilted), (azimuth, elevation)))


def test_the_view_of_the_recipe_takes_the_place_of_the_styles() -> None:
    other = replace(STYLE, azimuth_deg=200.0, elevation_deg=70.0)
    assert question_png(PLAIN, STYLE) == question_png(PLAIN, other)
    assert question_key(PLAIN, STYLE) == question_key(PLAIN, other)


@pytest.mark.parametrize(
    "background",
    [
        *BACKGROUNDS[:2],
        *(pytest.param(name, marks=pytest.mark.slow) for name in BACKGROUNDS[2:]),
    ],
)
def test_marks_change_the_picture_on_every_background(background: str) -> None:
    style = PictureStyle(256, background)  # type: ignore[arg-type]
    step = np.abs(pixels(MARKED, style) - pixels(PLAIN, style)).max(axis=2)
    assert 300 < (step > 60).sum() < 3000


def test_keys_differ_exactly_where_pixels_may() -> None:
    others = [
        MARKED,
        replace(PLAIN, view_deg=(50.0, 22.0)),
        replace(PLAIN, blocks=TOWER[:2]),
        replace(PLAIN, framed=TOWER[:1]),
        replace(PLAIN, blocks=(*TOWER[:2], replace(TOWER[2], color="blue"))),
    ]
    keys = {question_key(picture, STYLE) for picture in (PLAIN, *others)}
    assert len(keys) == len(others) + 1
    assert question_key(replace(PLAIN, label="A"), STYLE) == question_key(PLAIN, STYLE)
    assert question_key(PLAIN, replace(STYLE, size_px=512)) not in keys


def test_pictures_framed_alike_share_a_camera() -> None:
    part = replace(PLAIN, blocks=TOWER[:1], framed=TOWER)
    one, other = question_camera(PLAIN, STYLE), question_camera(part, STYLE)
    assert np.array_equal(one.eye_m, other.eye_m)


def test_a_block_by_itself_lies_on_the_floor_wherever_it_is() -> None:
    high = QuestionPicture("block", (TOWER[1],), VIEW)
    low = QuestionPicture("block", (TOWER[0],), VIEW)
    assert question_png(high, STYLE) == question_png(low, STYLE)
    assert question_key(high, STYLE) == question_key(low, STYLE)


def test_a_picture_of_nothing_is_refused() -> None:
    with pytest.raises(DataError, match="none to draw"):
        question_png(QuestionPicture("scene", (), VIEW), STYLE)


def test_a_mark_on_a_block_shows_on_that_block() -> None:
    shot = seen(PLAIN)
    for block in TOWER:
        mark = block_mark(PLAIN, shot, block.order, "A")
        assert mark is not None
        assert seen_order(PLAIN, shot, mark.position_m) == block.order


def test_difference_counts_what_changed() -> None:
    one, other = seen(PLAIN), seen(replace(PLAIN, blocks=TOWER[:2], framed=TOWER))
    assert differing_pixels(one, one) == 0
    assert differing_pixels(one, other) > 500


def test_what_rests_on_a_removed_block_moves_and_nothing_else() -> None:
    outcome = after_removal(TOWER, 1)
    assert outcome.is_clear
    assert outcome.moved == (2,)
    assert outcome == after_removal(TOWER, 1)
    fallen = next(block for block in outcome.settled if block.order == 2)
    assert abs(fallen.position_m[2] - 0.025) < 0.002
    assert after_removal(TOWER, 3).moved == ()


def test_weight_just_over_an_edge_is_not_clear() -> None:
    """A cube half of which hangs over falls in every level world, and stays on many a table."""
    assert holds((TOWER[0], cube(2, 0.025, 0.075)), 2) is None
    assert holds((TOWER[0], cube(2, 0.035, 0.075)), 2) is False
    assert holds((TOWER[0], cube(2, 0.015, 0.075)), 2) is True


def test_blocks_at_rest_stay_at_their_very_places() -> None:
    outcome = after(TOWER)
    assert outcome.is_clear
    assert outcome.settled == TOWER
