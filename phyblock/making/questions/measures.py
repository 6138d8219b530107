"""Lengths, places and angles of blocks as they stand."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import SHAPES, BlockType, Euler, orientation_class
from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block
from phyblock.making.questions.picture_view import (
    COUNTED,
    NAMED,
    View,
    center_m,
    picture_axes,
    shares,
)
from phyblock.making.questions.question_draft import UnfairError
from phyblock.sim.contact import GROUND, bounds_m, boxes_near, support_graph, whole_bounds_m

_STEP_DEG = 15
_SAME = 1e-4


def height_m(block: Block) -> float:
    """From a block's lowest to its highest point [m]."""
    low, high = bounds_m(block)[:, 2]
    return float(high - low)


def top_m(block: Block) -> float:
    """Height of a block's highest point above the ground [m]."""
    return float(bounds_m(block)[1, 2])


def length_m(block: Block) -> float:
    """Length of the longest side of the box that a block fits in, however it lies [m]."""
    shape = SHAPES[block.type]
    return max(high - low for low, high in zip(shape.low_m, shape.high_m, strict=True))


def volume_m3(block: Block) -> float:
    """Volume of the solid [m3]."""
    return SHAPES[block.type].volume_m3


def offset_m(block: Block, other: Block, view: View) -> NDArray[np.float64]:
    """From `other` to `block`: to the right of the picture, away from the viewer, up [m], (3,)."""
    right, away = picture_axes(view)
    step = center_m(block) - center_m(other)
    return np.array([step @ right, step @ away, step[2]])


def vertical_turns_deg(block: Block, other: Block) -> tuple[int, ...]:
    """Turns about the vertical, -165 to 180 degrees, that take `other` to how `block` is oriented.

    In steps of 15 degrees, the least first, counterclockwise seen from above when positive; none
    when the two are of different types, or one has to be tipped over as well. Up to the blocks'
    own symmetry: orientations count as equal when no one can tell them apart.
    """
    if block.type != other.type:
        return ()
    return _turns_deg(block.type, block.euler_deg, other.euler_deg)


@functools.lru_cache(maxsize=4096)
def _turns_deg(block_type: BlockType, euler_deg: Euler, other_deg: Euler) -> tuple[int, ...]:
    wanted = np.array(orientation_class(block_type, euler_deg))
    roll, pitch, yaw = other_deg
    turns = sorted(range(-180 + _STEP_DEG, 181, _STEP_DEG), key=lambda turn: (abs(turn), -turn))
    distinct = []
    for turn in turns:
        turned = orientation_class(block_type, (roll, pitch, _yaw_deg(yaw, turn)))
        if np.abs(wanted - np.array(turned)).max() < _SAME:
            distinct.append(turn)
    return tuple(distinct)


def turned_about_vertical(block: Block, angle_deg: float) -> Block:
    """The block turned about the vertical line through the middle of its bounding box."""
    about = center_m(block)
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    x, y, z = (about + turn @ (np.array(block.position_m) - about)).tolist()
    roll, pitch, yaw = block.euler_deg
    euler_deg = (roll, pitch, _yaw_deg(yaw, angle_deg))
    return replace(block, position_m=(round(x, 6), round(y, 6), round(z, 6)), euler_deg=euler_deg)


def _yaw_deg(yaw_deg: float, turn_deg: float) -> float:
    return round((yaw_deg + turn_deg) % 360, 6)


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


_WEDGED_M = 0.005


def layers_of(blocks: Sequence[Block]) -> Mapping[int, int]:
    """The layer of each block, by order: one more than that of the highest block it rests on.

    UnfairError where that is not what the picture tells: a block that is wedged between two
    slopes rests on them, and yet it looks as if it were beside them.
    """
    below = support_graph(blocks)
    top = {block.order: bounds_m(block)[1, 2] for block in blocks} | {GROUND: 0.0}
    bottom = {block.order: bounds_m(block)[0, 2] for block in blocks}
    plain = {
        order: {other for other in others if bottom[order] > top[other] - _WEDGED_M} or {GROUND}
        for order, others in below.items()
    }
    counted = _longest(below)
    if counted != _longest(plain):
        raise UnfairError("some block rests on others and stands lower than they reach")
    return counted


def _longest(below: Mapping[int, Collection[int]]) -> dict[int, int]:
    layer = {GROUND: 0}
    while len(layer) <= len(below):
        ready = [o for o in below if o not in layer and below[o] and set(below[o]) <= layer.keys()]
        if not ready:
            raise UnfairError("some block rests on nothing, or on itself")
        layer.update({order: 1 + max(layer[other] for other in below[order]) for order in ready})
    return {order: number for order, number in layer.items() if order != GROUND}


def sure_blocks(picture: QuestionPicture) -> int:
    """How many blocks there have to be at the least, going by what the picture shows.

    Every block shows at least `COUNTED` of itself, but one at the most that shows less. That
    one is sure to be there, whatever it is, where a block that shows `NAMED` of itself rests on it
    alone: without it, that block would float. One is enough, for one is there. UnfairError where
    more are hidden, or nothing tells of it.
    """
    seen = shares(picture)
    hidden = [order for order, share in seen.items() if share < COUNTED]
    if len(hidden) > 1:
        raise UnfairError("several blocks are hidden")
    below = support_graph(picture.blocks)
    for order in hidden:
        if not any(seen[o] >= NAMED and below[o] == {order} for o in below):
            raise UnfairError(f"nothing that can be seen rests on block {order} alone")
    return len(picture.blocks)


_CLEAR_M = 0.02
_STEP_M = 0.01


def put_beside(block: Block, blocks: Sequence[Block], rng: np.random.Generator) -> Block:
    """The block, as it is oriented, on the ground in a direction drawn from the blocks' middle.

    It gets an order that none of them has, and stands as near to them as leaves 2 cm free.
    """
    low, high = whole_bounds_m(blocks)
    middle = (low + high) / 2
    angle = float(rng.uniform(0, 2 * math.pi))
    direction = np.array([math.cos(angle), math.sin(angle)])
    loose = replace(block, order=max(b.order for b in blocks) + 1, depend=(), layer=1)
    distance = 0.0
    while True:
        placed = _at(loose, middle[:2] + distance * direction)
        near = (boxes_near(bounds_m(placed), bounds_m(other), _CLEAR_M) for other in blocks)
        if not any(near):
            return placed
        distance += _STEP_M


def _at(block: Block, place_m: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Block:
    """The block with the middle of its box over a place (2,) [m] of the ground, on the ground."""
    box = bounds_m(block)
    step = np.array([*(place_m - box.mean(axis=0)[:2]), -box[0, 2]])
    x, y, z = (round(float(part), 4) for part in np.array(block.position_m) + step)
    return replace(block, position_m=(x, y, z))
