"""Exact tests between convex pieces: separation, vertical clearance and contact area.

All rest on one fact: two convex polytopes are apart exactly when one of a finite set of axes
separates them, namely a face normal of either or a cross product of two edge directions. The
same axes are the face normals of their Minkowski difference, so that casting a vertical ray
against it gives the distance by which one would fall onto the other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.sim.geometry import ConvexPiece

__all__ = [
    "Axes",
    "Extent",
    "contact_corners_m",
    "contact_extent",
    "cross",
    "drop_m",
    "moved",
    "separating_axes",
]

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
