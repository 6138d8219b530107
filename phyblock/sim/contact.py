"""Geometry of blocks in contact: overlaps, gaps, support, contact areas, and shared space.

Two convex polytopes are apart exactly when a face normal of either, or a cross product of two edge
directions, separates them. The same axes are the face normals of their Minkowski difference: a
vertical ray against it gives the distance by which one would fall onto the other.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Sequence
from itertools import combinations, product
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import BlockType, Euler, euler_deg_to_matrix
from phyblock.domain.scene import Block
from phyblock.sim.geometry import ConvexPiece, collision_pieces, corners_m, cross

GROUND = 0  # The order of the ground, as in the files.
FIT_TOLERANCE_M = 0.0005  # Overlaps and gaps up to this are ignored [m].
CONTACT_TOLERANCE_M = 0.0015  # Blocks closer than this touch [m].
_MAX_CONTACT_OVERLAP_M = 0.003
_MIN_VERTICAL = 0.7
_MIN_AREA_M2 = 1e-5
_MIN_LENGTH_M = 0.005
_PATCH_DEPTH_M = 0.0005
_LINE_M = 0.001
_KEPT = 4096

Floats = NDArray[np.float64]


@functools.lru_cache(maxsize=_KEPT)
def bounds_m(block: Block) -> Floats:
    """Low and high corner of the box around a block, shape (2, 3) [m], world frame; read-only."""
    corners = corners_m(block.type, block.position_m, block.euler_deg)
    box: Floats = np.stack([corners.min(axis=0), corners.max(axis=0)])
    box.setflags(write=False)
    return box


def whole_bounds_m(blocks: Iterable[Block]) -> Floats:
    """Low and high corner of the box around all blocks, at least one, shape (2, 3) [m]."""
    boxes = np.stack([bounds_m(block) for block in blocks])
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def boxes_near(first: Floats, second: Floats, reach_m: float) -> bool:
    """True if two boxes, each (2, 3) [m] as from `bounds_m`, come within `reach_m` [m]."""
    apart = np.maximum(first[0] - second[1], second[0] - first[1])
    return bool(apart.max() <= reach_m)


@functools.lru_cache(maxsize=_KEPT)
def pieces_of(block: Block) -> tuple[ConvexPiece, ...]:
    """The convex pieces of a block at its pose, world frame."""
    turn = euler_deg_to_matrix(block.euler_deg).T
    return tuple(
        ConvexPiece(
            piece.vertices_m @ turn + np.array(block.position_m),
            piece.face_normals @ turn,
            piece.edge_directions @ turn,
        )
        for piece in collision_pieces(block.type)
    )


class Axes(NamedTuple):
    """Unit axes (k, 3) that can separate a pair, first to second, and the gap along each [m]."""

    directions: Floats
    gaps_m: Floats

    @property
    def gap_m(self) -> float:
        """The largest gap [m]; negative: depth of the overlap."""
        return float(self.gaps_m.max())


def separating_axes(first: ConvexPiece, second: ConvexPiece) -> Axes:
    """Every candidate axis of the pair, in both directions."""
    crossed = cross(first.edge_directions[:, None], second.edge_directions[None]).reshape(-1, 3)
    lengths = np.linalg.norm(crossed, axis=1)
    crossed = crossed[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    axes = np.vstack([first.face_normals, second.face_normals, crossed])
    axes = np.vstack([axes, -axes])
    gaps = (second.vertices_m @ axes.T).min(axis=0) - (first.vertices_m @ axes.T).max(axis=0)
    return Axes(axes, gaps)


def drop_m(axes: Axes) -> float | None:
    """The fall [m] of the second piece onto the first, or None if it is not above it."""
    vertical = axes.directions[:, 2]
    beside = np.abs(vertical) < 1e-9
    if np.any(axes.gaps_m[beside] >= -1e-9):
        return None
    falls = axes.gaps_m[~beside] / vertical[~beside]
    meets = float(falls[vertical[~beside] > 0].max())
    leaves = float(falls[vertical[~beside] < 0].min())
    return meets if meets < leaves else None


class Overlap(NamedTuple):
    """Two blocks (by order, the ground is 0) that share space, `depth_m` deep [m]."""

    first: int
    second: int
    depth_m: float


def find_overlaps(
    blocks: Sequence[Block], tolerance_m: float = FIT_TOLERANCE_M
) -> tuple[Overlap, ...]:
    """Pairs of blocks, or a block and the ground, that overlap deeper than `tolerance_m` [m]."""
    found = [Overlap(GROUND, block.order, -float(bounds_m(block)[0, 2])) for block in blocks]
    for first, second in _near_pairs(blocks, 0.0):
        depth_m = -min(axes.gap_m for axes in pair_axes(first, second))
        found.append(Overlap(first.order, second.order, depth_m))
    return tuple(one for one in found if one.depth_m > tolerance_m)


def find_gaps(blocks: Sequence[Block], tolerance_m: float = FIT_TOLERANCE_M) -> dict[int, float]:
    """The fall [m] of each block, by order, if it is more than `tolerance_m` [m]."""
    heights_m = {b.order: drop_height_m(b, [o for o in blocks if o is not b]) for b in blocks}
    return {order: high for order, high in heights_m.items() if high > tolerance_m}


def drop_height_m(block: Block, others: Sequence[Block]) -> float:
    """The distance by which a block falls straight down onto others or the ground [m]."""
    box = bounds_m(block)
    clearance = max(float(box[0, 2]), 0.0)
    for other in others:
        reach = box.copy()
        reach[0, 2] -= clearance
        if not boxes_near(bounds_m(other), reach, 0.0):
            continue
        for axes in pair_axes(other, block):
            fall = drop_m(axes)
            # The block starts clear of the other, or overlaps it.
            if fall is not None and fall < clearance and (fall >= 0 or axes.gap_m < 0):
                clearance = max(fall, 0.0)
    return clearance


def support_graph(
    blocks: Sequence[Block], *, only_areas: bool = False
) -> dict[int, frozenset[int]]:
    """For each block's order, the orders of the blocks it rests on; 0 is the ground.

    B rests on A when they touch in an area, or, without `only_areas`, an edge on a face, with an
    upward normal within 45 degrees. Edges on a face's border count only without other support.
    """
    rests_on: dict[int, set[int]] = {block.order: set() for block in blocks}
    for block in blocks:
        if abs(float(bounds_m(block)[0, 2])) <= CONTACT_TOLERANCE_M:
            rests_on[block.order].add(GROUND)
    on_rims: dict[int, set[int]] = {block.order: set() for block in blocks}
    for first, second in _near_pairs(blocks, CONTACT_TOLERANCE_M):
        for rise, touch in _rises(*beside(first, second)):
            if only_areas and touch != "area":
                continue
            carried = on_rims if touch == "rim" else rests_on
            if rise > 0:
                carried[second.order].add(first.order)
            elif rise < 0:
                carried[first.order].add(second.order)
    return {order: frozenset(below or on_rims[order]) for order, below in rests_on.items()}


def _near_pairs(blocks: Sequence[Block], reach_m: float) -> Iterator[tuple[Block, Block]]:
    """Pairs whose boxes come within `reach_m` of one another."""
    pairs = combinations(blocks, 2)
    return ((a, b) for a, b in pairs if boxes_near(bounds_m(a), bounds_m(b), reach_m))


_KEPT_PAIRS = 1 << 16
Turned = tuple[BlockType, Euler]  # A block by its type and angles, without its place.
Touch = Literal["area", "edge", "rim"]
"""Contact in an area, of an edge within a face, or of an edge on the border of a face."""


def beside(first: Block, second: Block) -> tuple[Turned, Turned, tuple[float, float, float]]:
    """Return the relation of two blocks: each one's type and angles, and the vector between."""
    (a, b, c), (x, y, z) = first.position_m, second.position_m
    way = (round(x - a, 10) + 0.0, round(y - b, 10) + 0.0, round(z - c, 10) + 0.0)
    return (first.type, first.euler_deg), (second.type, second.euler_deg), way


def at(turned: Turned, place_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Block:
    """A block with this type and angles at a place, by default the origin."""
    return Block(1, turned[0], "red", place_m, turned[1], (), 1)


def pair_axes(first: Block, second: Block) -> tuple[Axes, ...]:
    """Return the axes that can separate each pair of pieces of two blocks."""
    turned, other, _ = beside(first, second)
    way_m = np.subtract(second.position_m, first.position_m)
    return tuple(
        Axes(axes.directions, axes.gaps_m + axes.directions @ way_m)
        for axes in _axes_at_one_place(turned, other)
    )


@functools.lru_cache(maxsize=_KEPT)
def _axes_at_one_place(first: Turned, second: Turned) -> tuple[Axes, ...]:
    return tuple(axes for _, _, axes in piece_pairs(at(first), at(second)))


@functools.lru_cache(maxsize=_KEPT_PAIRS)
def _rises(
    first: Turned, second: Turned, way_m: tuple[float, float, float]
) -> tuple[tuple[float, Touch], ...]:
    """Rise of the contact of each pair of touching pieces, and how they touch."""
    found = (_contact_rise(*pair) for pair in piece_pairs(at(first), at(second, way_m)))
    return tuple(one for one in found if one[0])


def piece_pairs(first: Block, second: Block) -> Iterator[tuple[ConvexPiece, ConvexPiece, Axes]]:
    """Pairs of pieces of two blocks, with the axes that can separate each."""
    for one, other in product(pieces_of(first), pieces_of(second)):
        yield one, other, separating_axes(one, other)


def _contact_rise(first: ConvexPiece, second: ConvexPiece, axes: Axes) -> tuple[float, Touch]:
    """Vertical part of the contact normal from first to second, and how they touch."""
    if not -_MAX_CONTACT_OVERLAP_M <= axes.gap_m <= CONTACT_TOLERANCE_M:
        return 0.0, "rim"
    rim = 0.0
    touching = axes.gaps_m > axes.gap_m - CONTACT_TOLERANCE_M
    for direction in axes.directions[touching & (np.abs(axes.directions[:, 2]) >= _MIN_VERTICAL)]:
        lower, upper, shared, _ = _patches(first, second, direction)
        if len(shared) < 2:
            continue
        if len(lower) > 2 and len(upper) > 2:
            x, y = shared.T
            area_m2 = abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
            if area_m2 > _MIN_AREA_M2:
                return float(direction[2]), "area"
        elif np.linalg.norm(shared - shared[0], axis=1).max() > _MIN_LENGTH_M:
            # One piece is an edge; its rim runs less than a millimeter inside the other's face.
            face = lower if len(lower) > 2 else upper
            sides = np.roll(face, -1, axis=0) - face
            inward = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
            inward /= np.linalg.norm(inward, axis=1, keepdims=True)
            if np.einsum("ij,ij->i", shared.mean(axis=0) - face, inward).min() >= _LINE_M:
                return float(direction[2]), "edge"
            rim = float(direction[2])
    return rim, "rim"


def contact_corners_m(
    first: ConvexPiece, second: ConvexPiece, direction: Floats, margin_m: float = 0.0
) -> Floats:
    """Corners of the contact of two touching pieces, in the world, shape (k, 3) [m].

    `direction` (3,) is the contact's normal, from the first to the second; no corners if they meet
    in less than a line. Half of a margin [m] is removed along the rims of either piece: the rest
    touches even if the pieces are off by it. A negative one is added, which gives
    the part that may touch.
    """
    lower, upper, shared, basis = _patches(first, second, direction)
    if margin_m < 0:
        ways = -margin_m / 2 * np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])
        lower, upper = (_hull((one[:, None] + ways).reshape(-1, 2)) for one in (lower, upper))
        shared = _inside(lower, upper)
    elif margin_m:
        for outline in (lower, upper):
            shared = _inside(shared, outline, margin_m / 2)
    if len(shared) < 2:
        return np.empty((0, 3))
    return shared @ basis + (first.vertices_m @ direction).max() * direction


def _patches(
    first: ConvexPiece, second: ConvexPiece, direction: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """Facing outlines, the part they share, and two unit vectors of their plane."""
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    right = cross(direction, helper)
    right /= np.linalg.norm(right)
    basis = np.stack([right, cross(direction, right)])
    outlines = []
    for piece, towards in ((first, direction), (second, -direction)):
        heights = piece.vertices_m @ towards
        outlines.append(_hull(piece.vertices_m[heights > heights.max() - _PATCH_DEPTH_M] @ basis.T))
    lower, upper = outlines
    shared = _inside(lower, upper) if len(upper) > 2 else _inside(upper, lower)
    return lower, upper, shared, basis


def _hull(points: Floats) -> Floats:
    """Corners of the convex hull, counter-clockwise; only the ends if it is a line."""
    if len(points) < 3:
        return points
    spread = points - points.mean(axis=0)
    _, sizes, rows = np.linalg.svd(spread, full_matrices=False)
    if sizes[1] < 1e-12 or np.ptp(spread @ rows[1]) < _LINE_M:
        along = spread @ rows[0]
        return points[[int(along.argmin()), int(along.argmax())]]

    def half(ordered: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        """Andrew's monotone chain over points sorted by x."""
        chain: list[tuple[float, ...]] = []
        for x, y in ordered:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2:]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 1e-12:
                    break
                chain.pop()
            chain.append((x, y))
        return chain

    ordered = sorted(map(tuple, np.round(points, 9).tolist()))
    return np.array([*half(ordered)[:-1], *half(ordered[::-1])[:-1]])


def clip(corners: Floats, heights: Floats, flat_m: float = 0.0) -> Floats:
    """The part of a polygon or segment (n, d) whose heights (n,) are not above zero
    (Sutherland-Hodgman); corners within `flat_m` of zero are on the border.
    """
    kept = []
    for i, height in enumerate(heights):
        after = (i + 1) % len(corners)
        if height <= flat_m:
            kept.append(corners[i])
        if (height < -flat_m and heights[after] > flat_m) or (
            height > flat_m and heights[after] < -flat_m
        ):
            share = height / (height - heights[after])
            kept.append(corners[i] + share * (corners[after] - corners[i]))
    return np.array(kept).reshape(-1, corners.shape[1])


def _inside(subject: Floats, window: Floats, inset_m: float = 0.0) -> Floats:
    """The part of a polygon, segment or point inside a convex polygon."""
    if len(window) < 3 and not (len(window) == 2 and inset_m):
        return np.empty((0, 2))
    kept = subject
    for start, end in zip(window, np.roll(window, -1, axis=0), strict=True):
        along = end - start
        outward = -along if len(window) == 2 else np.array([along[1], -along[0]])
        kept = clip(kept, (kept - start) @ outward + inset_m * np.linalg.norm(outward))
    return kept


VOXEL_M = 0.005
_SIDE = 4
"""Points along each side of a voxel: centers alone would miss a block that is slightly lower."""
_POINTS = _SIDE**3
_POINT_M = VOXEL_M / _SIDE
_SHIFT_M = _POINT_M / 2
"""Shift of points away from multiples of 1.25 mm, on which faces of structures lie."""
_SKIN_M = 0.0003
"""A point this near to a block counts as inside, since resting blocks shift by .1 mm."""
_SPAN = 1 << 20

Voxels = tuple[NDArray[np.int64], NDArray[np.uint8]]
"""Names of voxels (n,), and a bit mask of the points of each that are in a block (n, 8)."""


def voxel_iou(one: Sequence[Block], other: Sequence[Block]) -> float:
    """Intersection over union of two structures as voxels; 1 if both are empty."""
    first, second = filled_voxels(one), filled_voxels(other)
    _, a, b = np.intersect1d(first[0], second[0], assume_unique=True, return_indices=True)
    counts = (first[1], second[1], first[1][a] & second[1][b])
    n_first, n_second, shared = (int(np.unpackbits(points).sum()) for points in counts)
    whole = n_first + n_second - shared
    return shared / whole if whole else 1.0


def filled_voxels(blocks: Sequence[Block]) -> Voxels:
    """The voxels that blocks reach into, in ascending order, and the points of each inside."""
    found = [_filled((one.type, one.euler_deg), one.position_m) for one in blocks]
    if not found:
        return np.zeros(0, dtype=np.int64), np.zeros((0, _POINTS // 8), dtype=np.uint8)
    names, bits = (np.concatenate(part) for part in zip(*found, strict=True))
    names, places = np.unique(names, return_inverse=True)
    points = np.zeros((len(names), _POINTS // 8), dtype=np.uint8)
    np.bitwise_or.at(points, places, bits)
    return names, points


@functools.lru_cache(maxsize=256)
def _filled(turned: Turned, place_m: tuple[float, float, float]) -> Voxels:
    block = at(turned, place_m)
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
