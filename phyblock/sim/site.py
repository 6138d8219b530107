"""A building site: blocks put at their goal poses, let go, and looked at from one place.

A partly built structure is always tried with every block at its goal pose, so that no step is
judged by the drift of the ones before it. Blocks that nothing brings near one another are tried
apart (as in `steps`), and each arrangement once, wherever on the ground and in whatever colors it
is met again: a verdict depends on nothing that was tried before.
"""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image

from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.sim.camera import Camera
from phyblock.sim.engine import PhysicsEngine
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_camera
from phyblock.sim.registry import physics_engine
from phyblock.sim.render import DrawnBlock, empty_ground, picture
from phyblock.sim.stability import DEFAULT_TRIAL, Trial, movement
from phyblock.sim.steps import groups, wait
from phyblock.sim.world import Physics, World

__all__ = ["ONE_SETTING", "Lookout", "Settled", "Site", "settle", "state_picture"]

ONE_SETTING = Trial(physics=DEFAULT_TRIAL.physics[:1])
"""A trial that costs half as much as the default and decides nothing that a score rests on."""

_KEPT = 65_536
"""Arrangements and states that are remembered, about 1 kB each."""
_PLACE_DIGITS = 6
_ONE_AT_A_TIME = threading.Lock()
_COLLAPSE_S = 3.0
"""How long fallen blocks are given to come to rest [s]."""


@dataclass(frozen=True)
class Settled:
    """What became of blocks that were let go.

    `fallen` are the orders of those that passed the trial's limits, or did so in the fall of
    others; `blocks` all of them, at their goal poses but for the fallen, which lie where they came
    to rest.
    """

    fallen: tuple[int, ...]
    blocks: tuple[Block, ...]

    @property
    def stands(self) -> bool:
        """Whether every block stayed where it was put."""
        return not self.fallen


class Site:
    """Worlds kept open to try one state after another, each once; a context manager.

    The chosen physics engine tries them unless another is given.
    """

    def __init__(self, trial: Trial = DEFAULT_TRIAL, tried_by: PhysicsEngine | None = None) -> None:
        self.trial = trial
        self._engine = tried_by or physics_engine()
        self._stack = contextlib.ExitStack()
        self._worlds: dict[Physics, World] = {}
        self._known = functools.lru_cache(_KEPT)(self._settle)
        self._standing = functools.lru_cache(_KEPT)(self._stand)

    def __enter__(self) -> Site:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the worlds; the next trial opens new ones."""
        self._worlds.clear()
        self._stack.close()

    def settle(self, blocks: Sequence[Block]) -> Settled:
        """Let blocks go at their goal poses; they fall when they do under any of the settings."""
        return self._known(tuple(blocks))

    def _settle(self, blocks: tuple[Block, ...]) -> Settled:
        if all(self._standing(_arrangement(group)) for group in groups(blocks)):
            return Settled((), blocks)
        fallen: set[int] = set()
        shown: tuple[Block, ...] = ()
        for physics in self.trial.physics:
            moved, lying = self._fall(blocks, physics)
            fallen.update(moved)
            shown = shown or lying
        return Settled(tuple(sorted(fallen)), shown or blocks)

    def _stand(self, blocks: tuple[Block, ...]) -> bool:
        """Whether blocks, alone in the world, stay where they are under every setting."""
        for physics in self.trial.physics:
            with self._placed(blocks, physics) as world:
                wait(world, self.trial.duration_s)
                if movement(blocks, world.poses(), self.trial).fallen:
                    return False
        return True

    def _fall(
        self, blocks: tuple[Block, ...], physics: Physics
    ) -> tuple[tuple[int, ...], tuple[Block, ...]]:
        """The orders that fell under one setting, and if any did, the blocks as they lie then."""
        # A fresh world: how blocks tumble could depend on what was in a used one before.
        with World(physics, self._engine) as world:
            world.place_all(blocks)
            wait(world, self.trial.duration_s)
            fallen = movement(blocks, world.poses(), self.trial).fallen
            if not fallen:
                return (), ()
            wait(world, _COLLAPSE_S)
            poses = world.poses()
            fallen = (*fallen, *movement(blocks, poses, self.trial).fallen)
            return fallen, tuple(
                poses[block.order].put(block) if block.order in fallen else block
                for block in blocks
            )

    @contextlib.contextmanager
    def _placed(self, blocks: Sequence[Block], physics: Physics) -> Iterator[World]:
        """A world with these blocks in it for a while."""
        if physics not in self._worlds:
            self._worlds[physics] = self._stack.enter_context(World(physics, self._engine))
        world = self._worlds[physics]
        world.place_all(blocks)
        try:
            yield world
        finally:
            for block in reversed(blocks):
                world.remove(block.order)


@functools.cache
def _shared_site(trial: Trial, tried_by: PhysicsEngine) -> Site:
    return Site(trial, tried_by)


def settle(blocks: Sequence[Block], trial: Trial = DEFAULT_TRIAL) -> Settled:
    """As `Site.settle`, at a site that lasts as long as the process; for any thread."""
    with _ONE_AT_A_TIME:
        return _shared_site(trial, physics_engine()).settle(blocks)


def state_picture(scene: Scene, blocks: Sequence[Block], style: PictureStyle) -> QuestionPicture:
    """The recipe of a picture of blocks on the ground, seen exactly as the goal picture is."""
    view_deg = (style.azimuth_deg, style.elevation_deg)
    return QuestionPicture("current", tuple(blocks), view_deg, framed=scene.blocks)


def _arrangement(group: Sequence[Block]) -> tuple[Block, ...]:
    """What decides whether a group stands: the first block at the origin, colors left out."""
    x, y, _ = group[0].position_m
    return tuple(
        Block(
            number,
            block.type,
            "red",
            (
                round(block.position_m[0] - x, _PLACE_DIGITS) + 0.0,
                round(block.position_m[1] - y, _PLACE_DIGITS) + 0.0,
                block.position_m[2],
            ),
            block.euler_deg,
            (),
            1,
        )
        for number, block in enumerate(group, 1)
    )


class Lookout:
    """The place that a scene's goal is seen from; draws `state_picture`s as images, quickly."""

    def __init__(self, scene: Scene, style: PictureStyle) -> None:
        self._scene, self._style = scene, style
        self._eye_m = self._camera(scene.blocks).eye_m
        self._ground = empty_ground(style.background, self._camera(scene.blocks), style.size_px)

    def image(self, blocks: Sequence[Block]) -> Image.Image:
        """The blocks on the ground, an RGB image of the style's size."""
        drawn = [DrawnBlock(b.type, b.color, b.position_m, b.euler_deg) for b in blocks]
        style, camera = self._style, self._camera(blocks)
        # Blocks that fell towards the camera may have pushed it back.
        is_known = np.array_equal(camera.eye_m, self._eye_m)
        ground = self._ground if is_known else None
        return picture(drawn, camera, style.background, style.size_px, ground)

    def _camera(self, blocks: Sequence[Block]) -> Camera:
        return question_camera(state_picture(self._scene, blocks, self._style), self._style)
