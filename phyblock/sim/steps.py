"""Stability of every step of a building order, at a fraction of the cost of trying each for long.

Two facts save time and change no verdict: blocks that nothing brings near one another cannot
disturb one another, so a step is tried with the new block's own group alone; and a group that has
been quiet for a while is at rest, for an unsupported load of 0.2 % of a block's weight would show.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from phyblock.domain.scene import Block
from phyblock.sim.stability import (
    DEFAULT_TRIAL,
    Movement,
    Stability,
    Trial,
    movement,
    verdict,
)
from phyblock.sim.support import bounds_m, boxes_near
from phyblock.sim.world import World

__all__ = [
    "DEFAULT_REST",
    "REACH_M",
    "Rest",
    "check_at_rest",
    "check_steps",
    "groups",
    "moments",
    "wait",
]


@dataclass(frozen=True)
class Rest:
    """When blocks are at rest: no corner was faster than `speed_m_s` [m/s] for `quiet_s` [s].

    Speeds are read every `every_s` [s]. 5 mm/s lies above the jitter of resting contacts (up to
    4 mm/s) and far below what a block reaches that has begun to tip.
    """

    speed_m_s: float = 0.005
    quiet_s: float = 0.25
    every_s: float = 0.05


DEFAULT_REST = Rest()
REACH_M = 0.012
"""Groups this far apart stay apart while no block passes the limits of a trial."""


def check_steps(
    blocks: Sequence[Block], trial: Trial = DEFAULT_TRIAL, rest: Rest | None = DEFAULT_REST
) -> tuple[Stability, ...]:
    """Stability after each step when blocks are placed in the order given.

    Only the group of the block just placed is tried, every block at its goal pose; the other
    groups were tried at earlier steps. With `rest` None every trial takes its full time.
    """
    by_step: list[list[Movement]] = [[] for _ in blocks]
    for physics in trial.physics:
        with World(physics) as world:
            for count in range(len(blocks)):
                group = _group_of_last(blocks[: count + 1])
                by_step[count].append(_try(world, group, trial, rest))
    return tuple(verdict(movements, trial) for movements in by_step)


def check_at_rest(
    blocks: Sequence[Block], trial: Trial = DEFAULT_TRIAL, rest: Rest = DEFAULT_REST
) -> Stability:
    """Stability of a state as `check` finds it, each group watched until it is at rest."""
    movements = []
    for physics in trial.physics:
        with World(physics) as world:
            tried = [_try(world, group, trial, rest) for group in groups(blocks)]
        fallen = tuple(sorted(order for one in tried for order in one.fallen))
        moved_m = max((one.moved_m for one in tried), default=0.0)
        turned_deg = max((one.turned_deg for one in tried), default=0.0)
        movements.append(Movement(moved_m, turned_deg, fallen))
    return verdict(movements, trial)


def groups(blocks: Sequence[Block], reach_m: float = REACH_M) -> tuple[tuple[Block, ...], ...]:
    """The blocks in groups that keep more than `reach_m` [m] of free space between them."""
    boxes = [bounds_m(block) for block in blocks]
    left = set(range(len(blocks)))
    touching: list[tuple[Block, ...]] = []
    while left:
        frontier = [min(left)]
        left.remove(frontier[0])
        members = []
        while frontier:
            at = frontier.pop()
            members.append(at)
            near = {other for other in left if boxes_near(boxes[at], boxes[other], reach_m)}
            left -= near
            frontier += sorted(near)
        touching.append(tuple(blocks[member] for member in sorted(members)))
    return tuple(touching)


def _group_of_last(blocks: Sequence[Block]) -> tuple[Block, ...]:
    return next(group for group in groups(blocks) if blocks[-1] in group)


def _try(world: World, group: Sequence[Block], trial: Trial, rest: Rest | None) -> Movement:
    """What becomes of a group, alone in the world for this trial."""
    world.place_all(group)
    if rest is None:
        world.step(trial.duration_s)
    else:
        wait(world, trial.duration_s, rest)
    moved = movement(group, world.poses(), trial)
    for block in group:
        world.remove(block.order)
    return moved


def wait(world: World, limit_s: float, rest: Rest = DEFAULT_REST) -> bool:
    """Simulate until all has been quiet for a while; whether that was within `limit_s` [s]."""
    return any(moments(world, limit_s, rest))


def moments(world: World, limit_s: float, rest: Rest = DEFAULT_REST) -> Iterator[bool]:
    """Simulate moment by moment up to `limit_s` [s]; yields whether all is at rest by then."""
    every_s = max(rest.every_s, world.physics.time_step_s)
    quiet_s = 0.0
    for _ in range(round(limit_s / every_s)):
        world.step(every_s)
        quiet_s = quiet_s + every_s if world.fastest_m_s() < rest.speed_m_s else 0.0
        yield quiet_s >= rest.quiet_s - every_s / 2
