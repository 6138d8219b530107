"""Structures whose balance is worth a question, and what statics and simulation say of them.

The structures of the data set are built so that they stand at every step; few of their blocks
rest on more than they need, and none is held by a weight. An annex is a plank laid on a flat top,
off its middle as likely as not, with weights on it: a balance, or a cantilever held by one.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
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

_UNIT_M = 0.0125
_TRIED, _PLANS_TRIED, _MOST_LEFT_OUT = 16, 60, 5
_FLAT_M, _LEAST_TOP_M, _HIGHEST_M = 0.0005, 0.045, 0.2
_PLANKS: tuple[BlockType, ...] = ("cuboid3", "cuboid3", "cuboid2")
_FLAT: Euler = (0.0, 0.0, 0.0)
_WEIGHTS: tuple[tuple[BlockType, Euler], ...] = (
    *(("cube", _FLAT), ("cube", _FLAT), ("cuboid1", _FLAT), ("cylinder", _FLAT)),
    *(("cuboid2", (0.0, 90.0, 0.0)), ("cuboid2", (0.0, 0.0, 90.0))),
)
_LIFT_M, _DIRECTIONS = 0.6, 8


Ways = Mapping[tuple[bool, int], Sequence[tuple[Block, ...]]]
"""Blocks, by whether all stays, and by the side to which the plank is off the middle, -1 or 1."""


def with_annex(scene: Scene, rng: np.random.Generator) -> tuple[Block, ...] | None:
    """Return a structure nearly done with a plank and weights on one of its tops, or None.

    Nothing overlaps or hangs free, and all is in balance. Blocks that are not of the scene have
    orders above its own.
    """
    for _ in range(_TRIED):
        ways = arrangements(scene, rng, 1)[1]
        for blocks in ways.get((True, 0), ()):
            if is_balanced(blocks):
                return blocks
    return None


def arrangements(
    scene: Scene, rng: np.random.Generator, most: int, *, is_even: bool = False
) -> tuple[tuple[Block, ...], Ways]:
    """Return a structure nearly done, and ways of laying a plank with two weights on one of its
    tops: at most so many of each sort.

    All ways are of the same blocks along the same line; a lever decides, with a margin. Where they
    shall be even, the plank is off the middle as far in each; else its side is not told (0).
    """
    order = scene.graph.random_order(rng)
    kept = len(order) - int(rng.integers(min(_MOST_LEFT_OUT, max(len(order) - 2, 0)) + 1))
    base = tuple(scene.blocks[vertex] for vertex in sorted(order[:kept]))
    carrying = {order for block in base for order in block.depend}
    tops = [block for block in base if block.order not in carrying and _is_flat(block)]
    found: dict[tuple[bool, int], list[tuple[Block, ...]]] = defaultdict(list)
    if not tops:
        return base, found
    top, along, first = pick(rng, tops), int(rng.integers(2)), max(b.order for b in scene.blocks)
    low, high = bounds_m(top)
    middle, reach_m = (low + high) / 2, float(high[along] - low[along]) / 2
    kinds = [(pick(rng, _PLANKS), _FLAT), pick(rng, _WEIGHTS), pick(rng, _WEIGHTS)]
    masses = [SHAPES[block_type].mass_kg for block_type, _ in kinds]
    half = round(SHAPES[kinds[0][0]].sides_m[0] / _UNIT_M / 2)
    loose = [
        Block(first + i, block_type, pick(rng, COLORS), (0.0, 0.0, float(high[2])), turned, (), 1)
        for i, (block_type, (roll, pitch, yaw)) in enumerate(kinds, 1)
        for turned in [(roll, pitch, (yaw + 90.0 * along) % 180.0)]
    ]
    over = 0
    for _ in range(_PLANS_TRIED):
        off, *steps = rng.integers(1 - half, half, size=len(loose)).tolist()
        if is_even:
            over = over or abs(off)
            off = over if off > 0 else -over
        offs_m = _UNIT_M * np.array([off, *(off + step for step in steps)])
        lean_m = abs(float(np.average(offs_m, weights=masses)))
        stays = lean_m <= reach_m - MARGIN_M
        sort = (stays, int(np.sign(off)) if is_even else 0)
        if (not stays and lean_m <= reach_m + MARGIN_M) or len(found[sort]) == most:
            continue
        blocks = base
        for block, off_m in zip(loose, offs_m.tolist(), strict=True):
            x, y = (float(middle[i]) + (off_m if i == along else 0.0) for i in (0, 1))
            blocks = (*blocks, lowered(block, blocks[len(base) :][:1] or [top], x, y))
        if not find_overlaps(blocks) and not find_gaps(blocks):
            found[sort].append(blocks)
    return base, found


def _is_flat(block: Block) -> bool:
    """True if a block has a flat top, square to the axes and not too high."""
    corners = corners_m(block.type, block.position_m, block.euler_deg)
    highest = float(corners[:, 2].max())
    top = corners[corners[:, 2] > highest - _FLAT_M, :2]
    is_square = all(abs(angle % 90.0) < 1e-6 for angle in block.euler_deg)
    is_wide = bool(np.ptp(top, axis=0).min() >= _LEAST_TOP_M)
    return is_square and is_wide and highest <= _HIGHEST_M


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


def lowered_round(put: Block, onto: Sequence[Block], radius_m: float) -> Iterator[Block]:
    """Yield the block let down anew all round, so far off [m] in eight directions."""
    x, y, _ = bounds_m(put).mean(axis=0).tolist()
    for number in range(_DIRECTIONS):
        angle = 2 * math.pi * number / _DIRECTIONS
        yield lowered(put, onto, x + radius_m * math.cos(angle), y + radius_m * math.sin(angle))


def stays_round(put: Block, onto: Sequence[Block], radius_m: float) -> bool | None:
    """True if by statics a block let down stays, and likewise all round; None where unsure."""
    stays = surely_stays((*onto, put), put.order)
    is_alike = stays is not None and all(
        is_balanced(group_of((*onto, moved), moved.order)) is stays
        for moved in lowered_round(put, onto, radius_m)
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
