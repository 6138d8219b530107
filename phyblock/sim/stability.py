"""Does it stand? Stability of a state.

A verdict is only as good as the settings it was reached at, so every result carries them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from phyblock.domain.scene import Block
from phyblock.sim.world import Physics, Pose, World

__all__ = [
    "DEFAULT_TRIAL",
    "Movement",
    "Stability",
    "Trial",
    "check",
    "movement",
    "verdict",
]


@dataclass(frozen=True)
class Trial:
    """How stability is tried: simulated time [s], limits of movement, at each of `physics`."""

    duration_s: float = 2.0
    limit_m: float = 0.005
    limit_deg: float = 5.0
    physics: tuple[Physics, ...] = (Physics(1 / 240, 50), Physics(1 / 480, 100))


DEFAULT_TRIAL = Trial()


@dataclass(frozen=True)
class Stability:
    """What a trial showed, over all its settings.

    `fallen` are the orders of blocks that passed a limit under any setting; `moved_m` [m] and
    `turned_deg` [degrees] the largest movement of any block. `agreed` says whether the settings
    name the same blocks.
    """

    fallen: tuple[int, ...]
    moved_m: float
    turned_deg: float
    agreed: bool
    trial: Trial

    @property
    def stable(self) -> bool:
        """Whether every block stayed within the limits under every setting."""
        return not self.fallen


class Movement(NamedTuple):
    """What a trial did to blocks at one of its settings, as in `Stability`."""

    moved_m: float
    turned_deg: float
    fallen: tuple[int, ...]


def check(blocks: Sequence[Block], trial: Trial = DEFAULT_TRIAL) -> Stability:
    """Let blocks go at their goal poses and see which of them stay."""
    movements = []
    for physics in trial.physics:
        with World(physics) as world:
            world.place_all(blocks)
            world.step(trial.duration_s)
            movements.append(movement(blocks, world.poses(), trial))
    return verdict(movements, trial)


def movement(blocks: Sequence[Block], poses: Mapping[int, Pose], trial: Trial) -> Movement:
    """How far blocks are from their goal poses, and which of them passed the trial's limits."""
    moved = {b.order: poses[b.order].distance_m(Pose.goal(b)) for b in blocks}
    turned = {b.order: poses[b.order].angle_deg(Pose.goal(b)) for b in blocks}
    fallen = (o for o in moved if moved[o] > trial.limit_m or turned[o] > trial.limit_deg)
    return Movement(
        max(moved.values(), default=0.0), max(turned.values(), default=0.0), tuple(sorted(fallen))
    )


def verdict(movements: Sequence[Movement], trial: Trial) -> Stability:
    """What the settings of a trial showed together."""
    return Stability(
        fallen=tuple(sorted({order for one in movements for order in one.fallen})),
        moved_m=max((one.moved_m for one in movements), default=0.0),
        turned_deg=max((one.turned_deg for one in movements), default=0.0),
        agreed=len({one.fallen for one in movements}) <= 1,
        trial=trial,
    )
