"""Letting a partly built structure go, and looking at it from where the goal is seen."""

from __future__ import annotations

import io
import itertools
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from phyblock.data import read_builtin
from phyblock.domain import Block, Scene
from phyblock.sim.dynamics import DEFAULT_TRIAL, ONE_SETTING, Settled, Site, Trial, check, settle
from phyblock.sim.engine import World
from phyblock.sim.pictures import PictureStyle, goal_png
from phyblock.sim.question_pictures import question_key, question_png, state_picture

STYLE = PictureStyle(128)
BUILT_IN = read_builtin(Path(__file__).parents[2] / "benchmarks" / "data" / "phyblock-400").tasks


def seesaw() -> Scene:
    """A bar whose middle is far from the cube it lies on: it tips until a second cube is there."""
    blocks = (
        Block(1, "cube", "red", (0, 0, 0.025), (0, 0, 0), (), 1),
        Block(2, "cuboid3", "yellow", (0.055, 0, 0.0625), (0, 0, 0), (1,), 2),
        Block(3, "cube", "blue", (0.11, 0, 0.025), (0, 0, 0), (), 1),
    )
    return Scene("seesaw", (3,), blocks, ("seesaw",))


def test_what_stands_stays_where_it_was_put() -> None:
    with closing(Site()) as site:
        for task in BUILT_IN[::80]:
            found = site.settle(task.scene.blocks)
            assert found.stands
            assert found.blocks == task.scene.blocks


def test_what_tips_is_shown_where_it_lies() -> None:
    bar = seesaw().blocks[:2]
    found = settle(bar)
    assert found.fallen == (2,)
    assert found.blocks[0] == bar[0]
    lying = found.blocks[1]
    assert lying.position_m[2] < bar[1].position_m[2] - 0.01
    assert abs(lying.euler_deg[1]) > 10
    assert settle(seesaw().blocks).stands


def test_an_empty_ground_stands() -> None:
    assert settle(()).stands


@pytest.mark.parametrize("trial", [ONE_SETTING, DEFAULT_TRIAL], ids=["one", "default"])
def test_a_site_gives_the_same_verdict_whatever_was_tried_on_it_before(trial: Trial) -> None:
    structures = [task.scene.blocks for task in BUILT_IN[::150]]
    structures += [seesaw().blocks[:2], structures[0][:1], seesaw().blocks]
    with closing(Site(trial)) as site:
        first = [site.settle(blocks) for blocks in structures]
        again = [site.settle(blocks) for blocks in reversed(structures)][::-1]
    alone = []
    for blocks in structures:
        with closing(Site(trial)) as site:
            alone.append(site.settle(blocks))
    assert first == again == alone == [settle(blocks, trial) for blocks in structures]


def test_verdicts_are_those_of_a_full_trial() -> None:
    scene = seesaw()
    for count in range(1, 4):
        blocks = scene.blocks[:count]
        assert settle(blocks).fallen == check(blocks).fallen


def elsewhere(blocks: Sequence[Block]) -> tuple[Block, ...]:
    """The same arrangement in another place and in one color."""
    return tuple(
        replace(
            b, color="green", position_m=(b.position_m[0] + 0.3, b.position_m[1], b.position_m[2])
        )
        for b in blocks
    )


def test_an_arrangement_is_tried_once_wherever_it_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    simulated: list[float] = []
    step = World.step

    def counted(world: World, duration_s: float) -> None:
        simulated.append(duration_s)
        step(world, duration_s)

    monkeypatch.setattr(World, "step", counted)
    blocks = seesaw().blocks
    with closing(Site(ONE_SETTING)) as site:
        assert site.settle(blocks).stands
        once = len(simulated)
        moved = elsewhere(blocks)
        assert site.settle(moved) == Settled((), moved)
        assert site.settle(blocks).stands
        assert len(simulated) == once > 0
        third = tuple(replace(b, order=b.order + 10) for b in elsewhere(moved))
        assert site.settle((*blocks, *third)).stands, "two apart are each the one"
        assert len(simulated) == once
        assert site.settle(blocks[:2]).fallen == (2,)
        fell = len(simulated)
        assert site.settle(blocks[:2]).fallen == (2,)
        assert len(simulated) == fell > once


def test_what_stands_apart_from_what_falls_stays() -> None:
    bar = seesaw().blocks[:2]
    far = replace(bar[0], order=3, position_m=(-0.3, 0.0, 0.025))
    found = settle((*bar, far))
    assert found.fallen == (2,)
    assert found.blocks[2] == far


def test_a_site_opens_again_after_it_was_closed() -> None:
    site = Site(ONE_SETTING)
    assert site.settle(seesaw().blocks).stands
    site.close()
    assert site.settle(seesaw().blocks).stands
    site.close()


def test_a_finished_structure_is_seen_as_in_the_goal_picture() -> None:
    scene = BUILT_IN[0].scene
    assert question_png(state_picture(scene, scene.blocks, STYLE), STYLE) == goal_png(scene, STYLE)


def test_blocks_keep_their_place_in_the_picture_as_more_are_placed() -> None:
    """What the next block does not touch or shade is the same pixel by pixel."""
    scene = BUILT_IN[0].scene
    pictures = [
        np.asarray(Image.open(io.BytesIO(question_png(state_picture(scene, done, STYLE), STYLE))))
        for done in (scene.blocks[:count] for count in range(len(scene) + 1))
    ]
    assert all(one.shape == (128, 128, 3) for one in pictures)
    for before, after in itertools.pairwise(pictures):
        changed = (before != after).any(axis=2)
        assert 0 < changed.mean() < 0.5


def test_keys_tell_states_apart_and_nothing_else() -> None:
    scene = seesaw()
    keys = [
        question_key(state_picture(scene, scene.blocks[:count], STYLE), STYLE) for count in range(4)
    ]
    assert len(set(keys)) == 4
    other = Scene("another name", (4,), scene.blocks, ())
    assert question_key(state_picture(other, scene.blocks[:2], STYLE), STYLE) == keys[2]
