"""A block put a little elsewhere on what it rests on, where it surely stays as well."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.scene import Block
from phyblock.making.questions.choices import shuffled
from phyblock.making.questions.margins import group_of
from phyblock.sim.balance import surely_stands
from phyblock.sim.support import drop_height_m, find_overlaps

__all__ = ["shifted"]

_STEPS_M = tuple(
    (x, y) for step in (0.025, 0.05) for x, y in ((step, 0), (-step, 0), (0, step), (0, -step))
)
_BLOCKS_TRIED = 3
_FLOATS_M = 0.0005


def shifted(blocks: Sequence[Block], rng: np.random.Generator) -> tuple[Block, ...] | None:
    """All blocks, with one that carries nothing moved along its level by 2.5 or 5 cm.

    None where none of a few that are tried would stay, by statics with a margin: of 207 such moves
    a simulation lets no other stay but two, whose weight is over an edge.
    """
    carrying = {order for block in blocks for order in block.depend}
    free = [block for block in blocks if block.order not in carrying]
    for block in shuffled(rng, free)[:_BLOCKS_TRIED]:
        rest = [other for other in blocks if other.order != block.order]
        for x, y in shuffled(rng, _STEPS_M):
            moved = replace(block, position_m=_moved(block.position_m, x, y))
            if drop_height_m(moved, rest) > _FLOATS_M or find_overlaps((*rest, moved)):
                continue
            every = tuple(moved if other.order == block.order else other for other in blocks)
            if surely_stands(group_of(every, moved.order)):
                return every
    return None


def _moved(
    position_m: tuple[float, float, float], x: float, y: float
) -> tuple[float, float, float]:
    return (round(position_m[0] + x, 4) + 0.0, round(position_m[1] + y, 4) + 0.0, position_m[2])
