"""Structures whose balance is worth a question, and what statics and simulation say of them.

The structures of the data set are built so that they stand at every step; few of their blocks
rest on more than they need, and none is held by a weight. An annex is a plank laid on a flat top,
off its middle as likely as not, with weights on it and perhaps a column under its free end: drawn
at random, it is a balance, a cantilever with a counterweight, or a bridge with a support too many.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import COLORS, SHAPES, BlockType, Euler
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.base import pick
from phyblock.sim.balance import MARGIN_M, is_balanced, surely_falls, surely_stands
from phyblock.sim.contact import bounds_m, drop_height_m, find_gaps, find_overlaps
from phyblock.sim.dynamics import groups
from phyblock.sim.geometry import corners_m
from phyblock.sim.outcomes import holds
from phyblock.stable import plain_sum

_UNIT_M = 0.0125
_TRIED, _PLANS_TRIED, _MOST_LEFT_OUT, _MOST_WEIGHTS = 16, 60, 5, 3
_FLAT_M, _LEAST_TOP_M, _HIGHEST_M = 0.0005, 0.045, 0.2
_PROPPED = 0.4
_PLANKS: tuple[BlockType, ...] = ("cuboid3", "cuboid3", "cuboid2")
_FLAT: Euler = (0.0, 0.0, 0.0)
_WEIGHTS: tuple[tuple[BlockType, Euler], ...] = (
    *(("cube", _FLAT), ("cube", _FLAT), ("cuboid1", _FLAT), ("cylinder", _FLAT)),
    *(("cuboid2", (0.0, 90.0, 0.0)), ("cuboid2", (0.0, 0.0, 90.0))),
)
_PIECES: tuple[BlockType, ...] = ("cylinder", "cube", "cuboid1")
_LIFT_M, _DIRECTIONS = 0.6, 8


def with_annex(scene: Scene, rng: np.random.Generator) -> tuple[Block, ...] | None:
    """Return a structure nearly done, and a few blocks more on one of its tops, or None.

    Nothing overlaps or hangs free, and all is in balance. Blocks that are not of the scene have
    orders above its own.
    """
    for _ in range(_TRIED):
        order = scene.graph.random_order(rng)
        kept = len(order) - int(rng.integers(min(_MOST_LEFT_OUT, len(order) - 1) + 1))
        base = tuple(scene.blocks[vertex] for vertex in sorted(order[:kept]))
        carrying = {order for block in base for order in block.depend}
        tops = [block for block in base if block.order not in carrying and _is_flat(block)]
        if not tops:
            continue
        first = max(block.order for block in scene.blocks) + 1
        added = _annex(pick(rng, tops), rng)
        blocks = (*base, *(replace(block, order=first + i) for i, block in enumerate(added)))
        is_sound = added and not find_overlaps(blocks) and not find_gaps(blocks)
        if is_sound and is_balanced(blocks):
            return blocks
    return None


def _is_flat(block: Block) -> bool:
    """True if a block has a flat top, square to the axes and not too high."""
    corners = corners_m(block.type, block.position_m, block.euler_deg)
    highest = float(corners[:, 2].max())
    top = corners[corners[:, 2] > highest - _FLAT_M, :2]
    is_square = all(abs(angle % 90.0) < 1e-6 for angle in block.euler_deg)
    is_wide = bool(np.ptp(top, axis=0).min() >= _LEAST_TOP_M)
    return is_square and is_wide and highest <= _HIGHEST_M


def _annex(top: Block, rng: np.random.Generator) -> list[Block]:
    """Return a plank along x or y on a top, and weights on it of which one at least is needed.

    Or with a column under one end, where the weights may be any.
    """
    along = int(rng.integers(2))
    low, high = bounds_m(top)
    middle, reach_m = (low + high) / 2, float(high[along] - low[along]) / 2

    def put(block_type: BlockType, euler_deg: Euler, steps: int, onto: Sequence[Block]) -> Block:
        roll, pitch, yaw = euler_deg
        turned = (roll, pitch, (yaw + 90.0 * along) % 180.0)
        block = Block(0, block_type, pick(rng, COLORS), (0.0, 0.0, float(high[2])), turned, (), 1)
        x, y = (float(middle[i]) + (_UNIT_M * steps if i == along else 0.0) for i in (0, 1))
        return lowered(block, onto, x, y)

    def leans_m(blocks: Sequence[Block]) -> float:
        """Return how far the blocks' center is from the middle of the top, along the plank."""
        masses = [SHAPES[block.type].mass_kg for block in blocks]
        offs = [float(bounds_m(block).mean(axis=0)[along] - middle[along]) for block in blocks]
        return abs(plain_sum(m * x for m, x in zip(masses, offs, strict=True)) / plain_sum(masses))

    is_propped = rng.random() < _PROPPED
    for _ in range(_PLANS_TRIED):
        kind = pick(rng, _PLANKS)
        half = round(SHAPES[kind].sides_m[0] / _UNIT_M / 2)
        off = int(rng.integers(-half, half + 1))
        plank = put(kind, _FLAT, off, [top])
        weights = [
            put(*pick(rng, _WEIGHTS), off + int(rng.integers(2 - half, half - 1)), [plank])
            for _ in range(int(rng.integers(_MOST_WEIGHTS + 1)))
        ]
        every = [plank, *weights]
        if is_propped:
            return [*every, *_column(plank, put, off + (half - 2 if off > 0 else 2 - half))]
        fewer = ([one for one in every if one is not weight] for weight in weights)
        is_needed = any(leans_m(some) > reach_m + MARGIN_M for some in fewer)
        if is_needed and leans_m(every) <= reach_m - MARGIN_M:
            return every
    return []


def _column(plank: Block, put: Callable[..., Block], steps: int) -> list[Block]:
    """Return pieces from the floor up to a plank; they overlap it or leave a gap where none fit."""
    column: list[Block] = []
    left_m = float(bounds_m(plank)[0, 2])
    for piece in _PIECES:
        while left_m >= SHAPES[piece].sides_m[2] - _FLAT_M:
            column.append(put(piece, _FLAT, steps, column))
            left_m -= SHAPES[piece].sides_m[2]
    return column


def lowered(block: Block, onto: Sequence[Block], x_m: float, y_m: float) -> Block:
    """Return the block let down, as it is turned, with the middle of its outline over (x, y) [m].

    It stops where it first touches one of the blocks, or the floor.
    """
    middle = bounds_m(block).mean(axis=0)
    x = round(block.position_m[0] + x_m - float(middle[0]), 6)
    y = round(block.position_m[1] + y_m - float(middle[1]), 6)
    lifted = replace(block, position_m=(x, y, block.position_m[2] + _LIFT_M))
    fall = drop_height_m(lifted, onto)
    return replace(lifted, position_m=(x, y, round(lifted.position_m[2] - fall, 6)))


def lowered_round(put: Block, onto: Sequence[Block], rings_m: Sequence[float]) -> Iterator[Block]:
    """Yield the block let down anew all round, in eight directions for each ring [m]."""
    x, y, _ = bounds_m(put).mean(axis=0).tolist()
    for radius_m in rings_m:
        for number in range(_DIRECTIONS):
            angle = 2 * math.pi * number / _DIRECTIONS
            at = (x + radius_m * math.cos(angle), y + radius_m * math.sin(angle))
            yield lowered(put, onto, *at)


def stays_round(put: Block, onto: Sequence[Block], rings_m: Sequence[float]) -> bool | None:
    """True if by statics a block let down stays, and likewise all round; None where unsure."""
    stays = surely_stays((*onto, put), put.order)
    is_alike = stays is not None and all(
        is_balanced(group_of((*onto, moved), moved.order)) is stays
        for moved in lowered_round(put, onto, rings_m)
    )
    return stays if is_alike else None


def surely_stays(blocks: Sequence[Block], order: int) -> bool | None:
    """True if by statics one of the blocks and all that touches it stay; None where unsure."""
    group = group_of(blocks, order)
    if is_balanced(group):
        return True if surely_stands(group) else None
    return False if surely_falls(group) else None


def verdict(blocks: Sequence[Block], order: int) -> bool | None:
    """True if all stay; None where statics leave a doubt or settings of a simulation disagree."""
    stays = surely_stays(blocks, order)
    return stays if stays is not None and holds(blocks, order) is stays else None


def group_of(blocks: Sequence[Block], order: int) -> tuple[Block, ...]:
    """Return the blocks in reach of one, itself among them."""
    return next(group for group in groups(blocks) if any(b.order == order for b in group))


def is_sure(left: Sequence[Block], moved: Collection[int]) -> bool:
    """True if blocks just left to themselves surely do what a simulation says.

    Those that stay stand without those that go, and each lot of those that go cannot be borne
    by those that stay: with every weight 5 mm off to any side, other masses, and friction to spare.
    """
    still = [block for block in left if block.order not in moved]
    falling = groups([block for block in left if block.order in moved])
    return all(surely_stands(group) for group in groups(still)) and all(
        surely_falls([*still, *lot]) for lot in falling
    )
