"""What holds for every picture: nothing is cut open, blocks stand out, sizes can be compared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from phyblock.data import read_builtin
from phyblock.data.questions import read_questions
from phyblock.domain import BLOCK_TYPES, Color
from phyblock.domain.question import QuestionPicture
from phyblock.making.poses import POSES
from phyblock.sim.backgrounds import GROUNDS, TEXTURED, floor
from phyblock.sim.camera import Camera, view_axes
from phyblock.sim.film import exploded_blocks
from phyblock.sim.pictures import (
    COLOR_RGB,
    DrawnBlock,
    PictureStyle,
    camera_for,
    candidate_camera,
    common_distance_m,
    drawn,
    goal_camera,
    goal_style,
    on_the_floor,
    picture,
    segments,
    shoot,
)
from phyblock.sim.question_pictures import drawn_blocks, question_camera
from phyblock.types import BACKGROUNDS, Background
from tests.sim.structures import block, clouds, scene_of

DATA = Path(__file__).parents[2] / "benchmarks" / "data"
SCENES = read_builtin(DATA / "phyblock-400")
STYLE = PictureStyle()
SIZE_PX = 128
LEAST_CONTRAST = 3.0
EVERY_LOOK = [(kind, euler) for kind in BLOCK_TYPES for euler in POSES[kind].values()]
every_background = pytest.mark.parametrize(
    "background",
    [
        pytest.param(name, marks=pytest.mark.slow if name in TEXTURED else ())
        for name in BACKGROUNDS
    ],
)


def lies_between_planes(blocks: Sequence[DrawnBlock], camera: Camera) -> bool:
    points = np.vstack([one.vertices_m for one in blocks])
    depths = (points - camera.eye_m) @ camera.axes[2]
    return bool(0 < camera.near_m < depths.min() and depths.max() < camera.far_m)


def is_the_same_wide_open(blocks: Sequence[DrawnBlock], camera: Camera) -> bool:
    wide = replace(camera, near_m=1e-6, far_m=1e9)
    one, other = shoot(blocks, camera, SIZE_PX), shoot(blocks, wide, SIZE_PX)
    return one.rgb.tobytes() == other.rgb.tobytes() and (one.block == other.block).all()


def recipes(every: int) -> list[QuestionPicture]:
    questions = read_questions(DATA / "phyblock-vqa", SCENES).tasks[::every]
    return [picture for task in questions for picture in task.question.pictures]


def luminance(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Relative luminance of colors (..., 3), 0..255, as WCAG 2.2 defines it."""
    share = rgb / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    total: NDArray[np.float64] = linear @ np.array([0.2126, 0.7152, 0.0722])
    return total


def contrast(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    high, low = np.maximum(one, other), np.minimum(one, other)
    ratio: NDArray[np.float64] = (high + 0.05) / (low + 0.05)
    return ratio


@given(clouds(), st.integers(1, 6), st.floats(-180, 180), st.floats(1, 90))
@settings(max_examples=60, deadline=None)
def test_no_picture_of_a_question_is_cut_open_whatever_it_frames(
    blocks, framed, azimuth, elevation
) -> None:
    """Not even where blocks lie behind the place from which those in the frame are seen best."""
    recipe = QuestionPicture(
        "scene", tuple(blocks), (azimuth, elevation), framed=tuple(blocks[:framed])
    )
    assert lies_between_planes(drawn_blocks(recipe), question_camera(recipe, STYLE))


@pytest.mark.parametrize("every", [16, pytest.param(1, marks=pytest.mark.slow)])
def test_no_built_in_picture_is_cut_open(every: int) -> None:
    for task in SCENES.tasks[::every]:
        exploded = exploded_blocks(task.scene)
        assert lies_between_planes(drawn(task.scene.blocks), goal_camera(task.scene, STYLE))
        assert lies_between_planes(exploded, camera_for(exploded, STYLE, task.scene.id))
    for recipe in recipes(every):
        assert lies_between_planes(drawn_blocks(recipe), question_camera(recipe, STYLE)), recipe


@pytest.mark.parametrize("every", [80, pytest.param(4, marks=pytest.mark.slow)])
def test_built_in_pictures_are_the_same_with_the_planes_wide_open(every: int) -> None:
    for task in SCENES.tasks[::every]:
        assert is_the_same_wide_open(drawn(task.scene.blocks), goal_camera(task.scene, STYLE))
    for recipe in recipes(every):
        assert is_the_same_wide_open(drawn_blocks(recipe), question_camera(recipe, STYLE))


@pytest.mark.parametrize("scale", ["common", "fit"])
def test_no_candidate_is_cut_open(scale: str) -> None:
    blocks = [on_the_floor(kind, "red", euler) for kind, euler in EVERY_LOOK]
    distance_m = common_distance_m(blocks, STYLE) if scale == "common" else None
    for one in blocks:
        assert lies_between_planes([one], candidate_camera(one, STYLE, distance_m))


@given(st.lists(st.sampled_from(EVERY_LOOK), min_size=1, max_size=16), st.floats(1, 89))
@settings(max_examples=30, deadline=None)
def test_all_candidates_of_a_grid_have_one_scale_and_the_largest_fills_its_cell(
    looks, elevation: float
) -> None:
    style = replace(STYLE, elevation_deg=elevation)
    blocks = [on_the_floor(kind, "red", euler) for kind, euler in looks]
    distance_m = common_distance_m(blocks, style)
    fullest = []
    for one in blocks:
        camera = candidate_camera(one, style, distance_m)
        depths = (one.vertices_m - camera.eye_m) @ camera.axes[2]
        assert (depths.min() + depths.max()) / 2 == pytest.approx(distance_m)
        seen = camera.project(one.vertices_m)
        assert np.abs(seen).max() < 0.87
        fullest.append(max(np.ptp(seen, axis=0) / [1.72, 1.40]))
    assert max(fullest) == pytest.approx(1.0, abs=1e-6)


def test_a_long_block_looks_as_much_longer_than_a_cube_as_in_the_official_pictures() -> None:
    """There the box round the plank is about twice as wide as the one round the cube."""
    blocks = [on_the_floor(kind, "red", (0.0, 0.0, 90.0)) for kind in ("cube", "cuboid3")]
    distance_m = common_distance_m(blocks, STYLE)
    widths = [
        np.ptp(candidate_camera(one, STYLE, distance_m).project(one.vertices_m)[:, 0])
        for one in blocks
    ]
    assert widths[1] / widths[0] == pytest.approx(2.0, abs=0.15)


def test_blocks_of_a_wide_goal_are_as_large_in_pixels_as_those_of_others() -> None:
    sizes = set()
    for task in SCENES.tasks:
        style = goal_style(task.scene, STYLE)
        camera = goal_camera(task.scene, style)
        places = np.array([one.position_m for one in task.scene.blocks])
        farthest_m = ((places - camera.eye_m) @ camera.axes[2]).max()
        assert 0.05 / camera.width_m(farthest_m) * style.size_px >= 0.08 * STYLE.size_px
        sizes.add(style.size_px)
    assert min(sizes) == STYLE.size_px


def test_a_picture_grows_no_further_than_pictures_may() -> None:
    row = scene_of([block(i + 1, "cube", (2.0 * i, -2.0 * i, 0.025)) for i in range(9)])
    assert goal_style(row, STYLE).size_px == 2048


@every_background
@pytest.mark.parametrize("color", COLOR_RGB)
def test_every_face_stands_out_from_the_floor(background: Background, color: Color) -> None:
    """By a contrast of 3:1, its own or that of the line round it, along nine tenths of its edge.

    The floor is taken nine pixels to the side, where it may be in shadow.
    """
    one, size_px = on_the_floor("cube", color, (0.0, 0.0, 0.0)), 256
    camera = camera_for([one], STYLE, "cube")
    light = luminance(np.asarray(picture([one], camera, background, size_px), dtype=np.float64))
    inside = np.pad(segments([one], camera, size_px) >= 0, 4)
    rows, columns = np.nonzero(inside & ~np.roll(inside, 1, 1) | inside & ~np.roll(inside, -1, 1))
    clear = []
    for row, column in zip(rows - 4, columns - 4, strict=True):
        way = -1 if inside[row + 4, column + 5] else 1
        line = light[row, column - 3 : column + 4]
        clear.append(contrast(line, light[row, column + 9 * way]).max() >= LEAST_CONTRAST)
    assert np.mean(clear) >= 0.9


@every_background
def test_lines_round_blocks_stand_out_from_floor_and_shadow(background: Background) -> None:
    """But for the seams between boards, which are lines themselves."""
    one = on_the_floor("cube", "red", (0.0, 0.0, 0.0))
    camera = camera_for([one], STYLE, "cube")
    ground = floor(background, camera, 256).reshape(-1, 3).astype(np.float64)
    line = luminance(np.array(GROUNDS[background].rim, dtype=np.float64))
    for left in (1.0, 1 - GROUNDS[background].shadow):
        assert np.mean(contrast(line, luminance(ground * left)) >= LEAST_CONTRAST) >= 0.99


def test_views_are_exact_where_they_can_be() -> None:
    assert view_axes(0.0, 90.0).tolist() == [[0, 1, 0], [-1, 0, 0], [0, 0, -1]]
