"""Lengths and places that can be counted on the grid that blocks stand on, in meters."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from phyblock.domain.blocks import SHAPES
from phyblock.domain.scene import Block
from phyblock.making.questions.block_measures import top_m
from phyblock.making.questions.picture_view import center_m
from phyblock.making.questions.question_draft import UnfairError
from phyblock.sim.support import bounds_m

__all__ = ["LENGTHS", "PAIRED", "along_and_across_m", "grid_cm", "length_axis", "require_joined"]

_SIDE_M = 0.001
_LONGER = 1.3
_EXACT_CM = 0.1


def length_axis(block: Block) -> int:
    """The level axis of the world (0 or 1) that a block's longest side runs along.

    UnfairError where it stands on end, stands askew, or no side is clearly the longest.
    """
    sides = np.diff(bounds_m(block), axis=0)[0]
    first, second = sorted(range(3), key=lambda axis: -sides[axis])[:2]
    if first == 2 or sides[first] < _LONGER * sides[second] or block.euler_deg[2] % 90:
        raise UnfairError("has no length that lies along the ground")
    return first


def along_and_across_m(one: Block, other: Block) -> tuple[float, float]:
    """How far the middle of `one` is from that of `other`, along and across its length."""
    axis = length_axis(other)
    step = np.abs(center_m(one) - center_m(other))
    return float(step[axis]), float(step[1 - axis])


def grid_cm(length_m: float) -> float:
    """The length in centimeters where it is a multiple of 2.5 cm; else UnfairError."""
    steps = round(length_m * 100 / 2.5)
    if abs(length_m * 100 - 2.5 * steps) > _EXACT_CM:
        raise UnfairError(f"{length_m * 100:.1f} cm is no multiple of 2.5 cm")
    return 2.5 * steps


def _top(one: Block, other: Block, blocks: Sequence[Block]) -> float:
    del other, blocks
    return top_m(one)


def _bottom(one: Block, other: Block, blocks: Sequence[Block]) -> float:
    del other, blocks
    return float(bounds_m(one)[0, 2])


def _apart(one: Block, other: Block, blocks: Sequence[Block]) -> float:
    x, y, _ = np.abs(center_m(one) - center_m(other)).tolist()
    if min(x, y) > _SIDE_M:
        raise UnfairError("the blocks stand askew, so that their distance cannot be counted")
    require_joined(one, other, blocks)
    return float(max(x, y))


def _rise(one: Block, other: Block, blocks: Sequence[Block]) -> float:
    del blocks
    return abs(top_m(one) - top_m(other))


def _gap(one: Block, other: Block, blocks: Sequence[Block]) -> float:
    """The clear way between two boxes that face each other, with nothing between them."""
    if any(not SHAPES[block.type].is_box or block.euler_deg[2] % 90 for block in (one, other)):
        raise UnfairError("the blocks do not face each other with flat sides")
    require_joined(one, other, blocks)
    low = np.minimum(bounds_m(one)[1], bounds_m(other)[1])
    high = np.maximum(bounds_m(one)[0], bounds_m(other)[0])
    open_axes = [axis for axis in (0, 1) if high[axis] - low[axis] > _SIDE_M]
    if len(open_axes) != 1 or any(
        low[axis] - high[axis] < 0.5 * np.diff(bounds_m(one), axis=0)[0, axis]
        for axis in range(3)
        if axis not in open_axes
    ):
        raise UnfairError("the blocks do not face each other")
    start, end = np.minimum(low, high) + _SIDE_M, np.maximum(low, high) - _SIDE_M
    for block in blocks:
        its_low, its_high = bounds_m(block)
        if block not in (one, other) and np.all(its_low < end) and np.all(its_high > start):
            raise UnfairError("another block stands in the gap")
    return float(high[open_axes[0]] - low[open_axes[0]])


LENGTHS: Mapping[str, Callable[[Block, Block, Sequence[Block]], float]] = {
    "top": _top,
    "bottom": _bottom,
    "apart": _apart,
    "rise": _rise,
    "gap": _gap,
}
"""By kind, of a block, another, and all blocks; UnfairError for what cannot be told."""
PAIRED = ("apart", "rise", "gap", "place")
"""Kinds that are asked of two blocks."""


def require_joined(one: Block, other: Block, blocks: Sequence[Block]) -> None:
    """UnfairError unless the two belong to one structure, by what rests on what."""
    reached, waiting = {one.order}, [one.order]
    while waiting:
        order = waiting.pop()
        touching = {b.order for b in blocks if order in b.depend}
        touching.update(*(b.depend for b in blocks if b.order == order))
        waiting += sorted(touching - reached)
        reached |= touching
    if other.order not in reached:
        raise UnfairError("the blocks are parts of structures that stand apart")
