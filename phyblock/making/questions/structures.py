"""Structures whose balance is worth a question, and what statics and simulation say of them.

The structures of the data set are built so that they stand at every step; few of their blocks
rest on more than they need, and none is held by a weight. An annex is a plank laid on a flat top,
off its middle as likely as not, with weights on it and perhaps a column under its free end: drawn
at random, it is a balance, a cantilever with a counterweight, or a bridge with a support too many.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from phyblock.domain.blocks import COLORS, SHAPES, BlockType, Euler
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.base import pick, shuffled
from phyblock.sim.balance import MARGIN_M, is_balanced, surely_falls, surely_stands
from phyblock.sim.contact import bounds_m, drop_height_m, find_gaps, find_overlaps
from phyblock.sim.dynamics import groups
from phyblock.sim.geometry import corners_m
from phyblock.sim.outcomes import holds
from phyblock.stable import plain_sum

_UNIT_M = 0.0125
_PLANK_M = 0.025
_CUBE_M = 0.05
_TRIED = 16
_PLANS_TRIED = 80
_MOST_LEFT_OUT = 5
_FLAT_M = 0.0005
_LEAST_TOP_M = 0.045
_HIGHEST_M = 0.2
_PROPPED = 0.4
_PLANKS: tuple[tuple[BlockType, float], ...] = (
    ("cuboid3", 0.15),
    ("cuboid3", 0.15),
    ("cuboid2", 0.1),
)
"""Types of planks and their lengths [m]."""


class _Weight(NamedTuple):
    """A block put on a plank: across it, half its width along the plank, half its height [m]."""

    type: BlockType
    euler_deg: Euler
    half_width_m: float
    half_height_m: float


_CUBE = _Weight("cube", (0.0, 0.0, 0.0), 0.025, 0.025)
_WEIGHTS = (
    _CUBE,
    _CUBE,
    _Weight("cuboid1", (0.0, 0.0, 0.0), 0.025, 0.0125),
    _Weight("cuboid2", (0.0, 90.0, 0.0), 0.0125, 0.05),
    _Weight("cuboid2", (0.0, 0.0, 90.0), 0.025, 0.0125),
    _Weight("cylinder", (0.0, 0.0, 0.0), 0.025, 0.05),
)
_COLUMN: tuple[tuple[BlockType, float], ...] = (
    ("cube", 0.05),
    ("cuboid1", 0.025),
    ("cylinder", 0.1),
)
"""Pieces of columns, and heights [m]."""


def with_annex(scene: Scene, rng: np.random.Generator) -> tuple[Block, ...] | None:
    """A structure nearly done, and a few blocks more on one of its tops; None where none fits.

    Nothing overlaps or hangs free. Blocks that are not of the scene have orders above its own.
    """
    for _ in range(_TRIED):
        order = scene.graph.random_order(rng)
        kept = len(order) - int(rng.integers(min(_MOST_LEFT_OUT, len(order) - 1) + 1))
        base = tuple(scene.blocks[vertex] for vertex in sorted(order[:kept]))
        tops = _free_tops(base)
        added = _drawn(scene, pick(rng, tops), rng) if tops else []
        blocks = (*base, *added)
        if added and not find_overlaps(blocks) and not find_gaps(blocks):
            return blocks
    return None


def _free_tops(blocks: Sequence[Block]) -> list[Block]:
    """Blocks with a flat top, square to the axes, that carries nothing."""
    carrying = {order for block in blocks for order in block.depend}

    def has_top(block: Block) -> bool:
        corners = corners_m(block.type, block.position_m, block.euler_deg)
        top = corners[corners[:, 2] > corners[:, 2].max() - _FLAT_M, :2]
        is_square = all(abs(angle % 90.0) < 1e-6 for angle in block.euler_deg)
        return is_square and bool(np.ptp(top, axis=0).min() >= _LEAST_TOP_M)

    return [block for block in blocks if block.order not in carrying and has_top(block)]


class _Plan(NamedTuple):
    """A plank, how far its middle is off that of the top along it [m], and what stands on it."""

    type: BlockType
    length_m: float
    off_m: float
    weights: list[tuple[float, _Weight]]
    is_propped: bool


def _drawn(scene: Scene, top: Block, rng: np.random.Generator) -> list[Block]:
    """A plank along x or y on a top, with weights or a column; none on one that is too high."""
    low, high = bounds_m(top)
    height_m, along = float(high[2]), int(rng.integers(2))
    plan = _planned(float(high[along] - low[along]) / 2, rng)
    if height_m > _HIGHEST_M or plan is None:
        return []
    middle = [round(float(one), 6) for one in (low + high) / 2]
    turn_deg = 90.0 * along
    order = max(block.order for block in scene.blocks) + 1
    blocks: list[Block] = []

    def put(block_type: BlockType, euler_deg: Euler, at_m: float, z_m: float) -> None:
        x, y = (round(place + (at_m if i == along else 0), 6) for i, place in enumerate(middle[:2]))
        number, color = order + len(blocks), pick(rng, COLORS)
        blocks.append(Block(number, block_type, color, (x, y, round(z_m, 6)), euler_deg, (), 1))

    put(plan.type, (0.0, 0.0, turn_deg), plan.off_m, height_m + _PLANK_M / 2)
    for at_m, weight in plan.weights:
        x, y, yaw = weight.euler_deg
        z_m = height_m + _PLANK_M + weight.half_height_m
        put(weight.type, (x, y, (yaw + turn_deg) % 180.0), plan.off_m + at_m, z_m)
    if plan.is_propped:
        side = -1.0 if plan.off_m < 0 else 1.0
        at_m, z_m = plan.off_m + side * (plan.length_m / 2 - _CUBE_M / 2), 0.0
        for block_type, piece_m in _column(height_m, rng):
            put(block_type, (0.0, 0.0, 0.0), at_m, z_m + piece_m / 2)
            z_m += piece_m
    return blocks


def _planned(half_m: float, rng: np.random.Generator) -> _Plan | None:
    """A plan whose balance hangs on something, for a top of that half width along the plank."""
    is_propped = rng.random() < _PROPPED
    for _ in range(_PLANS_TRIED):
        plank, length_m = pick(rng, _PLANKS)
        most = round((length_m / 2 + half_m - _CUBE_M / 2) / _UNIT_M)
        off_m = _UNIT_M * int(rng.integers(-most, most + 1))
        plan = _Plan(plank, length_m, off_m, _weights(length_m, rng), is_propped)
        is_far = abs(off_m) + length_m / 2 - _CUBE_M > half_m
        left = [[w for w in plan.weights if w is not one] for one in plan.weights]
        hangs = any(_leans_m(plan._replace(weights=some)) > half_m + MARGIN_M for some in left)
        if _leans_m(plan) <= half_m - MARGIN_M and (is_far if is_propped else hangs):
            return plan
    return None


def _leans_m(plan: _Plan) -> float:
    """Distance of the center of plank and weights from the middle of the top [m]."""
    loads = [(plan.off_m, SHAPES[plan.type].mass_kg)]
    loads += [(plan.off_m + at_m, SHAPES[w.type].mass_kg) for at_m, w in plan.weights]
    moment = plain_sum(at_m * mass for at_m, mass in loads)
    return abs(moment / plain_sum(mass for _, mass in loads))


def _weights(length_m: float, rng: np.random.Generator) -> list[tuple[float, _Weight]]:
    """None to three weights and where along the plank they stand, apart from one another."""
    chosen: list[tuple[float, _Weight]] = []
    for _ in range(int(rng.integers(4))):
        weight = pick(rng, _WEIGHTS)
        reach = round((length_m / 2 - weight.half_width_m) / _UNIT_M)
        at_m = _UNIT_M * int(rng.integers(-reach, reach + 1))
        if all(
            abs(at_m - other_m) >= weight.half_width_m + other.half_width_m
            for other_m, other in chosen
        ):
            chosen.append((at_m, weight))
    return chosen


def _column(height_m: float, rng: np.random.Generator) -> list[tuple[BlockType, float]]:
    """Pieces, from below, that make up a height; none where they cannot."""
    pieces: list[tuple[BlockType, float]] = []
    left_m = height_m
    while left_m > _FLAT_M:
        fitting = [piece for piece in shuffled(rng, _COLUMN) if piece[1] < left_m + _FLAT_M]
        if not fitting:
            return []
        pieces.append(fitting[0])
        left_m -= fitting[0][1]
    return pieces


_LIFT_M = 0.6
_DIRECTIONS = 8


def lowered(block: Block, onto: Sequence[Block], x_m: float, y_m: float) -> Block:
    """The block let down, as it is turned, with the middle of its outline over a place (x, y) [m].

    It stops where it first touches one of the blocks, or the floor.
    """
    middle = bounds_m(block).mean(axis=0)
    x = round(block.position_m[0] + x_m - float(middle[0]), 6)
    y = round(block.position_m[1] + y_m - float(middle[1]), 6)
    lifted = replace(block, position_m=(x, y, block.position_m[2] + _LIFT_M))
    fall = drop_height_m(lifted, onto)
    return replace(lifted, position_m=(x, y, round(lifted.position_m[2] - fall, 6)))


def lowered_round(put: Block, onto: Sequence[Block], rings_m: Sequence[float]) -> Iterator[Block]:
    """The block let down anew all round where it is, in eight directions for each ring [m]."""
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
    """The blocks in reach of one, itself among them."""
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
