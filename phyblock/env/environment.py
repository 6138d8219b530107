"""The assembly of one scene as an episode of reinforcement learning (docs/tutorials/agent.md).

An action is the number of a candidate, or 0 for Done: a right move puts the block at its goal pose
for a reward of 1, a wrong one changes nothing and has reward 0. With `action="pose"` the action
also gives the position of the block, and physics decides where it comes to rest.

With `observe="state"` a block is a row of `TRAITS` numbers: 1 if there is a block, the indices of
its type and color in `phyblock.domain.BLOCK_TYPES` and `COLORS`, its Euler angles [degrees], and
the position of its center [m], 0 for candidates. Rows without a block are 0.
"""

from __future__ import annotations

import contextlib
import string
from collections import OrderedDict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal, cast, get_args

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from PIL import Image

from phyblock.config.suite import load_suite
from phyblock.data.base import Dataset
from phyblock.data.lookup import read_data_set
from phyblock.domain.blocks import BLOCK_TYPES, COLORS
from phyblock.domain.scene import MAX_CANDIDATES, AssemblyTask, Block, Candidate, PoseStep
from phyblock.files import bundled
from phyblock.models.request import Image as SentImage
from phyblock.scoring.pose import blocks_reached
from phyblock.scoring.steps import Assembly, Move
from phyblock.sim import dynamics, pictures
from phyblock.sim.dynamics import ExecutedStep, Executor, Settled
from phyblock.sim.geometry import center_cm, put
from phyblock.sim.pictures import Lookout, PictureStyle, RuledFloor
from phyblock.tracks.pictures import LocalShop
from phyblock.tracks.step_planning import PastStep, StepOutcome, StepPlanning
from phyblock.types import GATINGS, SETTINGS, Background, Gating, Physics, Setting

Observation = dict[str, Any]
Observe = Literal["pictures", "state", "text"]
Action = Literal["block", "pose"]

DONE = 0  # The action that ends the assembly; all others are numbers of candidates.
MOST_BLOCKS = 64  # Rows of a goal; built-in ones have 22 blocks at most.
TRAITS = 9  # Presence, type, color, three angles, three coordinates.
_PICTURES = ("goal", "candidates", "current")
"""Pictures of an observation, with the names and order of the step planning prompt."""
_KEPT_PICTURES = 64  # Cached pictures of one scene; 50 MB at 512 pixels.
_MOST_CHARACTERS = 1 << 20
_SMALLEST_PX = 16
_LEVELS = (1, 2, 3, 4, 5)
_CM = 100.0
_NEAR = (1.0, 10.0)  # Distance and angle within which a block has reached its place [cm, degrees].


def _rows(blocks: Sequence[Block] | Sequence[Candidate], most: int) -> NDArray[np.float32]:
    """The first `most` blocks as rows, shape (most, TRAITS)."""
    rows = np.zeros((most, TRAITS), dtype=np.float32)
    for row, block in zip(rows, blocks, strict=False):
        position = block.position_m if isinstance(block, Block) else (0.0, 0.0, 0.0)
        look = (BLOCK_TYPES.index(block.type), COLORS.index(block.color))
        row[:] = (1.0, *look, *block.euler_deg, *position)
    return rows


class _BlockPlay:
    """Assembly with candidates, after `begin`: a right move puts its block at its goal pose.

    `act` returns the outcome of an action, its reward, and whether it was right; None for Done.
    """

    def __init__(
        self, style: PictureStyle, setting: Setting, gating: Gating, physics: Physics
    ) -> None:
        self.action_space = spaces.Discrete(MAX_CANDIDATES + 1)
        self._style, self._setting, self._gating = style, setting, gating
        self._physics, self._is_strict = physics, physics == "strict"
        self._trial = dynamics.DEFAULT_TRIAL if self._is_strict else dynamics.ONE_SETTING
        self._task: AssemblyTask | None = None

    def begin(self, task: AssemblyTask) -> None:
        if self._task is not task:
            self._task, self._scene, self.candidates = task, task.scene, task.candidates
            self._lookout: Lookout | None = None
        self._assembly = Assembly(task.scene, task.candidates, self._setting, self._gating)
        self._move: Move | None = None
        self._settled = Settled((), ())

    def act(self, action: Any) -> tuple[str, float, bool] | None:
        if not 0 <= int(action) <= MAX_CANDIDATES:
            raise ValueError(f"action {action} is outside 0..{MAX_CANDIDATES}")
        self._move = None if action == DONE else self._assembly.move(int(action))
        if self._move is None:
            return None
        is_placed = self._move.outcome == "placed"
        if is_placed:
            state = tuple(self._scene.blocks[vertex] for vertex in self._assembly.vertices)
            is_off = self._physics == "off"
            settled = Settled((), state) if is_off else dynamics.settle(state, self._trial)
            # Blocks that fall are held at their goal poses, or stay fallen under `strict`.
            self._settled = settled if self._is_strict else Settled(settled.fallen, state)
        return self._move.outcome, float(is_placed), is_placed

    @property
    def has_ended(self) -> bool:
        return self._assembly.is_complete or (self._is_strict and bool(self._settled.fallen))

    @property
    def blocks(self) -> tuple[Block, ...]:
        return self._settled.blocks

    @property
    def chosen(self) -> tuple[int, ...]:
        return tuple(self._assembly.chosen)

    def right_moves(self) -> tuple[int, ...]:
        return self._assembly.right_moves()

    def image(self, blocks: tuple[Block, ...] | None) -> Image.Image:
        """Blocks in the world, or the candidates for None."""
        if blocks is None:
            return pictures.candidates_grid(self.candidates, self._style)[0]
        if self._lookout is None:
            self._lookout = Lookout(self._scene, self._style)
        return self._lookout.image(blocks)

    def info(self) -> dict[str, Any]:
        blocks, swapped = self._scene.blocks, self._move.swapped if self._move else ()
        return {
            "placed": tuple(blocks[vertex].order for vertex in self._assembly.vertices),
            "swapped": tuple((blocks[a].order, blocks[b].order) for a, b in swapped),
            "fallen": self._settled.fallen,
            "is_complete": self._assembly.is_complete,
        }

    def close(self) -> None:
        """Release nothing, since all environments share their worlds."""


class _PosePlay:
    """Assembly with poses, after `begin`; a goal block is reached by its kind within `_NEAR`."""

    def __init__(self, style: PictureStyle, *, is_strict: bool) -> None:
        self._style, self._is_strict = style, is_strict
        center = spaces.Box(-1.0, 1.0, (3,), np.float64)
        number = spaces.Discrete(MAX_CANDIDATES + 1)
        self.action_space = spaces.Dict({"block": number, "center_m": center})
        self._stack = contextlib.ExitStack()
        self._task: AssemblyTask | None = None

    def begin(self, task: AssemblyTask) -> None:
        if self._task is not task:
            self._task, self._scene, self.candidates = task, task.scene, task.candidates
            self._floor: RuledFloor | None = None
        self._stack.close()
        self._executor = self._stack.enter_context(
            Executor(physics=dynamics.execution_physics(self._scene.blocks))
        )
        self._last: ExecutedStep | None = None
        self._named: list[int] = []
        self._reached = 0

    def act(self, action: Any) -> tuple[str, float, bool] | None:
        """Place and release a block; the reward is the change in the number of reached blocks."""
        if not isinstance(action, Mapping) or set(action) != {"block", "center_m"}:
            raise ValueError(f"action is {action!r}; allowed: a mapping of block, center_m")
        number = int(action["block"])
        if not 0 <= number <= MAX_CANDIDATES:
            raise ValueError(f"action block {number} is outside 0..{MAX_CANDIDATES}")
        center = np.asarray(action["center_m"], dtype=np.float64)
        if center.shape != (3,) or not np.all(np.abs(center) <= 1):
            allowed = "3 numbers from -1 to 1"
            raise ValueError(f"action center_m is {action['center_m']!r}; allowed: {allowed}")
        self._last = None
        if number == DONE:
            return None
        x, y, z = (center * _CM).tolist()
        self._last = self._executor.step(put(PoseStep(number, (x, y, z)), self.candidates))
        self._named.append(number)
        before, self._reached = self._reached, self._count(self._scene.blocks)
        return self._last.end, float(self._reached - before), self._last.end == "stands"

    @property
    def has_ended(self) -> bool:
        """True if the goal is complete without extra blocks, or a strict step failed."""
        has_fallen = self._last is not None and self._last.end in ("falls", "knocks_over")
        return self._is_complete or (self._is_strict and has_fallen)

    @property
    def blocks(self) -> tuple[Block, ...]:
        return self._executor.blocks

    @property
    def chosen(self) -> tuple[int, ...]:
        return tuple(self._named[block.order - 1] for block in self.blocks)

    def right_moves(self) -> tuple[dict[str, Any], ...]:
        """The actions that place an unreached goal block on reached ones, low layers first."""
        blocks, graph, moves = self._scene.blocks, self._scene.graph, []
        is_there = [self._count((block,)) == 1 for block in blocks]
        for vertex in sorted(range(len(blocks)), key=graph.layers.__getitem__):
            number = self.candidates.index_of(blocks[vertex].look)
            is_ready = all(is_there[below] for below in graph.depends_on[vertex])
            if is_ready and not is_there[vertex] and number is not None:
                center = np.array(center_cm(blocks[vertex])) / _CM
                moves.append({"block": np.int64(number), "center_m": center})
        return tuple(moves)

    def image(self, blocks: tuple[Block, ...] | None) -> Image.Image:
        """Blocks in the world, or the candidates for None."""
        if blocks is None:
            return pictures.kit_sheet(self.candidates, self._style)
        if self._floor is None:
            self._floor = RuledFloor(self._scene, pictures.goal_style(self._scene, self._style))
        return self._floor.image(blocks)

    def info(self) -> dict[str, Any]:
        last = asdict(self._last or ExecutedStep("no_block"))
        del last["end"]
        return {**last, "reached": self._reached, "is_complete": self._is_complete}

    def close(self) -> None:
        self._stack.close()

    @property
    def _is_complete(self) -> bool:
        return self._reached == len(self._scene) == len(self.blocks)

    def _count(self, goal: tuple[Block, ...]) -> int:
        return blocks_reached(goal, self.blocks, *_NEAR)


class PhyBlockEnv(gymnasium.Env[Observation, Any]):
    """Builds one scene per episode, block by block.

    Observations are pictures (`current`, `goal`, `candidates`: RGB, shape (size, size, 3), uint8),
    with `observe="text"` also `text`, the prompt of step planning about them. With
    `observe="state"` they are only numbers (`goal` and `candidates`: one row per block, float32,
    see the module; `placed`: number of blocks placed as each candidate, shape (16,), uint8; `left`:
    the share of remaining steps, shape (1,), float32; if actions are poses, also `world`: the
    current blocks, rows as in `goal`).
    It terminates with Done, the goal complete, and under `physics="strict"` a collapse; it is
    truncated after `max_steps` steps (None: twice the blocks) or `max_failures` failures in a row.
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
        action: Action = "block",
        size_px: int = 512,
        background: Background = "checkerboard",
        max_steps: int | None = None,
        max_failures: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        """Play `data`, a data set (folder, official checkout, bundled name) or tasks: scenes of
        `levels` (None: all), or one `scene`. With `action="pose"` a block is put at the action's
        position, in its candidate's orientation; `setting` and `gating` are for `action="block"`.

        Raises DataError for a missing data set or scene, ValueError for a wrong option or no tasks.
        """
        for name, value, allowed in (
            ("setting", setting, SETTINGS),
            ("gating", gating, GATINGS),
            ("physics", physics, get_args(Physics)),
            ("observe", observe, get_args(Observe)),
            ("action", action, get_args(Action)),
            ("render_mode", render_mode, ("rgb_array", None)),
        ):
            if value not in allowed:
                raise ValueError(f"{name} is {value!r}; allowed: {', '.join(map(str, allowed))}")
        if action == "pose" and (setting != "A" or gating != "aov"):
            raise ValueError("setting and gating are for action='block'; remove them")
        if action == "pose" and observe == "text":
            raise ValueError("observe is 'text'; the prompt of a step is of action='block' alone")
        if action == "pose" and physics == "off":
            raise ValueError("physics is 'off'; a pose is executed: allowed: settle, strict")
        for name, most in {"max_steps": max_steps, "max_failures": max_failures}.items():
            if most is not None and most < 1:
                raise ValueError(f"{name} is {most}; allowed: 1 or more, or None")
        if not _SMALLEST_PX <= size_px <= pictures.LARGEST_PX:
            raise ValueError(f"size_px is {size_px}, allowed {_SMALLEST_PX}..{pictures.LARGEST_PX}")
        tasks = read_data_set(str(data)).tasks if isinstance(data, str | Path) else tuple(data)
        if levels is not None:
            if not isinstance(levels, Collection) or not set(levels) <= set(_LEVELS):
                raise ValueError(f"levels is {levels!r}; allowed: several of {_LEVELS}, or None")
            tasks = tuple(task for task in tasks if set(task.scene.levels) & set(levels))
        if not tasks:
            raise ValueError(f"data holds no tasks of levels {sorted(levels or _LEVELS)}")
        self._data = Dataset("data", Path("data"), tasks)
        self._scene = None if scene is None else self._data.task(scene).key
        self._observe = observe
        # Below the smallest drawn size, whole pixels are combined.
        self._shrink = max(1, -(-pictures.SMALLEST_PX // size_px))
        style = PictureStyle(size_px * self._shrink, background)
        self._task = tasks[0]
        self._play: _BlockPlay | _PosePlay = (
            _PosePlay(style, is_strict=physics == "strict")
            if action == "pose"
            else _BlockPlay(style, setting, gating, physics)
        )
        self._max_steps, self._max_failures = max_steps, max_failures
        self.render_mode = render_mode
        self._pictures: OrderedDict[tuple[Block, ...] | None, NDArray[np.uint8]] = OrderedDict()
        self._steps = self._most_steps = self._failures = 0
        self._is_over = False
        self._prompter: StepPlanning | None = None
        if observe == "text":
            said = [f"steps.setting={setting}", f"steps.gating={gating}", "candidates.order=file"]
            said.append(f"steps.max_steps={max_steps or 'null'}")
            suite = load_suite(bundled("benchmarks", "steps.yaml"), said)
            self._prompter = StepPlanning(suite, self._data, shop=LocalShop())
        self._begin(self._task)
        self.action_space = self._play.action_space
        parts: dict[str, spaces.Space[Any]] = {}
        if observe == "state":
            rows = {"goal": MOST_BLOCKS, "candidates": MAX_CANDIDATES}
            rows |= {"world": MOST_BLOCKS} if action == "pose" else {}
            for name, most in rows.items():
                parts[name] = spaces.Box(-360.0, 360.0, (most, TRAITS), np.float32)
            parts["placed"] = spaces.Box(0, 255, (MAX_CANDIDATES,), np.uint8)
            parts["left"] = spaces.Box(0.0, 1.0, (1,), np.float32)
        else:
            for name in _PICTURES:
                parts[name] = spaces.Box(0, 255, (size_px, size_px, 3), np.uint8)
        if observe == "text":
            parts["text"] = spaces.Text(_MOST_CHARACTERS, charset=string.printable)
        self.observation_space = cast(spaces.Space[Observation], spaces.Dict(parts))

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin a scene: `options["scene"]`, else the given one, else a random one.

        Raises ValueError for any other option, DataError for an unknown scene.
        """
        given, tasks = options or {}, self._data.tasks
        if unknown := sorted(map(str, set(given) - {"scene"})):
            raise ValueError(f"options has {', '.join(unknown)}; allowed: scene")
        super().reset(seed=seed)
        if (name := given.get("scene", self._scene)) is None:
            name = tasks[int(self.np_random.integers(len(tasks)))].key
        self._begin(self._data.task(str(name)))
        return self._observation(), self._info()

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Try a candidate, or end the assembly.

        Raises ValueError for an action outside the space, gymnasium's ResetNeeded after the end.
        """
        if self._is_over:
            raise gymnasium.error.ResetNeeded("the episode has ended: call reset() before step()")
        acted = self._play.act(action)
        self._steps += 1
        if acted is None:
            self._outcome, self._is_over = "done", True
            return self._observation(), 0.0, True, False, self._info()
        self._outcome, reward, is_right = acted
        if self._prompter is not None:
            self._past.append(PastStep(int(action), cast(StepOutcome, self._outcome)))
        self._failures = 0 if is_right else self._failures + 1
        ended = self._play.has_ended
        cut = self._steps >= self._most_steps or self._failures == self._max_failures
        self._is_over = ended or cut
        return self._observation(), reward, ended, cut and not ended, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """The current picture, shape (size, size, 3), in render mode `rgb_array`."""
        return None if self.render_mode is None else self._picture(self._play.blocks).copy()

    def close(self) -> None:
        """Release the simulator."""
        self._play.close()

    def right_moves(self) -> tuple[Any, ...]:
        """The actions that would place a block now: those of an oracle."""
        return self._play.right_moves()

    def action_masks(self) -> NDArray[np.bool_]:
        """The valid numbers in this scene, shape (17,): Done, and its candidates.

        `info["action_mask"]` is the same as int8, for sampling in Gymnasium's spaces.
        """
        return self._mask.astype(bool)

    def _begin(self, task: AssemblyTask) -> None:
        self._play.begin(task)
        self._steps = self._failures = 0
        self._outcome, self._is_over = "begun", False
        self._past: list[PastStep] = []
        self._most_steps = self._max_steps or 2 * len(task.scene)
        self._mask = (np.arange(MAX_CANDIDATES + 1) <= len(task.candidates)).astype(np.int8)
        if task is not self._task:
            self._task = task
            self._pictures.clear()

    def _observation(self) -> Observation:
        play, goal = self._play, self._task.scene.blocks
        if self._observe != "state":
            shown = zip(_PICTURES, (goal, None, play.blocks), strict=True)
            seen: Observation = {name: self._picture(blocks).copy() for name, blocks in shown}
            if self._prompter is not None:
                # The name of a picture marks its place.
                pictures = [SentImage(b"", name, 0, 0) for name in _PICTURES]
                messages = self._prompter.messages(self._task, pictures, self._past)
                parts = (part for message in messages for part in message.parts)
                seen["text"] = "\n\n".join(
                    part if isinstance(part, str) else f"[picture: {part.label}]" for part in parts
                )
            return seen
        if len(goal) > MOST_BLOCKS:
            raise ValueError(f"a goal of {len(goal)} blocks; at most {MOST_BLOCKS} fit in a state")
        placed = np.bincount(play.chosen, minlength=MAX_CANDIDATES + 1)[1:]
        left = max(0.0, 1 - self._steps / self._most_steps)
        state: Observation = {
            "goal": _rows(goal, MOST_BLOCKS),
            "candidates": _rows(play.candidates.candidates, MAX_CANDIDATES),
            "placed": placed.astype(np.uint8),
            "left": np.array([left], dtype=np.float32),
        }
        if isinstance(play, _PosePlay):
            # If there are more blocks than rows, the last ones.
            state["world"] = _rows(play.blocks[-MOST_BLOCKS:], MOST_BLOCKS)
        return state

    def _picture(self, blocks: tuple[Block, ...] | None) -> NDArray[np.uint8]:
        """A picture of blocks, or of the candidates, from a cache of the last ones used."""
        if blocks not in self._pictures:
            self._pictures[blocks] = np.asarray(self._play.image(blocks).reduce(self._shrink))
            if len(self._pictures) > _KEPT_PICTURES:
                self._pictures.popitem(last=False)
        self._pictures.move_to_end(blocks)
        return self._pictures[blocks]

    def _info(self) -> dict[str, Any]:
        return {
            "scene": self._task.scene.id,
            "outcome": self._outcome,
            "step": self._steps,
            "n_blocks": len(self._task.scene),
            "chosen": self._play.chosen,
            "right_moves": self.right_moves(),
            "action_mask": self._mask.copy(),
            **self._play.info(),
        }
