"""Outcomes of taking a block away, pushing one or putting one down: settled poses, and who moved.

An outcome counts only where every setting names the same blocks: each either stayed where it was or
moved far. Time step, solver, friction and masses vary, and the floor leans a little, each time to
another side, because a block whose weight is exactly over an edge stays on many a table.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from phyblock.domain.blocks import SHAPES
from phyblock.domain.scene import Block
from phyblock.sim.balance import FRICTIONS, MASS_FACTORS
from phyblock.sim.dynamics import groups, moments, wait
from phyblock.sim.engine import GRAVITY_M_S2, Physics, Pose, World

LEAN_DEG = 2.0
"""Slope of the floor [degrees]; blocks begin to slide at 15, where friction is least."""
_STILL_M, _STILL_DEG = 0.004, 4.0
_MOVED_M, _MOVED_DEG = 0.02, 20.0
_LONGEST_S = 5.0
_PATIENCE = 4.0  # A push is kept up this many times as long as without friction.
_DOWN_M = 0.008
_SAME_M, _SAME_DEG = 0.015, 15.0
_AS_FAR_M, _STRAIGHT_DEG = 0.005, 10.0


def _leaning(physics: Physics, downhill: tuple[float, float]) -> Physics:
    """The same settings on a floor that leans by `LEAN_DEG` to a side, a unit vector (x, y)."""
    slope = math.radians(LEAN_DEG)
    x, y = (part * math.sin(slope) * GRAVITY_M_S2 for part in downhill)
    return replace(physics, gravity_m_s2=(x, y, -math.cos(slope) * GRAVITY_M_S2))


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
"""Settings that every outcome is tried under; the first gives the settled poses."""


@dataclass(frozen=True)
class Push:
    """A block pushed along a unit vector (x, y), until it has gone so far or has come down.

    The distance is 6 mm off the grid of 12.5 mm that edges of built structures lie on.
    """

    order: int
    direction: tuple[float, float]
    distance_m: float = 0.044
    speed_m_s: float = 0.1


@dataclass(frozen=True)
class Outcome:
    """Result of a removal or push: orders that moved, and final poses under the first setting.

    Where settings do not agree, with a margin, it is not clear, and the rest means nothing.
    """

    moved: tuple[int, ...]
    settled: tuple[Block, ...]
    is_clear: bool


_UNCLEAR = Outcome((), (), False)


def after(
    blocks: Sequence[Block],
    push: Push | None = None,
    settings: Sequence[Physics] = OUTCOME_SETTINGS,
) -> Outcome:
    """Let blocks go where they are, or push one of them, and see what follows."""
    agreed: dict[int, bool | None] = {}
    first: dict[int, Pose] = {}
    for setting in settings:
        with World(setting) as world:
            world.place(*blocks)
            if push is not None:
                _push(world, push)
            is_at_rest, poses = wait(world, _LONGEST_S), world.poses()
        moved = _moved(blocks, poses)
        agreed, first = agreed or moved, first or poses
        if not is_at_rest or None in moved.values() or moved != agreed:
            return _UNCLEAR
        if push is not None and not _went_alike(blocks, push, first, poses):
            return _UNCLEAR
    settled = tuple(first[b.order].put(b) if agreed[b.order] else b for b in blocks)
    return Outcome(tuple(order for order, has in agreed.items() if has), settled, True)


def after_removal(blocks: Sequence[Block], order: int) -> Outcome:
    """The outcome of taking the block with this order away at once."""
    return after([block for block in blocks if block.order != order])


def holds(blocks: Sequence[Block], about: int) -> bool | None:
    """True if all blocks near one stay where they are; None where settings, or limits, differ."""
    near = next(group for group in groups(blocks) if any(b.order == about for b in group))
    verdicts = set()
    for setting in OUTCOME_SETTINGS:
        verdicts.add(_holds(near, setting))
        if len(verdicts) > 1 or None in verdicts:
            return None
    return verdicts.pop()


def _holds(blocks: Sequence[Block], setting: Physics) -> bool | None:
    with World(setting) as world:
        world.place(*blocks)
        for is_at_rest in moments(world, _LONGEST_S):
            moved = _moved(blocks, world.poses()).values()
            if True in moved:
                return False
            if is_at_rest:
                return None if None in moved else True
    return None


def _moved(blocks: Sequence[Block], poses: Mapping[int, Pose]) -> dict[int, bool | None]:
    return {one.order: has_moved(Pose.goal(one), poses[one.order]) for one in blocks}


def has_moved(start: Pose, end: Pose) -> bool | None:
    """True if a block moved far, False if it stayed where it was, None where neither is clear."""
    distance_m, angle_deg = end.distance_m(start), end.angle_deg(start)
    if distance_m > _MOVED_M or angle_deg > _MOVED_DEG:
        return True
    return None if distance_m > _STILL_M or angle_deg > _STILL_DEG else False


def _push(world: World, push: Push) -> None:
    x, y = (part * push.speed_m_s for part in push.direction)
    start = world.pose(push.order)
    # Friction takes some of the speed within each step, so time alone does not tell the distance.
    longest_s = _PATIENCE * push.distance_m / push.speed_m_s
    for _ in range(round(longest_s / world.physics.time_step_s)):
        world.drive(push.order, (x, y))
        world.step(world.physics.time_step_s)
        now = world.pose(push.order)
        if _gone_m(push, start, now) >= push.distance_m or _came_down(start, now):
            return


def _went_alike(
    blocks: Sequence[Block], push: Push, first: Mapping[int, Pose], poses: Mapping[int, Pose]
) -> bool:
    """True if a push ends alike in two settings, and as a person would tell it."""
    starts = {block.order: Pose.goal(block) for block in blocks}
    if any(_came_down(s, first[o]) != _came_down(s, poses[o]) for o, s in starts.items()):
        return False
    start, one, other = starts[push.order], first[push.order], poses[push.order]
    if one.distance_m(other) > _SAME_M or one.angle_deg(other) > _SAME_DEG:
        return False
    if _came_down(start, other):
        return True
    is_as_far = abs(_gone_m(push, start, other) - push.distance_m) <= _AS_FAR_M
    return is_as_far and other.angle_deg(start) <= _STRAIGHT_DEG


def _gone_m(push: Push, start: Pose, end: Pose) -> float:
    """Distance that the pushed block went in the direction of the push [m]."""
    way = end.position_m - start.position_m
    return float(way[0] * push.direction[0] + way[1] * push.direction[1])


def _came_down(start: Pose, end: Pose) -> bool:
    return bool(start.position_m[2] - end.position_m[2] >= _DOWN_M)
