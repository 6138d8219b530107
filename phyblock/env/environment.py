"""Where an environment takes its scenes from."""

from __future__ import annotations

import contextlib
import io
from collections import OrderedDict
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, Protocol, cast, get_args

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from PIL import Image

from phyblock.data import AssemblyTask, read_data_set
from phyblock.domain import (
    BLOCK_TYPES,
    COLORS,
    MAX_CANDIDATES,
    Block,
    Candidate,
    CandidateSet,
    PoseStep,
)
from phyblock.errors import DataError, Problem
from phyblock.scoring.pose import blocks_reached
from phyblock.scoring.steps import Assembly
from phyblock.sim.dynamics import DEFAULT_TRIAL, ONE_SETTING, ExecutedStep, Executor, Settled, Site
from phyblock.sim.geometry import center_cm, put, upright
from phyblock.sim.pictures import (
    LARGEST_PX,
    SMALLEST_PX,
    Lookout,
    PictureStyle,
    candidates_png,
    goal_style,
)
from phyblock.sim.ruled import RuledFloor, kit_png
from phyblock.text import some_of
from phyblock.types import GATINGS, SETTINGS, Background, Gating, Physics, PoseRotation, Setting


def read_tasks(data: str | Path) -> tuple[AssemblyTask, ...]:
    """The scenes of a data set: a folder with scenes.jsonl, an official checkout, a bundled name.

    Raises DataError when there is no such data set, or with everything that is wrong in it.
    """
    return read_data_set(str(data)).tasks


MOST_BLOCKS = 64
"""Rows of a goal; built-in ones have 22 blocks at most."""
TRAITS = 9
"""There, type, color, three angles, three coordinates."""
LARGEST = 360.0
"""No number of a row is larger, nor smaller than its negative."""


def rows_space(count: int) -> spaces.Box:
    """Rows of so many blocks, shape (count, TRAITS)."""
    return spaces.Box(-LARGEST, LARGEST, (count, TRAITS), np.float32)


def goal_rows(blocks: Sequence[Block]) -> NDArray[np.float32]:
    """The blocks of a goal in their order, shape (MOST_BLOCKS, TRAITS).

    Raises ValueError for more blocks than there are rows.
    """
    if len(blocks) > MOST_BLOCKS:
        raise ValueError(f"a goal of {len(blocks)} blocks; at most {MOST_BLOCKS} fit in a state")
    return block_rows(blocks)


def block_rows(blocks: Sequence[Block]) -> NDArray[np.float32]:
    """Blocks where they are, the first `MOST_BLOCKS` of them, shape (MOST_BLOCKS, TRAITS)."""
    return _rows(blocks, MOST_BLOCKS)


def candidate_rows(candidates: Sequence[Candidate]) -> NDArray[np.float32]:
    """The candidates by their numbers, the first in row 0, shape (16, TRAITS)."""
    return _rows(candidates, MAX_CANDIDATES)


def _rows(blocks: Sequence[Block] | Sequence[Candidate], most: int) -> NDArray[np.float32]:
    rows = np.zeros((most, TRAITS), dtype=np.float32)
    for row, block in zip(rows, blocks, strict=False):
        position = block.position_m if isinstance(block, Block) else (0.0, 0.0, 0.0)
        look = (BLOCK_TYPES.index(block.type), COLORS.index(block.color))
        row[:] = (1.0, *look, *block.euler_deg, *position)
    return rows


DONE = 0
"""The number that ends the assembly; any other is that of a candidate."""


class Acted(NamedTuple):
    """What became of an action, what it is worth, and whether it was no failure."""

    outcome: str
    reward: float
    is_right: bool


class Play(Protocol):
    """One way of building a scene; `begin` comes before all else."""

    action_space: spaces.Space[Any]

    def begin(self, task: AssemblyTask) -> None:
        """Begin a scene."""

    def candidates(self, task: AssemblyTask) -> CandidateSet:
        """The candidates of a scene as they are shown."""
        return task.candidates

    def act(self, action: Any) -> Acted | None:
        """Take an action; None for Done. ValueError for one outside the space."""

    @property
    def has_ended(self) -> bool:
        """Whether the goal is complete, or the rules end it."""

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks in the world."""

    @property
    def chosen(self) -> tuple[int, ...]:
        """The candidates in the world, in the order in which they came there."""

    def right_moves(self) -> tuple[Any, ...]:
        """The actions that would place a block now."""

    def image(self, blocks: tuple[Block, ...]) -> Image.Image:
        """Blocks, seen as the goal is."""

    def candidates_image(self) -> Image.Image:
        """The numbered candidates."""

    def info(self) -> dict[str, Any]:
        """The state in structure; tuples, since arrays of several lengths make no vector."""

    def more_spaces(self) -> dict[str, spaces.Space[Any]]:
        """What `observe="state"` shows of this way of building alone, by name."""
        return {}

    def more_state(self) -> dict[str, NDArray[Any]]:
        """These observations as they are now."""
        return {}

    def close(self) -> None:
        """Release the simulator."""


def picture_of(png: bytes) -> Image.Image:
    """A PNG as an RGB image."""
    with Image.open(io.BytesIO(png)) as image:
        rgb: Image.Image = image.convert("RGB")
        return rgb


class BlockPlay(Play):
    """A right move puts its block at its goal pose; a wrong one changes nothing."""

    def __init__(
        self,
        task: AssemblyTask,
        setting: Setting,
        gating: Gating,
        physics: Physics,
        style: PictureStyle,
    ) -> None:
        self.action_space = spaces.Discrete(MAX_CANDIDATES + 1)
        self._setting, self._gating, self._physics = setting, gating, physics
        self._style = style
        self._site = Site(DEFAULT_TRIAL if physics == "strict" else ONE_SETTING)
        self._task = task
        self._lookout: Lookout | None = None

    def begin(self, task: AssemblyTask) -> None:
        """Begin a scene."""
        if self._task is not task:
            self._task, self._lookout = task, None
        self._assembly = Assembly(task.scene, task.candidates, self._setting, self._gating)
        self._swapped: tuple[tuple[int, int], ...] = ()
        self._settled = Settled((), ())

    def act(self, action: Any) -> Acted | None:
        """Try a candidate; None for Done. ValueError for an action outside the space."""
        if not 0 <= int(action) <= MAX_CANDIDATES:
            raise ValueError(f"action {action} is outside 0..{MAX_CANDIDATES}")
        self._swapped = ()
        if action == DONE:
            return None
        move = self._assembly.move(int(action))
        self._swapped = move.swapped
        is_placed = move.outcome == "placed"
        if is_placed:
            self._settle()
        return Acted(move.outcome, float(is_placed), is_placed)

    @property
    def has_ended(self) -> bool:
        """Whether the goal is complete, or what stood has collapsed."""
        has_collapsed = self._physics == "strict" and not self._settled.stands
        return self._assembly.is_complete or has_collapsed

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks in the world."""
        return self._settled.blocks

    @property
    def chosen(self) -> tuple[int, ...]:
        """The candidates that were placed, in order."""
        return tuple(self._assembly.chosen)

    def right_moves(self) -> tuple[int, ...]:
        """The actions that would place a block now."""
        return self._assembly.right_moves()

    def image(self, blocks: tuple[Block, ...]) -> Image.Image:
        """Blocks, seen as the goal is."""
        if self._lookout is None:
            self._lookout = Lookout(self._task.scene, self._style)
        return self._lookout.image(blocks)

    def candidates_image(self) -> Image.Image:
        """The numbered candidates."""
        return picture_of(candidates_png(self._task.candidates, self._style))

    def info(self) -> dict[str, Any]:
        """The state in structure."""
        blocks = self._task.scene.blocks
        return {
            "placed": tuple(blocks[vertex].order for vertex in self._assembly.vertices),
            "swapped": tuple((blocks[a].order, blocks[b].order) for a, b in self._swapped),
            "fallen": self._settled.fallen,
            "is_complete": self._assembly.is_complete,
        }

    def close(self) -> None:
        """Release the simulator."""
        self._site.close()

    def _settle(self) -> None:
        """Let the assembly go: what falls is held at its goal pose, or under `strict` lies."""
        blocks = self._task.scene.blocks
        state = tuple(blocks[vertex] for vertex in self._assembly.vertices)
        self._settled = Settled((), state)
        if self._physics != "off":
            settled = self._site.settle(state)
            is_held = self._physics == "settle"
            self._settled = Settled(settled.fallen, state if is_held else settled.blocks)


_CM = 100.0
_HALF_TURN_DEG = 180.0
_FALLS = ("falls", "knocks_over")
_NEAR = (1.0, 10.0)
"""How far a block may be from its place and still have reached it [cm, degrees]."""


class PosePlay(Play):
    """Blocks are put where actions say, let go, and lie where they come to rest.

    The tolerances are those of the track with poses: a block may be moved and still stand as
    `ExecutionLimits` says, and a goal block is reached by one of its kind within `_NEAR`.
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
        self._carrying = self._stack.enter_context(Executor())
        self._last: ExecutedStep | None = None
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
        last = self._last or ExecutedStep("no_block")
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
    `phyblock.env.environment`; `placed`: number of blocks placed as each candidate, shape (16,),
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
