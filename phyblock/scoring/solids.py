"""How much of two solids is shared: exact volumes of intersections of convex pieces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.stable import plain_sum

__all__ = ["Piece", "overlap_volume", "placed", "volume"]

Floats = NDArray[np.float64]
_AXES = np.eye(3)
_FLAT = 1e-9
"""Points closer to a plane than this share of a block's size lie on it [m]."""


class Piece(NamedTuple):
    """A convex polytope: its corners (n, 3) and, for each set of parallel faces, a unit normal
    (k, 3).
    """

    corners: Floats
    normals: Floats


def placed(pieces: Sequence[Piece], rotation: Floats, position: Floats) -> tuple[Piece, ...]:
    """Pieces turned by `rotation` (3, 3), then shifted to `position` (3,)."""
    return tuple(Piece(p.corners @ rotation.T + position, p.normals @ rotation.T) for p in pieces)


def overlap_volume(one: Sequence[Piece], other: Sequence[Piece]) -> float:
    """Volume that two solids share, each given by convex pieces that do not overlap."""
    return plain_sum(_shared(first, second) for first in one for second in other)


def volume(pieces: Sequence[Piece]) -> float:
    """Volume of a solid that convex pieces fill."""
    return plain_sum(_volume(_faces(piece)) for piece in pieces)


def _shared(one: Piece, other: Piece) -> float:
    apart = np.maximum(
        one.corners.min(axis=0) - other.corners.max(axis=0),
        other.corners.min(axis=0) - one.corners.max(axis=0),
    )
    if apart.max() >= 0:
        return 0.0
    faces = _faces(one)
    for normal in (*other.normals, *-other.normals):
        faces = _cut(faces, normal, float((other.corners @ normal).max()))
        if len(faces) < 4:
            return 0.0
    return _volume(faces)


def _faces(piece: Piece) -> list[Floats]:
    """The faces of a polytope, each a polygon (n, 3) in order round it."""
    faces = []
    for normal in (*piece.normals, *-piece.normals):
        heights = piece.corners @ normal
        face = piece.corners[heights > heights.max() - _FLAT]
        # A semi-cylinder has a face on one side of a pair alone.
        if len(face) > 2:
            faces.append(_round(face, normal))
    return faces


def _round(points: Floats, normal: Floats) -> Floats:
    """Corners of a convex polygon in order round its middle."""
    if len(points) == 3:
        return points
    helper = _AXES[int(np.argmin(np.abs(normal)))]
    right = _cross(normal, helper)
    spread = points - points.sum(axis=0) / len(points)
    angles = np.arctan2(spread @ _cross(normal, right), spread @ right)
    return points[np.argsort(angles, kind="stable")]


def _cross(one: Floats, other: Floats) -> Floats:
    """Vector products along the last axis; `np.cross` takes several times as long on few."""
    a, b, c = one[..., 0], one[..., 1], one[..., 2]
    x, y, z = other[..., 0], other[..., 1], other[..., 2]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def _cut(faces: list[Floats], normal: Floats, limit: float) -> list[Floats]:
    """What of a polytope lies at or below the plane `normal` · x = `limit`."""
    kept: list[Floats] = []
    rim: list[Floats] = []
    has_lid = False
    for face in faces:
        heights = face @ normal - limit
        highest = heights.max()
        if highest < -_FLAT:
            kept.append(face)
            continue
        if highest <= _FLAT:
            on_plane = heights >= -_FLAT
            has_lid = has_lid or bool(on_plane.all())
            kept.append(face)
            rim += list(face[on_plane])
            continue
        polygon = _below(face, heights)
        if len(polygon) > 2:
            kept.append(polygon)
        if len(polygon):
            rim += list(polygon[polygon @ normal >= limit - _FLAT])
    if len(rim) > 2 and not has_lid:
        corners: Floats = np.unique(np.round(np.array(rim), 10), axis=0)
        if len(corners) > 2:
            kept.append(_round(corners, normal))
    return kept


def _below(face: Floats, heights: Floats) -> Floats:
    """The part of a polygon whose `heights` are not above zero."""
    points = []
    for i, height in enumerate(heights):
        after = (i + 1) % len(face)
        if height <= _FLAT:
            points.append(face[i])
        if (height < -_FLAT and heights[after] > _FLAT) or (
            height > _FLAT and heights[after] < -_FLAT
        ):
            share = height / (height - heights[after])
            points.append(face[i] + share * (face[after] - face[i]))
    return np.array(points).reshape(-1, 3)


def _volume(faces: list[Floats]) -> float:
    """Volume of a convex polytope: cones from a point inside to each of its faces."""
    if len(faces) < 4:
        return 0.0
    corners = np.concatenate(faces)
    middle = corners.sum(axis=0) / len(corners)
    total = 0.0
    for face in faces:
        legs = face - middle
        fans = _cross(legs[1:-1] - legs[0], legs[2:] - legs[0])
        total += abs(float((fans @ legs[0]).sum())) / 6
    return total
