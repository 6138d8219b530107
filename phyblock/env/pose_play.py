"""Playing with poses: an action says where a block goes, and is carried out by physics."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from PIL import Image

from phyblock.data import AssemblyTask
from phyblock.domain import MAX_CANDIDATES, Block, CandidateSet, PoseStep
from phyblock.env.play import DONE, Acted, Play, picture_of
from phyblock.env.state import MOST_BLOCKS, block_rows, rows_space
from phyblock.scoring.pose import blocks_reached
from phyblock.sim import PictureStyle, goal_style
from phyblock.sim.carry import CarriedStep, Carrying
from phyblock.sim.kit import kit_png
from phyblock.sim.placing import center_cm, put, upright
from phyblock.sim.ruled import RuledFloor
from phyblock.types import PoseRotation

__all__ = ["PosePlay"]

_CM = 100.0
_HALF_TURN_DEG = 180.0
_FALLS = ("falls", "knocks_over")
_NEAR = (1.0, 10.0)
"""How far a block may be from its place and still have reached it [cm, degrees]."""


class PosePlay(Play):
    """Blocks are put where actions say, let go, and lie where they come to rest.

    The tolerances are those of the track with poses: a block may be moved and still stand as
    `CarryLimits` says, and a goal block is reached by one of its kind within `_NEAR`.
    """

    def __init__(
        self,
        task: AssemblyTask,
        rotation: PoseRotation,
        style: PictureStyle,
        *,
        is_strict: bool,
    ) -> None:
        self._is_free = rotation == "free"
        self._parts = ("center_m", "half_turns") if self._is_free else ("center_m",)
        parts = {name: spaces.Box(-1.0, 1.0, (3,), np.float64) for name in self._parts}
        number = spaces.Discrete(MAX_CANDIDATES + 1)
        self.action_space = spaces.Dict({"block": number, **parts})
        self._style, self._is_strict = style, is_strict
        self._stack = contextlib.ExitStack()
        self._task = task
        self._floor: RuledFloor | None = None

    def begin(self, task: AssemblyTask) -> None:
        """Begin a scene on an empty floor."""
        if self._task is not task:
            self._task, self._floor = task, None
        self._kit = self.candidates(task)
        self._stack.close()
        self._carrying = self._stack.enter_context(Carrying())
        self._last: CarriedStep | None = None
        self._named: list[int] = []
        self._reached = 0

    def candidates(self, task: AssemblyTask) -> CandidateSet:
        """The candidates of a scene as they are shown: where actions turn them, each kind once,
        upright.
        """
        return upright(task.candidates)[0] if self._is_free else task.candidates

    def act(self, action: Any) -> Acted | None:
        """Put a block and let it go; None for Done. ValueError for an action outside the space.

        It is worth as many goal blocks as are reached now and were not, less those that were and
        are not.
        """
        step = self._step(action)
        self._last = None
        if step.candidate == DONE:
            return None
        self._last = self._carrying.step(put(step, self._kit))
        self._named.append(step.candidate)
        before = self._reached
        self._reached = self._count(self._task.scene.blocks)
        end = self._last.end
        return Acted(end, float(self._reached - before), end == "stands")

    @property
    def has_ended(self) -> bool:
        """Whether the goal is complete and nothing else lies about, or, where it is strict,
        something has fallen.
        """
        has_fallen = self._last is not None and self._last.end in _FALLS
        return self._is_complete or (self._is_strict and has_fallen)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks in the world, where they lie."""
        return self._carrying.blocks

    @property
    def chosen(self) -> tuple[int, ...]:
        """The candidates in the world, in the order in which they were put."""
        return tuple(self._named[block.order - 1] for block in self.blocks)

    def right_moves(self) -> tuple[dict[str, Any], ...]:
        """The actions that would put a goal block in its place now, those of low layers first:
        it is not reached, and all that it rests on is.
        """
        scene = self._task.scene
        is_there = [self._count((block,)) == 1 for block in scene.blocks]
        needs, layers = scene.graph.depends_on, scene.graph.layers
        ready = [
            vertex
            for vertex in range(len(scene))
            if not is_there[vertex] and all(is_there[below] for below in needs[vertex])
        ]
        moves = (self._right(scene.blocks[v]) for v in sorted(ready, key=lambda v: layers[v]))
        return tuple(move for move in moves if move is not None)

    def image(self, blocks: tuple[Block, ...]) -> Image.Image:
        """Blocks on a ruled floor, seen as the goal is."""
        if self._floor is None:
            scene = self._task.scene
            self._floor = RuledFloor(scene, goal_style(scene, self._style))
        return self._floor.image(blocks)

    def candidates_image(self) -> Image.Image:
        """The sheet of the candidates with their sizes."""
        return picture_of(kit_png(self._kit, self._style))

    def info(self) -> dict[str, Any]:
        """What the last step came to, and how much of the goal is reached."""
        last = self._last or CarriedStep("no_block")
        return {
            "moved_cm": last.moved_cm,
            "turned_deg": last.turned_deg,
            "gap_cm": last.gap_cm,
            "overlap_cm": last.overlap_cm,
            "knocked": last.knocked,
            "reached": self._reached,
            "is_complete": self._is_complete,
        }

    def more_spaces(self) -> dict[str, spaces.Space[Any]]:
        """Where the blocks lie, rows as in a goal."""
        return {"world": rows_space(MOST_BLOCKS)}

    def more_state(self) -> dict[str, NDArray[Any]]:
        """Of more blocks than there are rows, those that came last."""
        return {"world": block_rows(self.blocks[-MOST_BLOCKS:])}

    def close(self) -> None:
        """Release the simulator."""
        self._stack.close()

    @property
    def _is_complete(self) -> bool:
        return self._reached == len(self._task.scene) == len(self.blocks)

    def _count(self, goal: tuple[Block, ...]) -> int:
        return blocks_reached(goal, self.blocks, *_NEAR)

    def _right(self, block: Block) -> dict[str, Any] | None:
        kit = self._kit
        number = kit.first_of(block.kind) if self._is_free else kit.index_of(block.look)
        if number is None:
            return None
        parts = {"center_m": np.array(center_cm(block)) / _CM}
        if self._is_free:
            parts["half_turns"] = (np.array(block.euler_deg) / _HALF_TURN_DEG + 1) % 2 - 1
        return {"block": np.int64(number), **parts}

    def _step(self, action: Any) -> PoseStep:
        names = ("block", *self._parts)
        if not isinstance(action, Mapping) or set(action) != set(names):
            raise ValueError(f"action is {action!r}; allowed: a mapping of {', '.join(names)}")
        number = int(action["block"])
        if not 0 <= number <= MAX_CANDIDATES:
            raise ValueError(f"action block {number} is outside 0..{MAX_CANDIDATES}")
        values = [_three(name, action[name]) for name in self._parts]
        center = _scaled(values[0], _CM)
        return PoseStep(number, center, *(_scaled(turns, _HALF_TURN_DEG) for turns in values[1:]))


def _three(name: str, value: Any) -> NDArray[np.float64]:
    found = np.asarray(value, dtype=np.float64)
    if found.shape != (3,) or not np.all(np.abs(found) <= 1):
        raise ValueError(f"action {name} is {value!r}; allowed: 3 numbers from -1 to 1")
    return found


def _scaled(values: NDArray[np.float64], by: float) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values * by)
    return x, y, z
