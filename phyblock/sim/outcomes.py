"""Outcomes of removing or adding a block: settled poses, and the blocks that moved.

An outcome counts only if all settings agree and each block either stayed where it was or moved far.
Time step, solver, friction and masses vary, and the floor is tilted slightly, each time to another
side, because a block whose weight is exactly over an edge may stay on a level floor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from phyblock.domain.blocks import SHAPES
from phyblock.domain.scene import Block
from phyblock.sim.balance import FRICTIONS, MASS_FACTORS
from phyblock.sim.dynamics import groups, moments, wait
from phyblock.sim.engine import GRAVITY_M_S2, Physics, Pose, open_world

LEAN_DEG = 2.0
"""Slope of the floor [degrees]; at the least friction, blocks begin to slide at 15."""
_STILL_M, _STILL_DEG = 0.004, 4.0
_MOVED_M, _MOVED_DEG = 0.02, 20.0
_LONGEST_S = 5.0


def _leaning(physics: Physics, downhill: tuple[float, float]) -> Physics:
    """The same settings on a floor that is tilted by `LEAN_DEG` towards a unit vector (x, y)."""
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
"""Settings of every outcome; the first gives the settled poses."""


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
    verdicts = set()
    for setting in OUTCOME_SETTINGS:
        verdicts.add(_holds(near, setting))
        if len(verdicts) > 1 or None in verdicts:
            return None
    return verdicts.pop()


def _holds(blocks: Sequence[Block], setting: Physics) -> bool | None:
    with open_world(setting) as world:
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
    """True if a block moved far, False if it stayed where it was, None if neither is clear."""
    distance_m, angle_deg = end.distance_m(start), end.angle_deg(start)
    if distance_m > _MOVED_M or angle_deg > _MOVED_DEG:
        return True
    return None if distance_m > _STILL_M or angle_deg > _STILL_DEG else False
