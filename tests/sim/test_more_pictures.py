from __future__ import annotations

import io
import itertools

import numpy as np
import pytest
from PIL import Image, ImageSequence

from phyblock.domain import Scene
from phyblock.errors import DataError
from phyblock.sim.film import (
    animation,
    exploded_blocks,
    exploded_png,
    filmstrip_png,
    marked_png,
    step_images,
)
from phyblock.sim.pictures import (
    PictureStyle,
    camera_for,
    drawn,
    goal_camera,
    goal_png,
    shoot,
    visible_shares,
)
from tests.designs.scenes import designed_scenes
from tests.sim.structures import block, scene_of, tower

SMALL = PictureStyle(size_px=128)
SCENES = {scene.id: scene for scene in designed_scenes()}
SOME = ["l1-gate", "l2-rocket", "l3-elephant"]


def pixels(data: bytes) -> np.ndarray:
    with Image.open(io.BytesIO(data)) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def test_a_block_alone_is_seen_whole() -> None:
    assert visible_shares(scene_of(tower(1)), SMALL) == {1: 1.0}


def test_what_stands_behind_a_larger_block_is_not_seen() -> None:
    wall = [block(i + 1, "cuboid3", (0.1, 0.0, 0.0125 + 0.025 * i), (0, 0, 90)) for i in range(4)]
    hidden = block(5, "cube", (0.0, 0.0, 0.025))
    shares = visible_shares(scene_of([*wall, hidden]), PictureStyle.from_view("front", 128))
    assert shares[5] < 0.02
    assert shares[4] > 0.8
    assert all(shares[order] > 0.5 for order in range(1, 4))


@pytest.mark.parametrize("name", SOME)
def test_shares_add_up_to_what_the_picture_shows(name: str) -> None:
    scene = SCENES[name]
    shares = visible_shares(scene, SMALL)
    camera = goal_camera(scene, SMALL)
    alone = [int((shoot([one], camera, 128).block == 0).sum()) for one in drawn(scene.blocks)]
    shown = int((shoot(drawn(scene.blocks), camera, 128).block >= 0).sum())
    assert set(shares) == {b.order for b in scene.blocks}
    assert all(0 <= share <= 1 for share in shares.values())
    told = sum(n * share for n, share in zip(alone, shares.values(), strict=True))
    assert told == pytest.approx(shown, abs=0.04 * shown)


@pytest.mark.parametrize("name", sorted(SCENES))
def test_exploding_parts_what_stands_on_one_another(name: str) -> None:
    scene = SCENES[name]
    before, after = drawn(scene.blocks), exploded_blocks(scene)
    number = {b.order: v for v, b in enumerate(scene.blocks)}
    for vertex, one in enumerate(scene.blocks):
        for order in one.depend:
            rises = [
                blocks[vertex].vertices_m[:, 2].min() - blocks[number[order]].vertices_m[:, 2].max()
                for blocks in (before, after)
            ]
            assert rises[1] >= rises[0] + 0.034
    assert {(b.type, b.color, b.euler_deg) for b in after} == {
        (b.type, b.color, b.euler_deg) for b in before
    }
    places = np.vstack([one.vertices_m for one in after])
    assert np.abs(camera_for(after, SMALL, name).project(places)).max() < 0.85


def test_every_block_shows_more_when_exploded() -> None:
    scene = SCENES["l4-castle"]
    blocks = exploded_blocks(scene)
    seen = shoot(blocks, camera_for(blocks, SMALL, scene.id), 128).block
    assert set(range(len(scene))) <= set(np.unique(seen).tolist())
    assert exploded_png(scene, SMALL) == exploded_png(scene, SMALL)


@pytest.mark.parametrize("name", SOME)
def test_each_step_adds_to_the_picture_and_the_last_is_the_goal(name: str) -> None:
    scene = SCENES[name]
    steps = [np.asarray(image).astype(int) for image in step_images(scene, SMALL)]
    assert len(steps) == len(scene)
    assert np.array_equal(steps[-1], pixels(goal_png(scene, SMALL)))
    for before, after in itertools.pairwise(steps):
        assert (before != after).any()


@pytest.mark.parametrize("name", SOME)
def test_a_filmstrip_holds_every_step_below_its_number(name: str) -> None:
    scene = SCENES[name]
    strip = pixels(filmstrip_png(scene, SMALL))
    rows = -(-len(scene) // 6)
    columns = -(-len(scene) // rows)
    cell = np.array([(strip.shape[0] + 3) / rows, (strip.shape[1] + 3) / columns]).round()
    for number, image in enumerate(step_images(scene, SMALL)):
        top, left = (np.array(divmod(number, columns)) * cell).astype(int)
        caption = strip[top : top + int(cell[0]) - 128 - 3, left : left + 128]
        step = strip[top + int(cell[0]) - 128 - 3 :, left:][:128, :128]
        assert caption.min() < 90
        assert np.array_equal(caption[0], np.full((128, 3), 255))
        assert np.array_equal(step, np.asarray(image))


@pytest.mark.parametrize("kind", ["gif", "webp"])
def test_an_animation_shows_every_step_for_ever(kind: str) -> None:
    scene = SCENES["l2-rocket"]
    data = animation(scene, SMALL, kind)
    assert animation(scene, SMALL, kind) == data
    with Image.open(io.BytesIO(data)) as image:
        frames = [
            np.asarray(frame.convert("RGB")).astype(int) for frame in ImageSequence.Iterator(image)
        ]
        assert image.info["loop"] == 0
    steps = [np.asarray(one).astype(int) for one in step_images(scene, SMALL)]
    assert len(frames) == len(steps)
    for frame, step in zip(frames, steps, strict=True):
        assert np.abs(frame - step).mean() < (3 if kind == "gif" else 1e-9)


def test_an_order_that_cannot_be_built_has_no_steps() -> None:
    scene = SCENES["l1-gate"]
    backward = Scene("backward", (1,), scene.blocks[::-1], ("backward",))
    with pytest.raises(DataError, match="backward"):
        step_images(backward, SMALL)


def test_marked_blocks_keep_their_colors_and_others_fade() -> None:
    blocks = [
        block(1, "cube", (0.0, -0.06, 0.025), color="red"),
        block(2, "cube", (0.0, 0.06, 0.025), color="blue"),
    ]
    style = PictureStyle.from_view("front", 128, "white")
    plain, marked = (pixels(marked_png(scene_of(blocks), named, style)) for named in ([], [2]))
    assert np.array_equal(plain, pixels(goal_png(scene_of(blocks), style)))
    seen = shoot(drawn(scene_of(blocks).blocks), goal_camera(scene_of(blocks), style), 128).block
    inside = {n: (np.pad(seen, 2)[4:, 4:] == n) & (np.pad(seen, 2)[:-4, :-4] == n) for n in (0, 1)}
    assert np.array_equal(marked[inside[1]], plain[inside[1]])
    assert (255 - marked[inside[0]]).mean() < 0.45 * (255 - plain[inside[0]]).mean()
