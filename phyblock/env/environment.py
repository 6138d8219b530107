"""The assembly of one scene as an episode of reinforcement learning (docs/environment.md).

An action is the number of a candidate, or 0 for Done: a right move puts the block at its goal pose
and gives a reward of 1, a wrong one changes nothing and gives 0. With `action="pose"` it also says
where the block goes, and physics what becomes of it.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, cast, get_args

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from PIL import Image

from phyblock.data import AssemblyTask
from phyblock.domain import MAX_CANDIDATES, Block
from phyblock.env.block_play import BlockPlay
from phyblock.env.play import Play
from phyblock.env.pose_play import PosePlay
from phyblock.env.scenes import read_tasks
from phyblock.env.state import MOST_BLOCKS, candidate_rows, goal_rows, rows_space
from phyblock.errors import DataError, Problem
from phyblock.sim import PictureStyle
from phyblock.sim.pictures import LARGEST_PX, SMALLEST_PX
from phyblock.text import some_of
from phyblock.types import GATINGS, SETTINGS, Background, Gating, Physics, PoseRotation, Setting

__all__ = ["Observation", "PhyBlockEnv"]

Observation = dict[str, NDArray[Any]]
Observe = Literal["pictures", "state"]
Action = Literal["block", "pose"]
_PICTURES = ("current", "goal", "candidates")
_KEPT_PICTURES = 64
"""Pictures of one scene that are kept; 50 MB at 512 pixels."""
_MOST_OF_A_KIND = 255
_SMALLEST_PX = 16
_RENDER_MODES = ("rgb_array",)


class PhyBlockEnv(gymnasium.Env[Observation, Any]):
    """Builds one scene an episode, block by block.

    Observations are pictures (`current`, `goal`, `candidates`: RGB, shape (size, size, 3), uint8)
    or, with `observe="state"`, numbers alone (`goal` and `candidates`: a row a block, float32, see
    `phyblock.env.state`; `placed`: how many blocks were placed as each candidate, shape (16,),
    uint8; `left`: the share of steps that is left, shape (1,), float32; where actions are poses
    also `world`: where the blocks lie, rows as in `goal`).
    The episode terminates with Done, with the goal complete, and under `physics="strict"` with a
    collapse; it is truncated after `max_steps` steps (None: twice the number of blocks) or
    `max_failures` failed moves in a row (None: no bound).
    """

    metadata: dict[str, Any] = {"render_modes": [*_RENDER_MODES], "render_fps": 2}  # noqa: RUF012

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
        action: Action = "block",
        rotation: PoseRotation = "candidate",
        size_px: int = 512,
        background: Background = "checkerboard",
        max_steps: int | None = None,
        max_failures: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        """`data` is a data set (see `read_tasks`) or tasks; `levels` plays scenes of these alone
        (None: of all), `scene` that one. With `action="pose"` a block is put where the action says,
        turned as its candidate is or, with `rotation="free"`, as the action says; `setting` and
        `gating` are of `action="block"` alone.

        Raises DataError for a data set or scene that is not there, ValueError for an option that
        is not among those allowed, a limit below 1, or no tasks at all.
        """
        _check_options(
            setting=setting,
            gating=gating,
            physics=physics,
            observe=observe,
            action=action,
            rotation=rotation,
        )
        _check_together(action, setting, gating, physics, rotation)
        _check_limits(max_steps=max_steps, max_failures=max_failures)
        _check_pictures(render_mode, size_px)
        self._tasks = {task.scene.id: task for task in _tasks_of(data, levels)}
        self._scene = None if scene is None else self._find(scene).scene.id
        self._observe = observe
        # Below the smallest that is drawn, whole pixels are put together.
        self._shrink = max(1, -(-SMALLEST_PX // size_px))
        style = PictureStyle(size_px * self._shrink, background)
        self._task = next(iter(self._tasks.values()))
        self._play: Play = (
            PosePlay(self._task, rotation, style, is_strict=physics == "strict")
            if action == "pose"
            else BlockPlay(self._task, setting, gating, physics, style)
        )
        self._max_steps = max_steps
        self._max_failures = max_failures
        self.render_mode = render_mode
        self._steps = self._failures = self._most_steps = 0
        self._outcome: str = ""
        self._is_over = False
        self._pictures: OrderedDict[tuple[Block, ...] | str, NDArray[np.uint8]] = OrderedDict()
        self._begin(self._task)
        self.action_space = self._play.action_space
        space = _space(observe, size_px, self._play.more_spaces())
        self.observation_space = cast(spaces.Space[Observation], space)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a scene: `options["scene"]`, else the one given, else one drawn at random.

        Raises ValueError for another option, DataError for a scene that is not there.
        """
        if unknown := sorted(map(str, set(options or {}) - {"scene"})):
            raise ValueError(f"options has {', '.join(unknown)}; allowed: scene")
        super().reset(seed=seed)
        name = (options or {}).get("scene", self._scene)
        if name is None:
            name = list(self._tasks)[int(self.np_random.integers(len(self._tasks)))]
        self._begin(self._find(name))
        return self._observation(), self._info()

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Try a candidate, or end the assembly.

        Raises ValueError for an action outside the space, ResetNeeded of gymnasium where the
        episode has ended.
        """
        if self._is_over:
            raise gymnasium.error.ResetNeeded("the episode has ended: call reset() before step()")
        acted = self._play.act(action)
        self._steps += 1
        if acted is None:
            self._outcome, self._is_over = "done", True
            return self._observation(), 0.0, True, False, self._info()
        self._outcome = acted.outcome
        self._failures = 0 if acted.is_right else self._failures + 1
        ended = self._play.has_ended
        cut = self._steps >= self._most_steps or self._failures == self._max_failures
        self._is_over = ended or cut
        return self._observation(), acted.reward, ended, cut and not ended, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """The current picture, shape (size, size, 3), in render mode `rgb_array`."""
        return None if self.render_mode is None else self._current().copy()

    def close(self) -> None:
        """Release the simulator."""
        self._play.close()

    def right_moves(self) -> tuple[Any, ...]:
        """The actions that would place a block now: what an oracle knows."""
        return self._play.right_moves()

    def action_masks(self) -> NDArray[np.bool_]:
        """Which numbers mean something in this scene, shape (17,): Done, and its candidates."""
        mask = np.zeros(MAX_CANDIDATES + 1, dtype=np.bool_)
        mask[: len(self._play.candidates(self._task)) + 1] = True
        return mask

    def _begin(self, task: AssemblyTask) -> None:
        self._play.begin(task)
        self._steps = self._failures = 0
        self._outcome, self._is_over = "begun", False
        most = self._max_steps
        self._most_steps = 2 * len(task.scene) if most is None else most
        if task is not self._task:
            self._task = task
            self._pictures.clear()

    def _find(self, scene: object) -> AssemblyTask:
        if scene in self._tasks:
            return self._tasks[str(scene)]
        message, allowed = "the environment has no such scene", some_of(list(self._tasks))
        raise DataError(Problem("PhyBlockEnv", message, "scene", str(scene), allowed))

    def _observation(self) -> Observation:
        if self._observe == "state":
            return self._state()
        return {
            "current": self._current().copy(),
            "goal": self._picture(self._task.scene.blocks).copy(),
            "candidates": self._kept_picture("candidates", self._play.candidates_image).copy(),
        }

    def _state(self) -> Observation:
        placed = np.bincount(self._play.chosen, minlength=MAX_CANDIDATES + 1)[1:]
        left = 1 - self._steps / self._most_steps
        return {
            "goal": goal_rows(self._task.scene.blocks),
            "candidates": candidate_rows(self._play.candidates(self._task).candidates),
            "placed": placed.astype(np.uint8),
            "left": np.array([max(0.0, left)], dtype=np.float32),
            **self._play.more_state(),
        }

    def _current(self) -> NDArray[np.uint8]:
        return self._picture(self._play.blocks)

    def _picture(self, blocks: tuple[Block, ...]) -> NDArray[np.uint8]:
        return self._kept_picture(blocks, lambda: self._play.image(blocks))

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

    def _info(self) -> dict[str, Any]:
        """The state in structure; tuples, since arrays of several lengths make no vector."""
        return {
            "scene": self._task.scene.id,
            "outcome": self._outcome,
            "step": self._steps,
            "n_blocks": len(self._task.scene),
            "chosen": self._play.chosen,
            "right_moves": self.right_moves(),
            **self._play.info(),
        }


_LEVELS = (1, 2, 3, 4)
_OPTIONS: Mapping[str, tuple[str, ...]] = {
    "setting": SETTINGS,
    "gating": GATINGS,
    "physics": get_args(Physics),
    "observe": get_args(Observe),
    "action": get_args(Action),
    "rotation": get_args(PoseRotation),
}


def _check_options(**options: str) -> None:
    for name, value in options.items():
        if value not in _OPTIONS[name]:
            raise ValueError(f"{name} is {value!r}; allowed: {', '.join(_OPTIONS[name])}")


def _check_together(
    action: Action, setting: Setting, gating: Gating, physics: Physics, rotation: PoseRotation
) -> None:
    if action == "block" and rotation != "candidate":
        raise ValueError(f"rotation is {rotation!r}, which needs action='pose'")
    if action == "pose" and (setting != "A" or gating != "aov"):
        raise ValueError("setting and gating are of action='block'; leave them out")
    if action == "pose" and physics == "off":
        raise ValueError("physics is 'off'; a pose is carried out: allowed: settle, strict")


def _check_limits(**limits: int | None) -> None:
    for name, most in limits.items():
        if most is not None and most < 1:
            raise ValueError(f"{name} is {most}; allowed: 1 or more, or None")


def _check_pictures(render_mode: str | None, size_px: int) -> None:
    if render_mode not in (None, *_RENDER_MODES):
        allowed = ", ".join(_RENDER_MODES)
        raise ValueError(f"render_mode is {render_mode!r}; allowed: {allowed}, or None")
    if not _SMALLEST_PX <= size_px <= LARGEST_PX:
        raise ValueError(f"size_px is {size_px}, allowed {_SMALLEST_PX}..{LARGEST_PX}")


def _tasks_of(
    data: str | Path | Sequence[AssemblyTask], levels: Collection[int] | None
) -> tuple[AssemblyTask, ...]:
    """The tasks to play, at least one; ValueError where there are none."""
    tasks = read_tasks(data) if isinstance(data, str | Path) else tuple(data)
    if levels is not None:
        if not isinstance(levels, Collection) or not set(levels) <= set(_LEVELS):
            raise ValueError(f"levels is {levels!r}; allowed: several of {_LEVELS}, or None")
        tasks = tuple(task for task in tasks if set(task.scene.levels) & set(levels))
    if not tasks:
        of_levels = "" if levels is None else f" of levels {sorted(levels)}"
        raise ValueError(f"data holds no tasks{of_levels}")
    return tasks


def _space(observe: str, size_px: int, more: Mapping[str, spaces.Space[Any]]) -> spaces.Dict[Any]:
    if observe == "state":
        return spaces.Dict(
            {
                "goal": rows_space(MOST_BLOCKS),
                "candidates": rows_space(MAX_CANDIDATES),
                "placed": spaces.Box(0, _MOST_OF_A_KIND, (MAX_CANDIDATES,), np.uint8),
                "left": spaces.Box(0.0, 1.0, (1,), np.float32),
                **more,
            }
        )
    shape = (size_px, size_px, 3)
    return spaces.Dict({name: spaces.Box(0, 255, shape, np.uint8) for name in _PICTURES})
