"""The assembly of one scene as an episode of reinforcement learning (docs/environment.md).

An action is the number of a candidate, or 0 for Done. A right move puts the block at its goal pose
and gives a reward of 1; a wrong one changes nothing and gives 0.
"""

from __future__ import annotations

import io
from collections import OrderedDict
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, cast, get_args

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from PIL import Image

from phyblock.datasets import AssemblyTask
from phyblock.domain import MAX_CANDIDATES, Block
from phyblock.env.scenes import read_tasks
from phyblock.env.state import LARGEST, MOST_BLOCKS, TRAITS, candidate_rows, goal_rows
from phyblock.errors import DataError, Problem
from phyblock.scoring import Assembly
from phyblock.sim import PictureStyle, candidates_png
from phyblock.sim.pictures import LARGEST_PX, SMALLEST_PX
from phyblock.sim.site import ONE_SETTING, Lookout, Settled, Site
from phyblock.sim.stability import DEFAULT_TRIAL
from phyblock.words import GATINGS, SETTINGS, Background, Gating, Physics, Setting

__all__ = ["DONE", "Observation", "PhyBlockEnv"]

DONE = 0
"""The action that ends the assembly; any other is the number of a candidate."""
Observation = dict[str, NDArray[Any]]
Observe = Literal["pictures", "state"]
_PICTURES = ("current", "goal", "candidates")
_KEPT_PICTURES = 64
"""Of one scene; 50 MB at 512 pixels."""
_MOST_OF_A_KIND = 255
_SMALLEST_PX = 16


class PhyBlockEnv(gymnasium.Env[Observation, np.int64]):
    """Builds one scene an episode, block by block.

    Observations are pictures (`current`, `goal`, `candidates`: RGB, shape (size, size, 3), uint8)
    or, with `observe="state"`, numbers alone (`goal` and `candidates`: a row a block, float32, see
    `phyblock.env.state`; `placed`: how many blocks were placed as each candidate, shape (16,),
    uint8; `left`: the share of steps that is left, shape (1,), float32).
    The episode terminates with Done, with the goal complete, and under `physics="strict"` with a
    collapse; it is truncated after `max_steps` steps (None: twice the number of blocks) or
    `max_failures` failed moves in a row (None: no bound).
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012

    def __init__(
        self,
        data: str | Path | Sequence[AssemblyTask] = "phyblock-400",
        scene: str | None = None,
        *,
        levels: Collection[int] | None = None,
        setting: Setting = "A",
        gating: Gating = "aov",
        physics: Physics = "settle",
        observe: Observe = "pictures",
        size_px: int = 512,
        background: Background = "checkerboard",
        max_steps: int | None = None,
        max_failures: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        """`data` is a data set (see `read_tasks`) or tasks; `levels` plays scenes of these alone
        (None: of all), `scene` that one.

        Raises DataError for a data set or scene that is not there, ValueError for an option that
        is not among those allowed, a limit below 1, or no tasks at all.
        """
        _check_options(setting=setting, gating=gating, physics=physics, observe=observe)
        _check_limits(max_steps=max_steps, max_failures=max_failures)
        if size_px < _SMALLEST_PX:
            raise ValueError(f"size_px is {size_px}, allowed {_SMALLEST_PX}..{LARGEST_PX}")
        tasks = read_tasks(data) if isinstance(data, str | Path) else tuple(data)
        if levels is not None:
            tasks = tuple(task for task in tasks if set(task.scene.levels) & set(levels))
        if not tasks:
            of_levels = "" if levels is None else f" of levels {sorted(levels)}"
            raise ValueError(f"data holds no tasks{of_levels}")
        self._tasks = {task.scene.id: task for task in tasks}
        self._scene = None if scene is None else self._find(scene).scene.id
        self._setting: Setting = setting
        self._gating: Gating = gating
        self._physics = physics
        self._observe = observe
        # Below the smallest that is drawn, whole pixels are put together.
        self._shrink = max(1, -(-SMALLEST_PX // size_px))
        self._style = PictureStyle(size_px * self._shrink, background)
        self._max_steps = max_steps
        self._max_failures = max_failures
        self.render_mode = render_mode
        self._task = next(iter(self._tasks.values()))
        self._steps = self._failures = self._most_steps = 0
        self._outcome: str = ""
        self._swapped: tuple[tuple[int, int], ...] = ()
        self._lookout: Lookout | None = None
        self._pictures: OrderedDict[tuple[Block, ...] | str, NDArray[np.uint8]] = OrderedDict()
        self._site = Site(DEFAULT_TRIAL if physics == "strict" else ONE_SETTING)
        self._begin(self._task)
        self.action_space = spaces.Discrete(MAX_CANDIDATES + 1)
        self.observation_space = cast(spaces.Space[Observation], _space(observe, size_px))

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a scene: `options["scene"]`, else the one given, else one drawn at random."""
        super().reset(seed=seed)
        name = (options or {}).get("scene", self._scene)
        if name is None:
            name = list(self._tasks)[int(self.np_random.integers(len(self._tasks)))]
        self._begin(self._find(name))
        return self._observation(), self._info()

    def step(self, action: np.int64 | int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Try a candidate, or end the assembly; ValueError for an action outside the space."""
        if not 0 <= int(action) <= MAX_CANDIDATES:
            raise ValueError(f"action {action} is outside 0..{MAX_CANDIDATES}")
        self._steps += 1
        if action == DONE:
            self._outcome, self._swapped = "done", ()
            return self._observation(), 0.0, True, False, self._info()
        move = self._assembly.move(int(action))
        self._outcome, self._swapped = move.outcome, move.swapped
        is_placed = move.outcome == "placed"
        self._failures = 0 if is_placed else self._failures + 1
        if is_placed:
            self._settle()
        ended = self._assembly.is_complete or self._has_collapsed
        cut = self._steps >= self._most_steps or self._failures == self._max_failures
        return self._observation(), float(is_placed), ended, cut and not ended, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """The current picture, shape (size, size, 3), in render mode `rgb_array`."""
        return None if self.render_mode is None else self._current().copy()

    def close(self) -> None:
        """Release the simulator."""
        self._site.close()

    def right_moves(self) -> tuple[int, ...]:
        """The actions that would place a block now: what an oracle knows."""
        return self._assembly.right_moves()

    def action_masks(self) -> NDArray[np.bool_]:
        """Which actions mean something in this scene, shape (17,): Done, and its candidates."""
        mask = np.zeros(MAX_CANDIDATES + 1, dtype=np.bool_)
        mask[: len(self._task.candidates) + 1] = True
        return mask

    def _begin(self, task: AssemblyTask) -> None:
        self._assembly = Assembly(task.scene, task.candidates, self._setting, self._gating)
        self._steps = self._failures = 0
        self._outcome = "begun"
        self._swapped = ()
        most = self._max_steps
        self._most_steps = 2 * len(task.scene) if most is None else most
        self._settled = Settled((), ())
        if task is not self._task:
            self._task = task
            self._lookout = None
            self._pictures.clear()

    @property
    def _has_collapsed(self) -> bool:
        return self._physics == "strict" and not self._settled.stands

    def _settle(self) -> None:
        """Let the assembly go: what falls is held at its goal pose, or under `strict` lies."""
        blocks = self._task.scene.blocks
        state = tuple(blocks[vertex] for vertex in self._assembly.vertices)
        self._settled = Settled((), state)
        if self._physics != "off":
            found = self._site.settle(state)
            is_held = self._physics == "settle"
            self._settled = Settled(found.fallen, state if is_held else found.blocks)

    def _find(self, scene: object) -> AssemblyTask:
        if scene in self._tasks:
            return self._tasks[str(scene)]
        some = ", ".join(list(self._tasks)[:5])
        message = "the environment has no such scene"
        raise DataError(Problem("PhyBlockEnv", message, "scene", str(scene), f"{some}, ..."))

    def _observation(self) -> Observation:
        if self._observe == "state":
            placed = np.bincount(self._assembly.chosen, minlength=MAX_CANDIDATES + 1)[1:]
            left = 1 - self._steps / self._most_steps
            return {
                "goal": goal_rows(self._task.scene.blocks),
                "candidates": candidate_rows(self._task.candidates.candidates),
                "placed": placed.astype(np.uint8),
                "left": np.array([max(0.0, left)], dtype=np.float32),
            }
        scene = self._task.scene
        return {
            "current": self._current().copy(),
            "goal": self._picture(scene.blocks).copy(),
            "candidates": self._candidates().copy(),
        }

    def _current(self) -> NDArray[np.uint8]:
        return self._picture(self._settled.blocks)

    def _picture(self, blocks: tuple[Block, ...]) -> NDArray[np.uint8]:
        return self._kept_picture(blocks, lambda: self._look().image(blocks))

    def _candidates(self) -> NDArray[np.uint8]:
        return self._kept_picture("candidates", self._draw_candidates)

    def _kept_picture(
        self, name: tuple[Block, ...] | str, draw: Callable[[], Image.Image]
    ) -> NDArray[np.uint8]:
        """A picture drawn once while it is in use; those unused for longest make room."""
        if name not in self._pictures:
            self._pictures[name] = np.asarray(draw().reduce(self._shrink))
            if len(self._pictures) > _KEPT_PICTURES:
                self._pictures.popitem(last=False)
        self._pictures.move_to_end(name)
        return self._pictures[name]

    def _look(self) -> Lookout:
        if self._lookout is None:
            self._lookout = Lookout(self._task.scene, self._style)
        return self._lookout

    def _draw_candidates(self) -> Image.Image:
        png = candidates_png(self._task.candidates, self._style)
        with Image.open(io.BytesIO(png)) as image:
            rgb: Image.Image = image.convert("RGB")
            return rgb

    def _info(self) -> dict[str, Any]:
        """The state in structure; tuples, since arrays of several lengths make no vector."""
        blocks = self._task.scene.blocks
        return {
            "scene": self._task.scene.id,
            "outcome": self._outcome,
            "step": self._steps,
            "n_blocks": len(blocks),
            "placed": tuple(blocks[vertex].order for vertex in self._assembly.vertices),
            "swapped": tuple((blocks[a].order, blocks[b].order) for a, b in self._swapped),
            "chosen": tuple(self._assembly.chosen),
            "right_moves": self.right_moves(),
            "fallen": self._settled.fallen,
            "is_complete": self._assembly.is_complete,
        }


_OPTIONS: Mapping[str, tuple[str, ...]] = {
    "setting": SETTINGS,
    "gating": GATINGS,
    "physics": get_args(Physics),
    "observe": get_args(Observe),
}


def _check_options(**options: str) -> None:
    for name, value in options.items():
        if value not in _OPTIONS[name]:
            raise ValueError(f"{name} is {value!r}; allowed: {', '.join(_OPTIONS[name])}")


def _check_limits(**limits: int | None) -> None:
    for name, most in limits.items():
        if most is not None and most < 1:
            raise ValueError(f"{name} is {most}; allowed: 1 or more, or None")


def _space(observe: str, size_px: int) -> spaces.Dict[Any]:
    if observe == "state":
        return spaces.Dict(
            {
                "goal": spaces.Box(-LARGEST, LARGEST, (MOST_BLOCKS, TRAITS), np.float32),
                "candidates": spaces.Box(-LARGEST, LARGEST, (MAX_CANDIDATES, TRAITS), np.float32),
                "placed": spaces.Box(0, _MOST_OF_A_KIND, (MAX_CANDIDATES,), np.uint8),
                "left": spaces.Box(0.0, 1.0, (1,), np.float32),
            }
        )
    shape = (size_px, size_px, 3)
    return spaces.Dict({name: spaces.Box(0, 255, shape, np.uint8) for name in _PICTURES})
