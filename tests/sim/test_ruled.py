"""The ruled floor and the kit sheet: everything is in the picture, where it says it is."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from phyblock.domain import BLOCK_TYPES, SHAPES, BlockType, Candidate, CandidateSet, Scene
from phyblock.sim import ruled
from phyblock.sim.pictures import PictureStyle, drawn, goal_key, on_the_floor
from phyblock.sim.ruled import box_cm, kit_key, kit_png, ruled_key, ruled_png, written_style
from tests.sim.structures import block, tower

STYLE = PictureStyle(128)
SCENE = Scene("s", (2,), tuple(tower(2)), ("s",))
CANDIDATES = CandidateSet(tuple(Candidate(name, "red", (0.0, 0.0, 90.0)) for name in BLOCK_TYPES))


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(*[st.floats(-0.4, 0.4)] * 2, st.floats(0.025, 0.3)), min_size=1, max_size=4),
    st.floats(0, 360),
    st.floats(5, 90),
)
def test_all_that_is_ruled_and_written_is_in_the_picture(
    places: list[tuple[float, float, float]], azimuth_deg: float, elevation_deg: float
) -> None:
    blocks = [block(n, "cube", place) for n, place in enumerate(places, 1)]
    scene = Scene("s", (2,), tuple(blocks), ("s",))
    style = replace(STYLE, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)
    field = ruled._field(drawn(scene.blocks), style)
    camera = ruled._camera(drawn(scene.blocks), field, style)
    ends = [
        (x, y, 0.0) for x in (*field.x, field.beyond(0, 5)) for y in (*field.y, field.beyond(1, 5))
    ]
    assert np.abs(camera.project(np.array(ends) / 100)).max() <= 1
    points = np.vstack([one.vertices_m for one in drawn(scene.blocks)]) * 100
    for axis, (low, high) in enumerate((field.x, field.y)):
        assert low % 5 == high % 5 == 0
        assert low <= points[:, axis].min() - 3 + 1e-6
        assert points[:, axis].max() + 3 - 1e-6 <= high
    # The numbers are on the sides from which it is seen.
    middle = np.array([sum(field.x) / 2, sum(field.y) / 2])
    near = np.array([field.near_x, field.near_y]) - middle
    assert near @ -camera.axes[2, :2] >= -1e-6


def test_pictures_are_the_same_every_time_and_their_keys_tell_all_that_they_depend_on() -> None:
    png = ruled_png(SCENE, STYLE)
    assert png == ruled_png(SCENE, STYLE)
    with Image.open(io.BytesIO(png)) as picture:
        assert picture.size == (128, 128)
    other = replace(SCENE, blocks=SCENE.blocks[:1])
    turned = replace(STYLE, azimuth_deg=10)
    keys = {ruled_key(SCENE, STYLE), ruled_key(other, STYLE), ruled_key(SCENE, turned)}
    assert len(keys | {goal_key(SCENE, STYLE), kit_key(CANDIDATES, STYLE)}) == 5


def test_the_floor_is_ruled_where_there_are_no_blocks() -> None:
    """The line at y = -5 is told from the floor beside it."""
    style = PictureStyle(512, "white", 0.0, 90.0)
    field = ruled._field(drawn(SCENE.blocks), style)
    camera = ruled._camera(drawn(SCENE.blocks), field, style)
    with Image.open(io.BytesIO(ruled_png(SCENE, style))) as picture:
        pixels = np.asarray(picture.convert("L")).astype(int)

    def darkest(y_cm: float) -> int:
        column, row = (
            camera.to_pixels(np.array([[0.075, y_cm / 100, 0.0]]), 512)[0].round().astype(int)
        )
        return int(pixels[row, column - 1 : column + 2].min())

    assert darkest(-5) < darkest(-4) < darkest(-4.5)


@pytest.mark.parametrize("block_type", BLOCK_TYPES)
def test_the_sheet_says_the_dimensions_of_a_block_as_it_is_turned(block_type: BlockType) -> None:
    shape = SHAPES[block_type]
    upright = np.array(shape.high_m) - np.array(shape.low_m)
    low, high = box_cm(on_the_floor(block_type, "red", (0.0, 0.0, 0.0)))
    assert (high - low) / 100 == pytest.approx(upright, abs=0.001)
    low, high = box_cm(on_the_floor(block_type, "red", (0.0, 0.0, 90.0)))
    assert (high - low) / 100 == pytest.approx(upright[[1, 0, 2]], abs=0.001)
    assert low[2] == pytest.approx(0)


def test_the_sheet_is_drawn_large_enough_and_says_so_in_its_key() -> None:
    style = written_style(STYLE)
    assert style.size_px == 192
    assert kit_png(CANDIDATES, style) == kit_png(CANDIDATES, style)
    fewer = CandidateSet(CANDIDATES.candidates[:-1])
    assert kit_key(fewer, style) != kit_key(CANDIDATES, style)
    assert ruled._number(7.0711) == "7.1"
