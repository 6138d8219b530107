from __future__ import annotations

import hashlib
import io
import itertools
import pickle
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest
from PIL import Image

from phyblock.domain import KIT_PALETTE, Candidate, CandidateSet, Scene
from phyblock.errors import DataError
from phyblock.making.poses import POSES
from phyblock.making.scenes.candidates import make_candidates
from phyblock.sim.pictures import (
    LABEL_STRIP,
    PictureStyle,
    candidate_camera,
    candidates_grid,
    candidates_key,
    candidates_png,
    composite_png,
    goal_key,
    goal_png,
    on_the_floor,
    picture,
    shoot,
    thumbnail,
)
from phyblock.types import BACKGROUNDS
from tests.designs.scenes import designed_scene
from tests.sim.structures import block, scene_of

SMALL = PictureStyle(size_px=128)
EVERY_LOOK = [
    Candidate(block_type, color, euler)
    for block_type, color in KIT_PALETTE
    for euler in POSES[block_type].values()
]


def designed(name: str) -> Scene:
    return designed_scene(name)


def opened(png: bytes) -> np.ndarray:
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert("RGB"))


SIZED = list(zip(itertools.cycle([128, 130]), BACKGROUNDS))


@pytest.mark.parametrize(
    ("size_px", "background"),
    [*SIZED[:2], *(pytest.param(*one, marks=pytest.mark.slow) for one in SIZED[2:])],
)
def test_pictures_are_squares_of_the_size_asked_for(size_px: int, background: str) -> None:
    scene = designed("l1-gate")
    style = PictureStyle(size_px=size_px, background=background)
    goal, grid = goal_png(scene, style), candidates_png(make_candidates(scene), style)
    assert opened(goal).shape == opened(grid).shape == (size_px, size_px, 3)
    height, width, _ = opened(composite_png(goal, grid)).shape
    assert height == size_px
    assert 2 * size_px < width < 2.1 * size_px


def test_composite_is_goal_gap_and_grid() -> None:
    goal = goal_png(designed("l1-gate"), SMALL)
    grid = candidates_png(make_candidates(designed("l1-gate")), SMALL)
    whole = opened(composite_png(goal, grid))
    assert np.array_equal(whole[:, :128], opened(goal))
    assert np.array_equal(whole[:, -128:], opened(grid))
    assert np.all(whole[:, 128:-128] == 255)


def test_blocks_show_in_their_colors() -> None:
    """Most saturated pixel of a one-block picture: red is red, blue is blue, and so on."""
    strongest = {"red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1), "yellow": (1, 1, 0)}
    for color, channels in strongest.items():
        scene = scene_of([block(1, "cube", (0.0, 0.0, 0.025), color=color)])
        pixels = opened(goal_png(scene, replace(SMALL, background="white"))).astype(int)
        middle = pixels[60:68, 50:60].reshape(-1, 3).mean(axis=0)
        bright = tuple(int(channel > 0.6 * middle.max()) for channel in middle)
        assert bright == channels


@pytest.mark.parametrize("elevation_deg", [1.0, 22.0, 90.0])
def test_any_elevation_can_be_drawn(elevation_deg: float) -> None:
    pixels = opened(goal_png(designed("l2-throne"), replace(SMALL, elevation_deg=elevation_deg)))
    assert pixels.std() > 10


@pytest.mark.parametrize("candidate", EVERY_LOOK, ids=lambda c: f"{c.type}-{c.color}-{c.euler_deg}")
def test_a_candidate_fills_its_cell_and_leaves_room_for_its_number(candidate: Candidate) -> None:
    one = on_the_floor(candidate.type, candidate.color, candidate.euler_deg)
    size_px = 128
    shot = shoot([one], candidate_camera(one, PictureStyle()), size_px)
    rows, columns = np.nonzero(shot.block >= 0)
    assert rows.max() < size_px * (1 - LABEL_STRIP)
    assert rows.min() > 0.04 * size_px
    assert 0.04 * size_px < columns.min() <= columns.max() < 0.96 * size_px
    share = max(np.ptp(rows) / (1 - LABEL_STRIP), np.ptp(columns)) / size_px
    assert 0.6 < share < 0.95


@pytest.mark.parametrize("background", BACKGROUNDS)
@pytest.mark.parametrize("size_px", [128, 256, 512, 1024])
def test_numbers_stay_in_the_strip_below_the_blocks(size_px: int, background: str) -> None:
    cell_px = size_px // 4
    style = PictureStyle(size_px, background)
    cubes = CandidateSet((Candidate("cube", "red", (0.0, 0.0, 0.0)),) * 16)
    sheet, (block, *_), distance_m = candidates_grid(cubes, style)
    grid = np.asarray(sheet).astype(int)
    plain = np.asarray(thumbnail(block, style, cell_px, distance_m)).astype(int)
    for row, column in itertools.product(range(4), range(4)):
        cell = grid[row * cell_px : (row + 1) * cell_px, column * cell_px : (column + 1) * cell_px]
        ink = np.abs(cell - plain)[2:-2, 2:-2].max(axis=-1) > 20
        assert ink.any()
        assert np.nonzero(ink)[0].min() + 2 >= (1 - LABEL_STRIP) * cell_px
        assert np.nonzero(ink)[1].min() + 2 > cell_px / 2


def test_no_two_looks_have_the_same_picture() -> None:
    style = PictureStyle()
    pixels = {}
    for candidate in EVERY_LOOK:
        one = on_the_floor(candidate.type, candidate.color, candidate.euler_deg)
        image = picture([one], candidate_camera(one, style), "white", 64)
        pixels.setdefault(candidate.look, np.asarray(image).astype(int))
    for one, other in itertools.combinations(pixels.values(), 2):
        assert (np.abs(one - other).max(axis=-1) > 45).mean() > 0.01


def test_places_without_a_candidate_stay_empty() -> None:
    one = CandidateSet((Candidate("cube", "red", (0.0, 0.0, 0.0)),))
    grid = opened(candidates_png(one, SMALL)).astype(int)
    red = (grid[..., 0] > 150) & (grid[..., 1] < 90)
    assert red[:32, :32].any()
    assert not red[32:].any()
    assert not red[:, 32:].any()


def test_the_same_bytes_in_every_process() -> None:
    scene = designed("l3-torii")
    candidates = make_candidates(scene)
    here = [goal_png(scene, SMALL), candidates_png(candidates, SMALL)]
    assert [goal_png(scene, SMALL), candidates_png(candidates, SMALL)] == here
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        goals = [pool.submit(goal_png, scene, SMALL) for _ in range(2)]
        grids = [pool.submit(candidates_png, candidates, SMALL) for _ in range(2)]
        assert {job.result() for job in goals} == {here[0]}
        assert {job.result() for job in grids} == {here[1]}
    assert b"tIME" not in here[0]
    assert b"tEXt" not in here[0]


def test_keys_name_the_content_and_not_the_scene() -> None:
    scene = designed("l1-gate")
    other = designed("l1-dog")
    assert goal_key(scene, SMALL) == goal_key(replace(scene, id="another", levels=(4,)), SMALL)
    turned = replace(
        scene, blocks=(replace(scene.blocks[0], euler_deg=(0.0, 0.0, 90.0)), *scene.blocks[1:])
    )
    keys = {
        goal_key(scene, SMALL),
        goal_key(other, SMALL),
        goal_key(turned, SMALL),
        goal_key(scene, replace(SMALL, size_px=256)),
        goal_key(scene, replace(SMALL, background="white")),
        goal_key(scene, replace(SMALL, azimuth_deg=10.0)),
        goal_key(scene, replace(SMALL, elevation_deg=10.0)),
        candidates_key(make_candidates(scene), SMALL),
        candidates_key(make_candidates(other), SMALL),
    }
    assert len(keys) == 9
    assert all(len(key) == hashlib.sha256().digest_size * 2 for key in keys)


def test_a_style_is_checked_and_can_be_sent_to_a_process() -> None:
    assert pickle.loads(pickle.dumps(SMALL)) == SMALL
    assert len({SMALL, replace(SMALL), PictureStyle()}) == 2
    bad = [{"size_px": 10}, {"background": "lava"}, {"elevation_deg": -5.0}]
    for wrong in [*bad, {"azimuth_deg": float("nan")}]:
        with pytest.raises(ValueError, match=next(iter(wrong))):
            PictureStyle(**wrong)
    with pytest.raises(ValueError, match="oblique"):
        PictureStyle.from_view("below")


def test_a_scene_without_blocks_has_no_picture() -> None:
    with pytest.raises(DataError, match="empty"):
        goal_png(scene_of([], "empty"), SMALL)
