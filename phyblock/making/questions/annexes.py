"""Small additions to a structure that make its balance worth a question.

The structures of the data set are built so that they stand at every step; few of their blocks
rest on more than they need, and none is held by a weight. An annex is a plank laid on a flat top,
off its middle as likely as not, with weights on it and perhaps a column under its free end: drawn
at random, it is a balance, a cantilever with a counterweight, or a bridge with a support too many.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from phyblock.domain.blocks import COLORS, SHAPES, BlockType, Euler
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.selection import pick, shuffled
from phyblock.sim.balance import MARGIN_M
from phyblock.sim.contact import bounds_m, find_gaps, find_overlaps
from phyblock.sim.geometry import corners_m
from phyblock.stable import plain_sum

__all__ = ["with_annex"]

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


_WEIGHTS = (
    _Weight("cube", (0.0, 0.0, 0.0), 0.025, 0.025),
    _Weight("cube", (0.0, 0.0, 0.0), 0.025, 0.025),
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
"""What columns are made of, and heights [m]."""


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
    return [block for block in blocks if block.order not in carrying and _has_top(block)]


def _has_top(block: Block) -> bool:
    corners = corners_m(block.type, block.position_m, block.euler_deg)
    top = corners[corners[:, 2] > corners[:, 2].max() - _FLAT_M, :2]
    is_square = all(abs(angle % 90.0) < 1e-6 for angle in block.euler_deg)
    return is_square and bool(np.ptp(top, axis=0).min() >= _LEAST_TOP_M)


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
        weights = _weights(length_m, rng)
        plan = _Plan(plank, length_m, off_m, weights, is_propped)
        is_far = abs(off_m) + length_m / 2 - _CUBE_M > half_m
        others = [plan._replace(weights=[w for w in weights if w is not one]) for one in weights]
        if _leans_m(plan) > half_m - MARGIN_M:
            continue
        if is_propped and is_far:
            return plan
        if not is_propped and any(_leans_m(one) > half_m + MARGIN_M for one in others):
            return plan
    return None


def _leans_m(plan: _Plan) -> float:
    """How far plank and weights together have their center off the middle of the top [m]."""
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
