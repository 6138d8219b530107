"""A plan with poses carried out: block after block is put at its pose, let go, and watched.

The hand that puts a block gives way a little: one that would share space with others, or with the
floor, by no more than a tolerance is moved out the shortest way, and one that hangs no higher above
them is lowered; where it would share more, it is refused and stays out. Nothing is set right later:
what fell or was knocked over stays so for the steps that follow.

A block is let go with the blocks near it alone, as scenes are checked (`steps`): others join as
soon as something that fell comes near them. What stands elsewhere would change the order in which
an engine goes through contacts, and with it whether a block that lies on a narrow edge stays there.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.scene import Block
from phyblock.errors import SimulationError
from phyblock.sim.convex import separating_axes
from phyblock.sim.engine import PhysicsEngine
from phyblock.sim.pose import Pose
from phyblock.sim.stability import DEFAULT_TRIAL, movement
from phyblock.sim.steps import REACH_M, groups, moments
from phyblock.sim.support import (
    FIT_TOLERANCE_M,
    bounds_m,
    boxes_near,
    drop_height_m,
    pieces_of,
)
from phyblock.sim.world import World
from phyblock.types import StepEnd

__all__ = [
    "LONGEST_S",
    "Carried",
    "CarriedStep",
    "CarryLimits",
    "Carrying",
    "carry_out",
    "depth_cm",
    "end_of",
    "moved_between",
]

_COLLAPSE_S = 3.0
LONGEST_S = 600.0
"""A plan that takes longer, by the clock, is given up: no result, whatever it did so far [s]."""
_TRIES = 16
_CM = 100.0
_DIGITS = 3


@dataclass(frozen=True)
class CarryLimits:
    """What is tolerated: how far a block may be moved out of others [cm], and how far one may move
    when it is let go, or another is, and still count as standing [cm, degrees].
    """

    overlap_cm: float = 0.5
    stand_cm: float = 1.0
    stand_deg: float = 10.0


@dataclass(frozen=True)
class CarriedStep:
    """What became of a step.

    `moved_cm` and `turned_deg` say how far the block came to lie from the pose it was to have,
    `gap_cm` how far it was above whatever it would fall on when it was let go, `overlap_cm` how far
    it had to be moved out of others or the floor, or how deep it was refused; `knocked` are the
    numbers of the steps whose blocks it moved, from 1.
    """

    end: StepEnd
    moved_cm: float = 0.0
    turned_deg: float = 0.0
    gap_cm: float = 0.0
    overlap_cm: float = 0.0
    knocked: tuple[int, ...] = ()


@dataclass(frozen=True)
class Carried:
    """What became of a plan: its steps, and after each of them the blocks where they lie, each with
    the number of its step as its order.
    """

    steps: tuple[CarriedStep, ...]
    worlds: tuple[tuple[Block, ...], ...]

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks in the end."""
        return self.worlds[-1] if self.worlds else ()


def carry_out(
    blocks: Sequence[Block | None],
    limits: CarryLimits | None = None,
    engine: PhysicsEngine | None = None,
) -> Carried:
    """Put blocks at their poses, one after another; None stands for a step that names no block.

    Their orders are taken anew, from 1 by step. The same call gives the same result, whatever was
    carried out before; `engine` is the chosen one unless another is given. Raises SimulationError
    where the engine cannot be used, and for a plan that takes longer than `LONGEST_S`.
    """
    give_up_s = time.monotonic() + LONGEST_S
    steps: list[CarriedStep] = []
    worlds: list[tuple[Block, ...]] = []
    with Carrying(limits, engine) as carrying:
        for number, block in enumerate(blocks, 1):
            if time.monotonic() > give_up_s:
                message = (
                    f"carrying out a plan of {len(blocks)} steps took more than {LONGEST_S:g} s"
                )
                raise SimulationError(f"{message}; it was given up before step {number}")
            steps.append(carrying.step(block))
            worlds.append(carrying.blocks)
    return Carried(tuple(steps), tuple(worlds))


class Carrying:
    """A plan that is carried out step by step, as by `carry_out`; a context manager.

    Where a step moves no block past the limits by which a state stands (`DEFAULT_TRIAL`), all is
    set back, so that no step is judged by the drift of the ones before it.
    """

    def __init__(
        self, limits: CarryLimits | None = None, engine: PhysicsEngine | None = None
    ) -> None:
        self._limits = limits or CarryLimits()
        self._world = World(engine=engine)
        self._resting: dict[int, Block] = {}
        self._steps = 0

    def __enter__(self) -> Carrying:
        self._world.__enter__()
        return self

    def __exit__(self, *error: object) -> None:
        self._world.__exit__(*error)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """Where blocks lie now, each with the number of its step as its order."""
        return tuple(self._resting.values())

    def step(self, block: Block | None) -> CarriedStep:
        """Put a block where it is, if there is room for it, and let it go."""
        self._steps += 1
        if block is None:
            return CarriedStep("no_block")
        return self._put(replace(block, order=self._steps))

    def _put(self, block: Block) -> CarriedStep:
        below_cm = depth_cm(block)
        if below_cm > self._limits.overlap_cm:
            return CarriedStep("under_floor", overlap_cm=round(below_cm, _DIGITS))
        others = self.blocks
        most_m = self._limits.overlap_cm / _CM
        free, given_m = _out_of_others(block, others, most_m)
        if free is None:
            return CarriedStep("overlaps", overlap_cm=round(given_m * _CM, _DIGITS))
        gap_m = drop_height_m(free, others)
        if FIT_TOLERANCE_M < gap_m <= most_m:
            x, y, z = free.position_m
            free = replace(free, position_m=(x, y, z - gap_m))
        after = self._let_go(free)
        moved_cm, turned_deg = moved_between(Pose.goal(block), after[block.order])
        knocked = tuple(
            other.order
            for other in others
            if other.order in after
            and not self._is_still(*moved_between(Pose.goal(other), after[other.order]))
        )
        is_still = self._is_still(moved_cm, turned_deg)
        end = end_of(knocked, is_still)
        numbers = (moved_cm, turned_deg, gap_m * _CM, given_m * _CM)
        moved, turned, gap, given = (round(number, _DIGITS) + 0.0 for number in numbers)
        return CarriedStep(end, moved, turned, gap, given, knocked)

    def _let_go(self, block: Block) -> dict[int, Pose]:
        """Where the block and all that it could move are once they rest."""
        self._resting[block.order] = block
        apart = groups(self.blocks)
        near: tuple[Block, ...] = ()
        reached = {block.order}
        while reached:
            reached.update(one.order for one in near)
            near = tuple(b for group in apart if _are_among(group, reached) for b in group)
            after, reached = self._tried(near)
        if movement(near, after, DEFAULT_TRIAL).fallen:
            for order, pose in after.items():
                self._resting[order] = pose.put(self._resting[order])
        return after

    def _tried(self, near: Sequence[Block]) -> tuple[dict[int, Pose], set[int]]:
        """Where blocks come to rest without the others, or which of the others they reach."""
        others = tuple(block for block in self.blocks if block not in near)
        self._world.place_all(near)
        try:
            reached = self._watched(near, others, DEFAULT_TRIAL.duration_s)
            # What has not fallen by then stands: an engine may let it creep on for ever.
            if not reached and movement(near, self._world.poses(), DEFAULT_TRIAL).fallen:
                reached = self._watched(near, others, _COLLAPSE_S)
            return self._world.poses(), reached
        finally:
            for block in near:
                self._world.remove(block.order)

    def _watched(self, near: Sequence[Block], others: Sequence[Block], limit_s: float) -> set[int]:
        """Let blocks go until they rest or reach others, which are named."""
        before = self._world.poses()
        for is_quiet in moments(self._world, limit_s):
            after = self._world.poses()
            if reached := _reached(near, before, after, others):
                return reached
            if is_quiet:
                break
            before = after
        return set()

    def _is_still(self, moved_cm: float, turned_deg: float) -> bool:
        return moved_cm <= self._limits.stand_cm and turned_deg <= self._limits.stand_deg


def _are_among(group: Sequence[Block], orders: Set[int]) -> bool:
    return any(block.order in orders for block in group)


def _reached(
    near: Sequence[Block],
    before: Mapping[int, Pose],
    after: Mapping[int, Pose],
    others: Sequence[Block],
) -> set[int]:
    """Orders of the others that blocks on the move have come near since a moment ago."""
    if not others:
        return set()
    fallen = movement(near, after, DEFAULT_TRIAL).fallen
    found = set()
    for block in near:
        if block.order in fallen:
            was, now = (bounds_m(poses[block.order].put(block)) for poses in (before, after))
            way = np.stack([np.minimum(was, now)[0], np.maximum(was, now)[1]])
            found |= {o.order for o in others if boxes_near(bounds_m(o), way, REACH_M)}
    return found


def depth_cm(block: Block) -> float:
    """How far a block reaches below the floor [cm]; negative above it."""
    return -float(bounds_m(block)[0, 2]) * _CM


def moved_between(start: Pose, end: Pose) -> tuple[float, float]:
    """How far a block moved [cm] and turned [degrees]."""
    return start.distance_m(end) * _CM, start.angle_deg(end)


def end_of(knocked: Collection[int], is_still: bool) -> StepEnd:
    """How a step ended whose block was let go."""
    return "knocks_over" if knocked else "stands" if is_still else "falls"


def _out_of_others(
    block: Block, others: Sequence[Block], most_m: float
) -> tuple[Block | None, float]:
    """The block moved out of others and of the floor, and how far; None where that is farther than
    `most_m` [m].
    """
    start = np.array(block.position_m)
    for _ in range(_TRIES):
        way = _way_out(block, others)
        depth_m = float(np.linalg.norm(way))
        moved_m = float(np.linalg.norm(np.array(block.position_m) + way - start))
        if moved_m > most_m or depth_m > most_m:
            return None, max(moved_m, depth_m)
        if depth_m <= FIT_TOLERANCE_M:
            break
        x, y, z = (float(part) for part in np.array(block.position_m) + way)
        block = replace(block, position_m=(x, y, z))
    return block, float(np.linalg.norm(np.array(block.position_m) - start))


def _way_out(block: Block, others: Sequence[Block]) -> NDArray[np.float64]:
    """The shortest way out of the deepest overlap, shape (3,) [m]; zero where there is none."""
    deepest = np.array([0.0, 0.0, max(0.0, -float(bounds_m(block)[0, 2]))])
    for way in _overlaps(block, others):
        if np.linalg.norm(way) > np.linalg.norm(deepest):
            deepest = way
    return deepest


def _overlaps(block: Block, others: Sequence[Block]) -> Iterator[NDArray[np.float64]]:
    box, mine = bounds_m(block), pieces_of(block)
    for other in others:
        if boxes_near(bounds_m(other), box, 0.0):
            for theirs in pieces_of(other):
                for piece in mine:
                    axes = separating_axes(theirs, piece)
                    best = int(axes.gaps_m.argmax())
                    if axes.gaps_m[best] < 0:
                        yield -axes.gaps_m[best] * axes.directions[best]
