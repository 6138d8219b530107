"""What touches what, from geometry alone: overlaps, floating blocks, and who rests on whom."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import euler_deg_to_matrix
from phyblock.domain.scene import Block
from phyblock.sim.convex import Axes, contact_extent, drop_m, moved, separating_axes
from phyblock.sim.geometry import ConvexPiece, collision_pieces, corners_m

__all__ = [
    "CONTACT_TOLERANCE_M",
    "FIT_TOLERANCE_M",
    "GROUND",
    "Gap",
    "Overlap",
    "bounds_m",
    "boxes_near",
    "drop_height_m",
    "find_gaps",
    "find_overlaps",
    "pieces_of",
    "support_graph",
    "whole_bounds_m",
]

GROUND = 0
"""Stands for the ground where orders of blocks are named, as in the files."""
FIT_TOLERANCE_M = 0.0005
"""Overlaps and gaps up to this are not worth a word [m]."""
CONTACT_TOLERANCE_M = 0.0015
"""Blocks closer than this touch [m]."""
_MAX_CONTACT_OVERLAP_M = 0.003
_MIN_VERTICAL = 0.7
_MIN_AREA_M2 = 1e-5
_MIN_LENGTH_M = 0.005
_KEPT = 4096


@dataclass(frozen=True)
class Overlap:
    """Two blocks (by order, the ground is 0) that share space, `depth_m` deep [m]."""

    first: int
    second: int
    depth_m: float


@dataclass(frozen=True)
class Gap:
    """A block (by order) that hangs `height_m` [m] above whatever it would fall on."""

    order: int
    height_m: float


@dataclass(frozen=True, eq=False)
class _Solid:
    """A block at its place in the world, as convex pieces, with its bounding box (2, 3) [m]."""

    order: int
    pieces: tuple[ConvexPiece, ...]
    box_m: NDArray[np.float64]

    @property
    def bottom_m(self) -> float:
        return float(self.box_m[0, 2])


def find_overlaps(
    blocks: Sequence[Block], tolerance_m: float = FIT_TOLERANCE_M
) -> tuple[Overlap, ...]:
    """Pairs of blocks that share space deeper than `tolerance_m` [m]; blocks in the ground too."""
    solids = [_solid(block) for block in blocks]
    overlaps = [
        Overlap(GROUND, solid.order, -solid.bottom_m)
        for solid in solids
        if solid.bottom_m < -tolerance_m
    ]
    for first, second in _near_pairs(solids, 0.0):
        depth_m = -min(axes.gap_m for _, _, axes in _piece_pairs(first, second))
        if depth_m > tolerance_m:
            overlaps.append(Overlap(first.order, second.order, depth_m))
    return tuple(overlaps)


def find_gaps(blocks: Sequence[Block], tolerance_m: float = FIT_TOLERANCE_M) -> tuple[Gap, ...]:
    """Blocks that are more than `tolerance_m` [m] above the block or ground below them."""
    solids = [_solid(block) for block in blocks]
    heights = [(solid.order, _clearance_m(solid, solids)) for solid in solids]
    return tuple(Gap(order, height) for order, height in heights if height > tolerance_m)


def support_graph(blocks: Sequence[Block]) -> dict[int, frozenset[int]]:
    """For each block's order, the orders of the blocks it rests on; 0 is the ground.

    B rests on A when they are within `CONTACT_TOLERANCE_M`, the contact normal is within 45 degrees
    of vertical and points up from A to B, and the contact is an area, or an edge lying on a face.
    An edge that lies along the border of a face carries only what nothing else carries.
    """
    solids = [_solid(block) for block in blocks]
    rests_on: dict[int, set[int]] = {solid.order: set() for solid in solids}
    for solid in solids:
        if abs(solid.bottom_m) <= CONTACT_TOLERANCE_M:
            rests_on[solid.order].add(GROUND)
    on_rims: dict[int, set[int]] = {solid.order: set() for solid in solids}
    for first, second in _near_pairs(solids, CONTACT_TOLERANCE_M):
        for one, other, axes in _piece_pairs(first, second):
            rise, is_rim = _contact_rise(one, other, axes)
            carried = on_rims if is_rim else rests_on
            if rise > 0:
                carried[second.order].add(first.order)
            elif rise < 0:
                carried[first.order].add(second.order)
    return {order: frozenset(below or on_rims[order]) for order, below in rests_on.items()}


def drop_height_m(block: Block, blocks: Sequence[Block]) -> float:
    """How far `block` falls straight down before it meets one of `blocks` or the ground [m].

    Zero when it touches or overlaps what is below it already.
    """
    return _clearance_m(_solid(block), [_solid(other) for other in blocks])


@functools.lru_cache(maxsize=_KEPT)
def bounds_m(block: Block) -> NDArray[np.float64]:
    """Low and high corner of the box round a block, shape (2, 3) [m], world frame; read-only."""
    corners = corners_m(block.type, block.position_m, block.euler_deg)
    box: NDArray[np.float64] = np.stack([corners.min(axis=0), corners.max(axis=0)])
    box.setflags(write=False)
    return box


@functools.lru_cache(maxsize=_KEPT)
def pieces_of(block: Block) -> tuple[ConvexPiece, ...]:
    """The convex pieces of a block where it is, world frame."""
    rotation, position_m = euler_deg_to_matrix(block.euler_deg), np.array(block.position_m)
    return tuple(moved(piece, rotation, position_m) for piece in collision_pieces(block.type))


def whole_bounds_m(blocks: Iterable[Block]) -> NDArray[np.float64]:
    """Low and high corner of the box round all blocks, one at least, shape (2, 3) [m]."""
    boxes = np.stack([bounds_m(block) for block in blocks])
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def boxes_near(first: NDArray[np.float64], second: NDArray[np.float64], reach_m: float) -> bool:
    """Whether two boxes, each (2, 3) [m] as from `bounds_m`, come within `reach_m` [m]."""
    apart = np.maximum(first[0] - second[1], second[0] - first[1])
    return bool(apart.max() <= reach_m)


def _solid(block: Block) -> _Solid:
    pieces = pieces_of(block)
    points = np.vstack([piece.vertices_m for piece in pieces])
    return _Solid(block.order, pieces, np.stack([points.min(axis=0), points.max(axis=0)]))


def _near_pairs(solids: Sequence[_Solid], reach_m: float) -> Iterator[tuple[_Solid, _Solid]]:
    """Pairs whose bounding boxes come within `reach_m` of one another."""
    for i, first in enumerate(solids):
        for second in solids[i + 1 :]:
            if boxes_near(first.box_m, second.box_m, reach_m):
                yield first, second


def _piece_pairs(first: _Solid, second: _Solid) -> Iterator[tuple[ConvexPiece, ConvexPiece, Axes]]:
    for one in first.pieces:
        for other in second.pieces:
            yield one, other, separating_axes(one, other)


def _contact_rise(first: ConvexPiece, second: ConvexPiece, axes: Axes) -> tuple[float, bool]:
    """Vertical part of the contact normal from first to second, and whether it is a rim's.

    0.0 when neither rests on the other.
    """
    if not -_MAX_CONTACT_OVERLAP_M <= axes.gap_m <= CONTACT_TOLERANCE_M:
        return 0.0, False
    rim = 0.0
    touching = axes.gaps_m > axes.gap_m - CONTACT_TOLERANCE_M
    for direction in axes.directions[touching & (np.abs(axes.directions[:, 2]) >= _MIN_VERTICAL)]:
        extent = contact_extent(first, second, direction)
        if extent.area_m2 > _MIN_AREA_M2 or extent.length_m > _MIN_LENGTH_M:
            if not extent.is_rim:
                return float(direction[2]), False
            rim = float(direction[2])
    return rim, True


def _clearance_m(solid: _Solid, solids: Sequence[_Solid]) -> float:
    """How far a block would fall [m]; blocks that it overlaps count as touching."""
    clearance = max(solid.bottom_m, 0.0)
    for other in solids:
        reach = solid.box_m.copy()
        reach[0, 2] -= clearance
        if other is solid or not boxes_near(other.box_m, reach, 0.0):
            continue
        for _, _, axes in _piece_pairs(other, solid):
            fall = drop_m(axes)
            if fall is not None and fall < clearance and _is_above(axes, fall):
                clearance = max(fall, 0.0)
    return clearance


def _is_above(axes: Axes, fall_m: float) -> bool:
    """Whether the second piece starts clear of the first, or overlaps it."""
    return fall_m >= 0 or axes.gap_m < 0
