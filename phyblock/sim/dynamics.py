"""Blocks released under physics: states, building orders, plans with poses, removals.

Three facts save time. Structures that are proven to stand (`balance`) need no trial, except large
finished ones (`check`). Blocks that are far apart cannot disturb each other, so they are tried
group by group (`groups`), each as if it were at the origin: in PyBullet, the last digits of a
position decide if wheels under a plank roll away. And a group that is quiet for a while is at rest
(`moments`), since an unsupported load of 0.2 % of a block's weight would show.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import math
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from phyblock.domain.blocks import SHAPES
from phyblock.domain.scene import Block
from phyblock.errors import SimulationError
from phyblock.sim.balance import FRICTIONS, MASS_FACTORS, prove_standing
from phyblock.sim.contact import FIT_TOLERANCE_M, bounds_m, boxes_near, drop_height_m, piece_pairs
from phyblock.sim.engine import Physics, PhysicsEngine, Pose, World, open_world, physics_engine
from phyblock.sim.geometry import rounded, significant
from phyblock.types import StepEnd


@dataclass(frozen=True)
class Trial:
    """A test of stability: simulated time [s] and limits of movement, for each of `physics`."""

    duration_s: float = 2.0
    limit_m: float = 0.005
    limit_deg: float = 5.0
    physics: tuple[Physics, ...] = (Physics(1 / 240, 200), Physics(1 / 480, 200))


DEFAULT_TRIAL = Trial()
ONE_SETTING = Trial(physics=DEFAULT_TRIAL.physics[:1])
"""A trial with the first setting only, at a third of the cost; not used for scores."""


REST_SPEED_M_S = 0.005
"""Blocks are at rest if no corner is faster; above the jitter of contacts (up to 4 mm/s)."""
QUIET_S = 0.25  # Time during which no corner may be faster [s].
_EVERY_S = 0.05
REACH_M = 0.012  # Groups this far apart stay apart while no block passes the limits of a trial.
_COLLAPSE_S = 3.0  # Time for fallen blocks to come to rest [s].


@dataclass(frozen=True)
class Stability:
    """Result of a trial: orders beyond a limit, largest movement [m], and if settings agreed."""

    fallen: tuple[int, ...] = ()
    moved_m: float = 0.0
    agreed: bool = True

    @classmethod
    def of(cls, parts: Sequence[Stability]) -> Stability:
        """Combine the results of settings, or of groups."""
        return cls(
            fallen=tuple(sorted({order for one in parts for order in one.fallen})),
            moved_m=max((one.moved_m for one in parts), default=0.0),
            agreed=len({one.fallen for one in parts}) <= 1,
        )


# Larger structures have tall columns, which an engine may let creep though they could stand.
MOST_PROVEN = 22


def execution_physics(goal: Sequence[Block]) -> Physics | None:
    """Return the settings that execute plans for a goal; None for the default.

    PyBullet needs more iterations for the tall columns of large goals.
    """
    return DEFAULT_TRIAL.physics[0] if len(goal) > MOST_PROVEN else None


def check(
    blocks: Sequence[Block], trial: Trial = DEFAULT_TRIAL, quiet_s: float | None = None
) -> Stability:
    """Release each group, to the end or until quiet for `quiet_s`, and return its stability.

    Groups that are proven to stand are not simulated, up to `MOST_PROVEN` blocks in all.
    """
    is_large = len(blocks) > MOST_PROVEN
    parts = [group for group in groups(blocks) if is_large or not is_proven(group)]
    return _try_groups(parts, trial, quiet_s)


def check_steps(blocks: Sequence[Block], trial: Trial = DEFAULT_TRIAL) -> tuple[Stability, ...]:
    """Return the stability after each step: only the group of the block just placed is tried."""
    steps = (blocks[:n] for n in range(1, len(blocks) + 1))
    near = [next(group for group in groups(step) if step[-1] in group) for step in steps]
    return tuple(_try_groups([] if is_proven(group) else [group], trial, QUIET_S) for group in near)


def _try_groups(parts: Sequence[Sequence[Block]], trial: Trial, quiet_s: float | None) -> Stability:
    """Release groups one after another, in a new world for each setting."""
    settings = []
    for physics in trial.physics if parts else ():
        with open_world(physics) as world:
            settings.append(Stability.of([_tried(world, one, trial, quiet_s) for one in parts]))
    return Stability.of(settings)


def is_proven(group: Sequence[Block]) -> bool:
    """True if there is a proof that blocks stand, independent of their place on the ground."""
    return _is_proven(_arrangement(group))


@functools.lru_cache(maxsize=4096)
def _is_proven(blocks: tuple[Block, ...]) -> bool:
    return prove_standing(blocks) is not None


def groups(blocks: Sequence[Block], reach_m: float = REACH_M) -> tuple[tuple[Block, ...], ...]:
    """Return the blocks in groups with more than `reach_m` [m] of free space between them."""
    boxes = [bounds_m(block) for block in blocks]
    found: list[list[int]] = []
    for at, box in enumerate(boxes):
        near = [one for one in found if any(boxes_near(boxes[n], box, reach_m) for n in one)]
        found = [one for one in found if one not in near] + [sorted(sum(near, [at]))]
    return tuple(tuple(blocks[n] for n in one) for one in sorted(found))


def movement(blocks: Sequence[Block], poses: Mapping[int, Pose], trial: Trial) -> Stability:
    """Return the movement of blocks from their goal poses, and the orders beyond a limit."""
    moved = {b.order: poses[b.order].distance_m(Pose.goal(b)) for b in blocks}
    turned = {b.order: poses[b.order].angle_deg(Pose.goal(b)) for b in blocks}
    fallen = (o for o in moved if moved[o] > trial.limit_m or turned[o] > trial.limit_deg)
    return Stability(tuple(sorted(fallen)), max(moved.values(), default=0.0))


def wait(world: World, limit_s: float, quiet_s: float = QUIET_S) -> bool:
    """Simulate until all blocks are at rest; True if that was within `limit_s` [s]."""
    return any(moments(world, limit_s, quiet_s))


def moments(world: World, limit_s: float, quiet_s: float = QUIET_S) -> Iterator[bool]:
    """Simulate in short intervals up to `limit_s` [s]; yield True once all blocks are at rest."""
    every_s = max(_EVERY_S, world.physics.time_step_s)
    since_s = 0.0
    for _ in range(round(limit_s / every_s)):
        world.step(every_s)
        since_s = since_s + every_s if world.fastest_m_s() < REST_SPEED_M_S else 0.0
        yield since_s >= quiet_s - every_s / 2


def _tried(world: World, group: Sequence[Block], trial: Trial, quiet_s: float | None) -> Stability:
    """Return the movement of a group, alone in the world and as if it were at the origin."""
    arranged = _arrangement(group)
    with _placed(world, arranged):
        if quiet_s is None:
            world.step(trial.duration_s)
        else:
            wait(world, trial.duration_s, quiet_s)
        moved = movement(arranged, world.poses(), trial)
    return replace(moved, fallen=tuple(group[number - 1].order for number in moved.fallen))


@contextlib.contextmanager
def _placed(world: World, blocks: Sequence[Block]) -> Iterator[None]:
    """Keep blocks in a world for the duration of a with statement."""
    world.place(*blocks)
    try:
        yield
    finally:
        for block in reversed(blocks):
            world.remove(block.order)


_KEPT = 65_536  # Cached arrangements and states, about 1 kB each.
_PLACE_DIGITS = 6
_ONE_AT_A_TIME = threading.RLock()
_OPEN = contextlib.ExitStack()
atexit.register(_OPEN.close)


class Settled(NamedTuple):
    """Blocks after release, at their goal poses, except the `fallen` ones, which are at rest."""

    fallen: tuple[int, ...]
    blocks: tuple[Block, ...]


def settle(blocks: Sequence[Block], trial: Trial = DEFAULT_TRIAL) -> Settled:
    """Release blocks at their goal poses; a block falls if it does under any setting.

    An arrangement is tried once; verdicts do not depend on earlier ones. Safe in any thread.
    """
    with _ONE_AT_A_TIME:
        return _settled(tuple(blocks), trial, physics_engine())


def stands(blocks: Sequence[Block], trial: Trial = DEFAULT_TRIAL) -> bool:
    """True if all blocks stay under every setting; for any thread, as `settle`."""
    with _ONE_AT_A_TIME:
        engine = physics_engine()
        return all(_stays(_arrangement(group), trial, engine) for group in groups(blocks))


@functools.lru_cache(maxsize=_KEPT)
def _settled(blocks: tuple[Block, ...], trial: Trial, engine: PhysicsEngine) -> Settled:
    if stands(blocks, trial):
        return Settled((), blocks)
    fallen, shown = set[int](), tuple[Block, ...]()
    for physics in trial.physics:
        # A new world: how blocks tumble could depend on earlier contents of a used one.
        with open_world(physics, engine) as world:
            world.place(*blocks)
            wait(world, trial.duration_s)
            if moved := movement(blocks, world.poses(), trial).fallen:
                wait(world, _COLLAPSE_S)
                poses = world.poses()
                moved += movement(blocks, poses, trial).fallen
                lying = (poses[b.order].put(b) if b.order in moved else b for b in blocks)
                shown = shown or tuple(lying)
        fallen.update(moved)
    return Settled(tuple(sorted(fallen)), shown or blocks)


@functools.lru_cache(maxsize=_KEPT)
def _stays(group: tuple[Block, ...], trial: Trial, engine: PhysicsEngine) -> bool:
    """True if a group, alone in the world, stays where it is under every setting."""
    worlds = (_kept_world(physics, engine) for physics in trial.physics)
    return not any(_tried(world, group, trial, QUIET_S).fallen for world in worlds)


@functools.cache
def _kept_world(physics: Physics, engine: PhysicsEngine) -> World:
    """Return a world for many groups: in PyBullet, opening one takes longer than a trial."""
    return _OPEN.enter_context(open_world(physics, engine))


def _arrangement(group: Sequence[Block]) -> tuple[Block, ...]:
    """Return all that a group's stability depends on: first block at the origin, no colors."""
    x0, y0, _ = group[0].position_m
    kept = []
    for number, block in enumerate(group, 1):
        x, y, z = block.position_m
        place = (round(x - x0, _PLACE_DIGITS) + 0.0, round(y - y0, _PLACE_DIGITS) + 0.0, z)
        kept.append(Block(number, block.type, "red", place, block.euler_deg, (), 1))
    return tuple(kept)


EXECUTION_LIMITS = {"overlap_cm": 0.5, "stand_cm": 1.0, "stand_deg": 10.0}
"""Limits of moving a block out of overlaps, and of movement and turn of a standing block."""
LONGEST_S = 600.0  # Time after which execution of a plan is given up [s].
_TRIES = 16
_CM = 100.0
_DIGITS = 3


@dataclass(frozen=True)
class ExecutedStep:
    """Result of a step: the distance of the block at rest from its pose.

    `gap_cm` is the gap below its pose, `overlap_cm` how far it was moved out of others or the
    floor, or how deep it was when refused; `knocked` has the steps, from 1, whose blocks it moved.
    """

    end: StepEnd
    moved_cm: float = 0.0
    turned_deg: float = 0.0
    gap_cm: float = 0.0
    overlap_cm: float = 0.0
    knocked: tuple[int, ...] = ()


@dataclass(frozen=True)
class Execution:
    """Result of a plan: its steps, and the poses of blocks after each of them."""

    steps: tuple[ExecutedStep, ...]
    worlds: tuple[tuple[Block, ...], ...]

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The final blocks."""
        return self.worlds[-1] if self.worlds else ()


def execute(
    blocks: Sequence[Block | None],
    engine: PhysicsEngine | None = None,
    physics: Physics | None = None,
) -> Execution:
    """Put blocks at their poses, one after another; None is a step that names no block.

    Raises SimulationError if the engine cannot be used, or after `LONGEST_S`.
    """
    give_up_s = time.monotonic() + LONGEST_S
    steps: list[ExecutedStep] = []
    worlds: list[tuple[Block, ...]] = []
    with Executor(engine, physics) as executor:
        for number, block in enumerate(blocks, 1):
            if time.monotonic() > give_up_s:
                raise SimulationError(f"step {number} was not reached within {LONGEST_S:g} s")
            steps.append(executor.step(block))
            worlds.append(executor.blocks)
    return Execution(tuple(steps), tuple(worlds))


class Executor:
    """Executes a plan with poses, step by step; a context manager.

    A block that overlaps others by at most a tolerance is moved out the shortest way, and one that
    floats by no more is lowered; one that overlaps more is refused. It is released with only the
    blocks near it; others join if something that fell comes near. If a step moves nothing beyond
    the limits of `DEFAULT_TRIAL`, all poses are restored: drift must not affect later steps.
    """

    def __init__(self, engine: PhysicsEngine | None = None, physics: Physics | None = None) -> None:
        self._world = open_world(physics, engine)
        self._resting: dict[int, Block] = {}
        self._steps = 0

    def __enter__(self) -> Executor:
        return self

    def __exit__(self, *error: object) -> None:
        self._world.__exit__(*error)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks at their current poses, with the numbers of their steps as orders."""
        return tuple(self._resting.values())

    def step(self, block: Block | None) -> ExecutedStep:
        """Put a block at its pose, if there is room for it, and release it."""
        self._steps += 1
        if block is None:
            return ExecutedStep("no_block")
        block = replace(block, order=self._steps)
        names = ("overlap_cm", "stand_cm", "stand_deg")
        overlap_cm, stand_cm, stand_deg = (EXECUTION_LIMITS[name] for name in names)
        if (below_cm := -float(bounds_m(block)[0, 2]) * _CM) > overlap_cm:
            return ExecutedStep("under_floor", overlap_cm=round(below_cm, _DIGITS))
        others = self.blocks
        most_m = overlap_cm / _CM
        free, given_m = _out_of_others(block, others, most_m)
        if free is None:
            return ExecutedStep("overlaps", overlap_cm=round(given_m * _CM, _DIGITS))
        gap_m = significant(drop_height_m(free, others))
        if FIT_TOLERANCE_M < gap_m <= most_m:
            x, y, z = free.position_m
            free = replace(free, position_m=(x, y, z - gap_m))
        after = self._let_go(free)
        moved, fallen = (0.0, 0.0), []
        for one in (*others, block):
            if one.order in after:
                goal, now = Pose.goal(one), after[one.order]
                moved = goal.distance_m(now) * _CM, goal.angle_deg(now)
                if not (moved[0] <= stand_cm and moved[1] <= stand_deg):
                    fallen.append(one.order)
        knocked = tuple(order for order in fallen if order != block.order)
        end: StepEnd = "knocks_over" if knocked else "falls" if fallen else "stands"
        numbers = (*moved, gap_m * _CM, given_m * _CM)
        moved_cm, turned_deg, gap, given = (round(number, _DIGITS) + 0.0 for number in numbers)
        return ExecutedStep(end, moved_cm, turned_deg, gap, given, knocked)

    def _let_go(self, block: Block) -> dict[int, Pose]:
        """Return the poses at rest of the block and of all others that it could move."""
        self._resting[block.order] = block
        apart = groups(self.blocks)
        near: tuple[Block, ...] = ()
        reached = {block.order}
        while reached:
            reached.update(one.order for one in near)
            meant = (group for group in apart if any(b.order in reached for b in group))
            near = tuple(b for group in meant for b in group)
            others = tuple(b for b in self.blocks if b not in near)
            with _placed(self._world, near):
                reached = self._watched(near, others, DEFAULT_TRIAL.duration_s)
                # Blocks that have not fallen by then stand: an engine may let them creep forever.
                if not reached and movement(near, self._world.poses(), DEFAULT_TRIAL).fallen:
                    reached = self._watched(near, others, _COLLAPSE_S)
                after = self._world.poses()
        if movement(near, after, DEFAULT_TRIAL).fallen:
            for order, pose in after.items():
                self._resting[order] = pose.put(self._resting[order])
        return after

    def _watched(self, near: Sequence[Block], others: Sequence[Block], limit_s: float) -> set[int]:
        """Simulate blocks until they rest or come near others; return the orders of those."""
        before = self._world.poses()
        for is_quiet in moments(self._world, limit_s):
            after = self._world.poses()
            fallen = movement(near, after, DEFAULT_TRIAL).fallen if others else ()
            reached: set[int] = set()
            for block in near:
                if block.order in fallen:
                    was, now = (bounds_m(at[block.order].put(block)) for at in (before, after))
                    way = np.stack([np.minimum(was, now)[0], np.maximum(was, now)[1]])
                    reached |= {o.order for o in others if boxes_near(bounds_m(o), way, REACH_M)}
            if reached:
                return reached
            if is_quiet:
                break
            before = after
        return set()


def _out_of_others(
    block: Block, others: Sequence[Block], most_m: float
) -> tuple[Block | None, float]:
    """Return the block moved out of others and the floor, None if too far, and the distance [m]."""
    start = place = np.array(block.position_m)
    for _ in range(_TRIES):
        # The shortest way out of the deepest overlap; zero if there is none.
        box = bounds_m(block)
        way = np.array([0.0, 0.0, max(0.0, -float(box[0, 2]))])
        for other in others:
            if not boxes_near(bounds_m(other), box, 0.0):
                continue
            for _, _, axes in piece_pairs(other, block):
                best = int(axes.gaps_m.argmax())
                out = -min(axes.gaps_m[best], 0.0) * axes.directions[best]
                if np.linalg.norm(out) > np.linalg.norm(way):
                    way = out
        depth_m, moved_m = (float(np.linalg.norm(part)) for part in (way, place + way - start))
        if max(moved_m, depth_m) > most_m:
            return None, max(moved_m, depth_m)
        if depth_m <= FIT_TOLERANCE_M:
            break
        place = rounded(place + way)
        x, y, z = place.tolist()
        block = replace(block, position_m=(x, y, z))
    return block, float(np.linalg.norm(place - start))


LEAN_DEG = 2.0  # Slope of the floor [degrees]; at the least friction, blocks begin to slide at 15.
_STILL_M, _STILL_DEG = 0.004, 4.0
_MOVED_M, _MOVED_DEG = 0.02, 20.0
_LONGEST_S = 5.0


def _leaning(physics: Physics, downhill: tuple[float, float]) -> Physics:
    """The same settings on a floor that is tilted by `LEAN_DEG` towards a unit vector (x, y)."""
    slope, gravity_m_s2 = math.radians(LEAN_DEG), -physics.gravity_m_s2[2]
    x, y = (part * math.sin(slope) * gravity_m_s2 for part in downhill)
    return replace(physics, gravity_m_s2=(x, y, -math.cos(slope) * gravity_m_s2))


_ACROSS = math.sqrt(0.75)
_LIGHTER, _HEAVIER = (
    tuple((block_type, factor) for block_type, shape in SHAPES.items() if shape.is_long)
    for factor in MASS_FACTORS
)
OUTCOME_SETTINGS: tuple[Physics, ...] = (
    Physics(1 / 240, 50, 0.35),
    _leaning(Physics(1 / 200, 50, FRICTIONS[1], mass_factors=_HEAVIER), (0.0, 1.0)),
    _leaning(Physics(1 / 300, 80, FRICTIONS[0], mass_factors=_LIGHTER), (_ACROSS, -0.5)),
    _leaning(Physics(1 / 480, 100, 0.35), (-_ACROSS, -0.5)),
)
"""Settings of every outcome of removing or adding a block; the first gives the settled poses.

An outcome counts only if all settings agree and each block either stayed where it was or moved far.
Time step, solver, friction and masses vary, and the floor is tilted slightly, each time to another
side, because a block whose weight is exactly over an edge may stay on a level floor."""


@dataclass(frozen=True)
class Outcome:
    """Result of a removal: orders that moved, and final poses under the first setting.

    If settings do not agree with a margin, it is not clear, and the other fields are meaningless.
    """

    moved: tuple[int, ...]
    settled: tuple[Block, ...]
    is_clear: bool


def after_removal(blocks: Sequence[Block], order: int) -> Outcome:
    """The outcome of suddenly removing the block with this order."""
    left = [block for block in blocks if block.order != order]
    agreed: dict[int, bool | None] = {}
    first: dict[int, Pose] = {}
    for setting in OUTCOME_SETTINGS:
        with open_world(setting) as world:
            world.place(*left)
            is_at_rest, poses = wait(world, _LONGEST_S), world.poses()
        moved = _moved(left, poses)
        agreed, first = agreed or moved, first or poses
        if not is_at_rest or None in moved.values() or moved != agreed:
            return Outcome((), (), False)
    settled = tuple(first[b.order].put(b) if agreed[b.order] else b for b in left)
    return Outcome(tuple(order for order, has in agreed.items() if has), settled, True)


def holds(blocks: Sequence[Block], about: int) -> bool | None:
    """True if all blocks near one stay where they are; None if settings, or limits, differ."""
    near = next(group for group in groups(blocks) if any(b.order == about for b in group))
    agreed: bool | None = None
    for setting in OUTCOME_SETTINGS:
        verdict: bool | None = None
        with open_world(setting) as world:
            world.place(*near)
            for is_at_rest in moments(world, _LONGEST_S):
                moved = _moved(near, world.poses()).values()
                if True in moved:
                    verdict = False
                    break
                if is_at_rest:
                    verdict = None if None in moved else True
                    break
        if verdict is None or agreed not in (None, verdict):
            return None
        agreed = verdict
    return agreed


def _moved(blocks: Sequence[Block], poses: Mapping[int, Pose]) -> dict[int, bool | None]:
    """True for a block that moved far, False for one that stayed, None if neither is clear."""
    found: dict[int, bool | None] = {}
    for block in blocks:
        start, end = Pose.goal(block), poses[block.order]
        distance_m, angle_deg = end.distance_m(start), end.angle_deg(start)
        is_far = distance_m > _MOVED_M or angle_deg > _MOVED_DEG
        is_still = distance_m <= _STILL_M and angle_deg <= _STILL_DEG
        found[block.order] = is_far if is_far or is_still else None
    return found
