"""Exact tests between convex pieces: separation, vertical clearance and contact area.

All rest on one fact: two convex polytopes are apart exactly when one of a finite set of axes
separates them, namely a face normal of either or a cross product of two edge directions. The
same axes are the face normals of their Minkowski difference, so that casting a vertical ray
against it gives the distance by which one would fall onto the other.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import BlockType, Euler, euler_deg_to_matrix
from phyblock.domain.scene import Block
from phyblock.sim.geometry import ConvexPiece, collision_pieces, corners_m

_PATCH_DEPTH_M = 0.0005
_LINE_M = 0.001


class Axes(NamedTuple):
    """All axes that can separate a pair, and by how much they do.

    `directions` shape (k, 3), unit, from the first piece to the second; `gaps_m` shape (k,) [m],
    the free distance along each. The pair overlaps when every gap is negative, by the depth of
    the largest; when the largest is positive, the pieces are at least that far apart.
    """

    directions: NDArray[np.float64]
    gaps_m: NDArray[np.float64]

    @property
    def gap_m(self) -> float:
        """The largest gap [m]; negative: depth of the overlap."""
        return float(self.gaps_m.max())


def moved(
    piece: ConvexPiece, rotation: NDArray[np.float64], position_m: NDArray[np.float64]
) -> ConvexPiece:
    """The piece turned by `rotation` (3, 3) and then shifted to `position_m` (3,) [m]."""
    return ConvexPiece(
        piece.vertices_m @ rotation.T + position_m,
        piece.face_normals @ rotation.T,
        piece.edge_directions @ rotation.T,
    )


def cross(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cross products along the last axis, bit for bit those of `np.cross`, in a third of its time.

    Shapes (..., 3), which broadcast.
    """
    a, b, c = one[..., 0], one[..., 1], one[..., 2]
    x, y, z = other[..., 0], other[..., 1], other[..., 2]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def separating_axes(first: ConvexPiece, second: ConvexPiece) -> Axes:
    """Every candidate axis of the pair, in both senses."""
    crossed = cross(first.edge_directions[:, None], second.edge_directions[None]).reshape(-1, 3)
    lengths = np.linalg.norm(crossed, axis=1)
    crossed = crossed[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    axes = np.vstack([first.face_normals, second.face_normals, crossed])
    axes = np.vstack([axes, -axes])
    gaps = (second.vertices_m @ axes.T).min(axis=0) - (first.vertices_m @ axes.T).max(axis=0)
    return Axes(axes, gaps)


def drop_m(axes: Axes) -> float | None:
    """How far the second piece falls before it meets the first [m].

    Negative when it would have to rise to be clear; None when they never meet, because the
    second is not above the first.
    """
    vertical = axes.directions[:, 2]
    beside = np.abs(vertical) < 1e-9
    if np.any(axes.gaps_m[beside] >= -1e-9):
        return None
    falls = axes.gaps_m[~beside] / vertical[~beside]
    meets = float(falls[vertical[~beside] > 0].max())
    leaves = float(falls[vertical[~beside] < 0].min())
    return meets if meets < leaves else None


class Extent(NamedTuple):
    """How large a contact is: an area [m2], or a line's length [m] where one piece is an edge.

    `is_rim`: the line runs along the border of the other's face, less than a millimeter inside.
    """

    area_m2: float = 0.0
    length_m: float = 0.0
    is_rim: bool = False


def contact_extent(
    first: ConvexPiece, second: ConvexPiece, direction: NDArray[np.float64]
) -> Extent:
    """How large the contact of two touching pieces is.

    `direction` is the unit contact normal, from the first to the second. A line counts only
    where one of the two touches with an edge, as a cylinder that lies on a facet's edge does, and
    the other with a face.
    """
    basis = _plane_basis(direction)
    lower, upper, shared = _shared(first, second, direction, basis)
    if len(shared) < 2:
        return Extent()
    if len(lower) > 2 and len(upper) > 2:
        return Extent(area_m2=_area(shared))
    depth_m = _depth_inside(shared.mean(axis=0), lower if len(lower) > 2 else upper)
    length_m = float(np.linalg.norm(shared - shared[0], axis=1).max())
    return Extent(length_m=length_m, is_rim=depth_m < _LINE_M)


def contact_corners_m(
    first: ConvexPiece, second: ConvexPiece, direction: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Corners of the contact of two touching pieces, in the world, shape (k, 3) [m].

    `direction` as for `contact_extent`; none where they meet in less than a line.
    """
    basis = _plane_basis(direction)
    _, _, shared = _shared(first, second, direction, basis)
    if len(shared) < 2:
        return np.empty((0, 3))
    corners: NDArray[np.float64] = shared @ basis
    corners += (first.vertices_m @ direction).max() * direction
    return corners


def _shared(
    first: ConvexPiece,
    second: ConvexPiece,
    direction: NDArray[np.float64],
    basis: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """What the first shows, what the second shows, and what they share, in the plane's basis."""
    lower = _patch(first.vertices_m, direction, basis)
    upper = _patch(second.vertices_m, -direction, basis)
    return lower, upper, _clip(lower, upper) if len(upper) > 2 else _clip(upper, lower)


def _plane_basis(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Two unit vectors across `direction`, rows of (2, 3), right-handed with it."""
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    one = cross(direction, helper)
    one /= np.linalg.norm(one)
    return np.stack([one, cross(direction, one)])


def _patch(
    vertices_m: NDArray[np.float64], direction: NDArray[np.float64], basis: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Outline of what a piece shows furthest along `direction`: a polygon, two points or one."""
    heights = vertices_m @ direction
    points = vertices_m[heights > heights.max() - _PATCH_DEPTH_M] @ basis.T
    return _hull(points)


def _hull(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners of the convex hull, counter-clockwise; the ends alone if it is thin as a line."""
    middle = points.mean(axis=0)
    if len(points) < 3:
        return points
    spread = points - middle
    _, sizes, rows = np.linalg.svd(spread, full_matrices=False)
    across = spread @ rows[1]
    if sizes[1] < 1e-12 or np.ptp(across) < _LINE_M:
        along = spread @ rows[0]
        return points[[int(along.argmin()), int(along.argmax())]]
    ordered = sorted(map(tuple, np.round(points, 9).tolist()))
    lower = _half_hull(ordered)
    upper = _half_hull(ordered[::-1])
    return np.array([*lower[:-1], *upper[:-1]])


def _half_hull(ordered: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Andrew's monotone chain over points sorted by x."""
    chain: list[tuple[float, ...]] = []
    for x, y in ordered:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], (x, y)) <= 1e-12:
            chain.pop()
        chain.append((x, y))
    return chain


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _clip(subject: NDArray[np.float64], window: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part of a polygon, segment or point inside a convex polygon (Sutherland-Hodgman)."""
    if len(window) < 3:
        return np.empty((0, 2))
    kept = subject
    for start, end in zip(window, np.roll(window, -1, axis=0), strict=True):
        inward = np.array([start[1] - end[1], end[0] - start[0]])
        depths = (kept - start) @ inward
        corners: list[NDArray[np.float64]] = []
        for i in range(len(kept)):
            j = (i + 1) % len(kept)
            if depths[i] >= 0:
                corners.append(kept[i])
            if (depths[i] > 0 > depths[j]) or (depths[i] < 0 < depths[j]):
                share = depths[i] / (depths[i] - depths[j])
                corners.append(kept[i] + share * (kept[j] - kept[i]))
        kept = np.array(corners).reshape(-1, 2)
    return kept


def _depth_inside(point: NDArray[np.float64], polygon: NDArray[np.float64]) -> float:
    """Distance of a point from the nearest side of a convex polygon [m], positive inside."""
    sides = np.roll(polygon, -1, axis=0) - polygon
    inward = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    return float(np.einsum("ij,ij->i", point - polygon, inward).min())


def _area(polygon: NDArray[np.float64]) -> float:
    x, y = polygon.T
    return float(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2)


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


VOXEL_M = 0.005
_SIDE = 4
"""Points along each side of a voxel: their middles alone would take a block that lies 1 mm lower
for one that lies where it was, or lower by a whole layer.
"""
_POINTS = _SIDE**3
_POINT_M = VOXEL_M / _SIDE
_SHIFT_M = _POINT_M / 2
"""Faces of built structures lie on multiples of 1.25 mm, and no point near one."""
_SKIN_M = 0.0003
"""A point so near to a block counts as in it: slopes run through some, and what rests has shifted
by a tenth of a millimeter.
"""
_SPAN = 1 << 20
_KEPT_VOXELS = 256

Voxels = tuple[NDArray[np.int64], NDArray[np.uint8]]
"""Names of voxels (n,), and the points of each that lie in a block, a bit for each (n, 8)."""


def voxel_iou(one: Sequence[Block], other: Sequence[Block]) -> float:
    """Intersection over union of two structures; 1 for two without a block."""
    first, second = filled_voxels(one), filled_voxels(other)
    sizes = (_count(first[1]), _count(second[1]))
    _, a, b = np.intersect1d(first[0], second[0], assume_unique=True, return_indices=True)
    shared = _count(first[1][a] & second[1][b])
    whole = sum(sizes) - shared
    return shared / whole if whole else 1.0


def filled_voxels(blocks: Sequence[Block]) -> Voxels:
    """The voxels of `VOXEL_M` that some block reaches into, names ascending, and the points of each
    that lie in a block, of 64 that are 1.25 mm apart, a bit for each.
    """
    found = [_of(block.type, block.position_m, block.euler_deg) for block in blocks]
    if not found:
        return np.zeros(0, dtype=np.int64), np.zeros((0, _POINTS // 8), dtype=np.uint8)
    names, places = np.unique(np.concatenate([name for name, _ in found]), return_inverse=True)
    points = np.zeros((len(names), _POINTS // 8), dtype=np.uint8)
    np.bitwise_or.at(points, places, np.concatenate([bits for _, bits in found]))
    return names, points


def _count(points: NDArray[np.uint8]) -> int:
    return int(np.unpackbits(points).sum())


@functools.lru_cache(maxsize=_KEPT_VOXELS)
def _of(block_type: BlockType, position_m: tuple[float, float, float], euler_deg: Euler) -> Voxels:
    block = Block(1, block_type, "red", position_m, euler_deg, (), 1)
    low, high = (bounds_m(block) / VOXEL_M).round(9)
    first = np.floor(low).astype(np.int64) - 1
    count = np.ceil(high).astype(np.int64) + 1 - first
    x, y, z = (
        (np.arange(n * _SIDE) + k * _SIDE) * _POINT_M + _SHIFT_M
        for k, n in zip(first.tolist(), count.tolist(), strict=True)
    )
    inside = np.zeros((len(x), len(y), len(z)), dtype=bool)
    for piece in pieces_of(block):
        within = np.ones_like(inside)
        spans = piece.vertices_m @ piece.face_normals.T
        lows, highs = spans.min(axis=0) - _SKIN_M, spans.max(axis=0) + _SKIN_M
        for (a, b, c), lowest, highest in zip(piece.face_normals, lows, highs, strict=True):
            heights = (a * x)[:, None, None] + (b * y)[:, None] + c * z
            within &= (heights >= lowest) & (heights <= highest)
        inside |= within
    parts = inside.reshape(count[0], _SIDE, count[1], _SIDE, count[2], _SIDE)
    bits = np.packbits(parts.transpose(0, 2, 4, 1, 3, 5).reshape(-1, _POINTS), axis=1)
    filled = np.flatnonzero(bits.any(axis=1))
    places = np.stack(np.unravel_index(filled, tuple(count)), axis=-1) + first
    names = (places[:, 0] * _SPAN + places[:, 1]) * _SPAN + places[:, 2]
    return names, bits[filled]
