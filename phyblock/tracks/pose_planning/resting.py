"""Where blocks came to lie, kept as what each step moved; and the worlds that follow from it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from phyblock.domain import Block, Euler
from phyblock.sim.engine import Pose
from phyblock.sim.geometry import center_cm, origin_m

__all__ = ["Rest", "rests_of", "worlds_of"]

_STILL_M, _STILL_DEG = 0.001, 1.0
"""Within these, what was said of a block before is still true."""
_DIGITS = 2


@dataclass(frozen=True)
class Rest:
    """Where the block of a step, from 1, came to lie: the middle of its box [cm], its rotation."""

    step: int
    center_cm: tuple[float, float, float]
    euler_deg: Euler


def rests_of(
    put: Sequence[Block | None], worlds: Sequence[Sequence[Block]]
) -> tuple[tuple[Rest, ...], ...]:
    """For each step the blocks that lie elsewhere after it than before, its own than where it was
    put, by more than 1 mm or 1 degree.

    `worlds` are the blocks after each step, with the numbers of their steps as orders.
    """
    return tuple(_moved(put, worlds))


def _moved(
    put: Sequence[Block | None], worlds: Sequence[Sequence[Block]]
) -> Iterator[tuple[Rest, ...]]:
    known = {number: block for number, block in enumerate(put, 1) if block is not None}
    for world in worlds:
        moved = [block for block in world if not _is_still(known[block.order], block)]
        known |= {block.order: block for block in moved}
        yield tuple(_rest(block) for block in moved)


def worlds_of(
    put: Sequence[Block | None], stays: Sequence[bool], rests: Sequence[Sequence[Rest]]
) -> tuple[tuple[Block, ...], ...]:
    """The blocks after each step, to within 1 mm and 1 degree; `stays` says whose block was not
    refused.
    """
    lying: dict[int, Block] = {}
    worlds = []
    for number, (block, is_put, moved) in enumerate(zip(put, stays, rests, strict=True), 1):
        if block is not None and is_put:
            lying[number] = replace(block, order=number)
        for rest in moved:
            lying[rest.step] = _lying(lying[rest.step], rest)
        worlds.append(tuple(lying.values()))
    return tuple(worlds)


def _is_still(before: Block, after: Block) -> bool:
    start, end = Pose.goal(before), Pose.goal(after)
    return start.distance_m(end) <= _STILL_M and start.angle_deg(end) <= _STILL_DEG


def _rest(block: Block) -> Rest:
    x, y, z = (round(part, _DIGITS) + 0.0 for part in center_cm(block))
    return Rest(block.order, (x, y, z), block.euler_deg)


def _lying(block: Block, rest: Rest) -> Block:
    place = origin_m(block.type, rest.euler_deg, rest.center_cm)
    return replace(block, position_m=place, euler_deg=rest.euler_deg)
