"""Structures whose balance is worth a question, and what statics and simulation say of them.

The structures of the data set are built so that they stand at every step; few of their blocks
rest on more than they need, and none is held by a weight. A bench is a flat top with a plank to lay
on it, off its middle as likely as not, and weights on that: a balance, or a cantilever held by one.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from phyblock.domain.blocks import COLORS, SHAPES, BlockType, Euler
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.base import Floats, pick
from phyblock.sim.balance import MARGIN_M, is_balanced, surely_falls, surely_stands
from phyblock.sim.contact import (
    GROUND,
    bounds_m,
    drop_height_m,
    find_overlaps,
    support_graph,
)
from phyblock.sim.dynamics import groups
from phyblock.sim.geometry import corners_m
from phyblock.sim.outcomes import holds

SPARE_M = 0.0005
"""Further than the margin of statics a lever decides, as positions are rounded [m]."""
UNIT_M = 0.0125
"""The step of places along a plank [m]."""
_MOST_LEFT_OUT = 5
_FLAT_M, _LEAST_TOP_M, _HIGHEST_M = 0.0005, 0.045, 0.2
_PLANKS: tuple[BlockType, ...] = ("cuboid3", "cuboid3", "cuboid2")
_FLAT: Euler = (0.0, 0.0, 0.0)
WEIGHTS: tuple[tuple[BlockType, Euler], ...] = (
    *(("cube", _FLAT), ("cylinder", _FLAT), ("cuboid2", (0.0, 90.0, 0.0))),
    *(("cuboid2", (0.0, 0.0, 90.0)), ("cuboid3", (0.0, 90.0, 0.0))),
)
THIN_M, WIDE_M, _PILLAR_OFF_M = 0.025, 0.05, 0.0125
"""Thickness of pillars [m], and how far off the middle of a top thin ones stand."""
_LIFT_M, _DIRECTIONS = 0.6, 8


class Bench(NamedTuple):
    """A structure nearly done, with loose blocks to lay along one line over a flat top of it.

    The first loose block is the plank that lies on the top, the others lie on the plank. `reach_m`
    is half the length of the top along the line; `lengths_m` are those of the loose blocks.
    """

    base: tuple[Block, ...]
    top: Block
    along: int
    loose: tuple[Block, ...]
    reach_m: float
    lengths_m: Floats
    masses_kg: Floats

    def laid(self, offs_m: Sequence[float]) -> tuple[Block, ...] | None:
        """Return all blocks, the loose ones so far off the middle of the top [m]; None where they
        overlap.
        """
        middle, blocks = bounds_m(self.top).mean(axis=0), self.base
        for block, off_m in zip(self.loose, offs_m, strict=True):
            x, y = (float(middle[i]) + (off_m if i == self.along else 0.0) for i in (0, 1))
            onto = blocks[len(self.base) :][:1] or [self.top]
            blocks = (*blocks, lowered(block, onto, x, y))
        return None if find_overlaps(blocks) else blocks

    @property
    def limits_m(self) -> tuple[float, float]:
        """So far off the middle [m] weights may lean and surely stay; from so far on they fall."""
        return self.reach_m - MARGIN_M - SPARE_M, self.reach_m + MARGIN_M + SPARE_M

    @property
    def middle_m(self) -> float:
        """Distance of the middle of the structure from that of the top, along the line [m]."""
        ends = np.array([bounds_m(block)[:, self.along] for block in self.base])
        top = bounds_m(self.top)[:, self.along]
        return float((ends.min() + ends.max()) / 2 - top.mean())

    def plans_m(self, count: int, rng: np.random.Generator) -> Floats:
        """Return places for the loose blocks, off the middle of the top, (plans, blocks) [m].

        These are drawn so often, and left out where two weights are in one place.
        """
        half = int(self.lengths_m[0] / UNIT_M / 2)
        steps = rng.integers(1 - half, half, size=(count, len(self.loose)))
        plans: Floats = steps.astype(np.float64) * UNIT_M
        plans[:, 1:] += plans[:, :1]
        if len(self.loose) > 2:
            plans = plans[np.ptp(plans[:, 1:], axis=1) >= self.lengths_m[1:].mean() + SPARE_M]
        return plans

    def leans_m(self, plans_m: Floats) -> Floats:
        """Return how far off the middle of the top the weight is, by the plan [m]."""
        leans: Floats = plans_m @ self.masses_kg / self.masses_kg.sum()
        return leans


def stage(scene: Scene, rng: np.random.Generator) -> tuple[Block, ...]:
    """Return a scene nearly done, in an order that its dependencies allow."""
    order = scene.graph.random_order(rng)
    kept = len(order) - int(rng.integers(min(_MOST_LEFT_OUT, max(len(order) - 2, 0)) + 1))
    return tuple(scene.blocks[vertex] for vertex in sorted(order[:kept]))


def free_tops(blocks: Sequence[Block]) -> list[Block]:
    """Return the blocks with a flat top on which nothing rests."""
    carrying = {order for block in blocks for order in block.depend}
    return [block for block in blocks if block.order not in carrying and _is_flat(block)]


def bench(
    base: tuple[Block, ...],
    top: Block,
    weights: int,
    pillar_m: float,
    first: int,
    rng: np.random.Generator,
) -> Bench:
    """Return a bench on a top, with a plank and so many weights, whose orders begin with `first`.

    Where a pillar is asked for, of a thickness above 0, the plank lies on that.
    """
    along = int(rng.integers(2))
    if pillar_m:
        block_type, turned = pick(rng, pillars(along, pillar_m))
        pillar = Block(first, block_type, pick(rng, COLORS), (0.0, 0.0, 0.0), turned, (), 1)
        at = bounds_m(top).mean(axis=0)[:2]
        at[along] += int(rng.integers(-1, 2)) * _PILLAR_OFF_M * (pillar_m < WIDE_M)
        top, first = lowered(pillar, base, *at.tolist()), first + 1
        base = (*base, top)
    low, high = bounds_m(top)
    kinds = [(pick(rng, _PLANKS), _FLAT), *(pick(rng, WEIGHTS) for _ in range(weights))]
    loose = tuple(
        Block(first + i, block_type, pick(rng, COLORS), (0.0, 0.0, float(high[2])), turned, (), 1)
        for i, (block_type, (roll, pitch, yaw)) in enumerate(kinds)
        for turned in [(roll, pitch, (yaw + 90.0 * along) % 180.0)]
    )
    lengths = np.array([float(np.diff(bounds_m(block), axis=0)[0, along]) for block in loose])
    masses = np.array([SHAPES[block.type].mass_kg for block in loose])
    return Bench(base, top, along, loose, float(high[along] - low[along]) / 2, lengths, masses)


@functools.cache
def pillars(along: int, thick_m: float) -> list[tuple[BlockType, Euler]]:
    """Return blocks to lay a plank on, with their poses, so thick along an axis."""
    return [
        (block_type, euler)
        for block_type in ("cuboid1", "cuboid2")
        for euler in SHAPES[block_type].poses.values()
        if abs(np.ptp(corners_m(block_type, (0.0, 0.0, 0.0), euler)[:, along]) - thick_m) < _FLAT_M
    ]


def _is_flat(block: Block) -> bool:
    """True if a block has a flat top, square to the axes and not too high."""
    corners = corners_m(block.type, block.position_m, block.euler_deg)
    highest = float(corners[:, 2].max())
    top = corners[corners[:, 2] > highest - _FLAT_M, :2]
    is_wide = bool(np.ptp(top, axis=0).min() >= _LEAST_TOP_M)
    return is_square(block) and is_wide and highest <= _HIGHEST_M


def is_square(block: Block) -> bool:
    """True if the sides of a block are square to the axes."""
    return all(abs(angle % 90.0) < 1e-6 for angle in block.euler_deg)


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


def lots_of(blocks: Sequence[Block]) -> list[list[Block]]:
    """Return the blocks in lots; of every block of a lot of several, one rests on it or is below
    it. Blocks that only touch side by side are of different lots: one may fall without the other.
    """
    lots: list[set[int]] = []
    for order, below in support_graph(blocks).items():
        lot = ({order} | below) - {GROUND}
        lot = lot.union(*(other for other in lots if other & lot))
        lots = [other for other in lots if not other & lot] + [lot]
    return [[block for block in blocks if block.order in lot] for lot in lots]


def is_sure(left: Sequence[Block], moved: Collection[int]) -> bool:
    """True if blocks just left to themselves surely do what a simulation says.

    Those that stay stand without those that go, and each lot of those that go cannot be borne
    by those that stay: with every weight 5 mm off to any side, other masses, and friction to spare.
    """
    still = [block for block in left if block.order not in moved]
    falling = lots_of([block for block in left if block.order in moved])
    return all(surely_stands(group) for group in groups(still)) and all(
        surely_falls([*still, *lot]) for lot in falling
    )
