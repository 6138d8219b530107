"""Does it stand? Stability of a state, of every step of an order, and of what a removal leaves.

A verdict is only as good as the settings it was reached at, so every result carries them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from phyblock.domain.scene import Block
from phyblock.sim.world import Physics, Pose, World

__all__ = ["DEFAULT_TRIAL", "Stability", "Trial", "check", "check_prefixes", "check_removal"]


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


def check(blocks: Sequence[Block], trial: Trial = DEFAULT_TRIAL) -> Stability:
    """Let blocks go at their goal poses and see which of them stay."""
    verdicts: list[frozenset[int]] = []
    moved_m = turned_deg = 0.0
    for physics in trial.physics:
        fallen: set[int] = set()
        for order, distance_m, angle_deg in _movements(blocks, physics, trial.duration_s):
            moved_m, turned_deg = max(moved_m, distance_m), max(turned_deg, angle_deg)
            if distance_m > trial.limit_m or angle_deg > trial.limit_deg:
                fallen.add(order)
        verdicts.append(frozenset(fallen))
    union = frozenset[int]().union(*verdicts)
    return Stability(tuple(sorted(union)), moved_m, turned_deg, len(set(verdicts)) <= 1, trial)


def check_prefixes(blocks: Sequence[Block], trial: Trial = DEFAULT_TRIAL) -> tuple[Stability, ...]:
    """Stability after each step when blocks are placed in the order given; the last is the whole.

    Each state is tried afresh, every block at its goal pose, so that no step is judged by the
    drift of the ones before it.
    """
    return tuple(check(blocks[: count + 1], trial) for count in range(len(blocks)))


def check_removal(blocks: Sequence[Block], order: int, trial: Trial = DEFAULT_TRIAL) -> Stability:
    """Stability of what is left when the block with this order is taken away."""
    return check([block for block in blocks if block.order != order], trial)


def _movements(
    blocks: Sequence[Block], physics: Physics, duration_s: float
) -> Iterator[tuple[int, float, float]]:
    with World(physics) as world:
        world.place_all(blocks)
        world.step(duration_s)
        poses = world.poses()
    for block in blocks:
        goal = Pose.goal(block)
        yield block.order, poses[block.order].distance_m(goal), poses[block.order].angle_deg(goal)
