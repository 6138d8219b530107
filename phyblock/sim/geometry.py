"""Parametric geometry of the eight block types, in the body frames of `phyblock.domain.blocks`.

Every block is a prism: a flat outline pushed along an axis. From the outline come three things:
a closed triangle mesh for pictures and mass properties, the convex pieces that physics and the
overlap test use, and thin bars along the true edges that draw a block's outlines. Curved sides
are polygons (18 facets for the cylinder, 10 for the arcs), because that is what the blocks are:
a smooth cylinder rolls away where an 18-gon stands.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import SHAPES, BlockType, Euler, euler_deg_to_matrix
from phyblock.sim.mesh import Mesh

__all__ = ["ConvexPiece", "collision_pieces", "corners_m", "edge_bars", "solid_mesh"]

Outline = NDArray[np.float64]
"""Corners of a polygon, shape (n, 2) [m], counter-clockwise."""

_SHARP_COSINE = math.cos(math.radians(30))
_ARC_SEGMENTS = 10
_ARCH_HOLE_RADIUS_M = 0.0375


@dataclass(frozen=True, eq=False)
class ConvexPiece:
    """A convex polytope in a body frame.

    `vertices_m` shape (n, 3) [m]; `face_normals` and `edge_directions`, shape (k, 3), hold one
    unit vector for each set of parallel faces or edges: the axes that can separate two pieces.
    """

    vertices_m: NDArray[np.float64]
    face_normals: NDArray[np.float64]
    edge_directions: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Prism:
    """An outline in the plane of axes `plane`, pushed to ±`half_m` along axis `axis`.

    `parts` are convex outlines that together fill `outline`; `caps` triangulates it, as indices.
    (`plane`, `axis`) is a right-handed triple, so a counter-clockwise outline faces +`axis`.
    """

    outline: Outline
    half_m: float
    plane: tuple[int, int]
    axis: int
    parts: tuple[Outline, ...]
    caps: tuple[tuple[int, int, int], ...]


@functools.cache
def solid_mesh(block_type: BlockType) -> Mesh:
    """The block's surface: closed, outward, every corner once, in the body frame."""
    prism = _prism(block_type)
    n = len(prism.outline)
    vertices = np.vstack([_place(prism, prism.outline, side) for side in (-1, 1)])
    triangles: list[tuple[int, int, int]] = []
    for a, b, c in prism.caps:
        triangles += [(c, b, a), (n + a, n + b, n + c)]
    for i in range(n):
        j = (i + 1) % n
        triangles += [(i, j, n + j), (i, n + j, n + i)]
    return Mesh(vertices, np.array(triangles))


def corners_m(
    block_type: BlockType, position_m: tuple[float, float, float], euler_deg: Euler
) -> NDArray[np.float64]:
    """World corners of a block's solid at a pose, shape (n, 3) [m]."""
    turned: NDArray[np.float64] = (
        solid_mesh(block_type).vertices_m @ euler_deg_to_matrix(euler_deg).T
    )
    turned += np.array(position_m)
    return turned


@functools.cache
def collision_pieces(block_type: BlockType, inset_m: float = 0.0) -> tuple[ConvexPiece, ...]:
    """Convex pieces that fill the block, every plane moved inward by `inset_m` [m].

    One piece, but for the arch: ten (each leg with its first arc segment, and eight slices).
    The inset takes back the margin that a simulator adds around hulls.
    """
    prism = _prism(block_type)
    return tuple(_convex_prism(prism, _shrink(part, inset_m), inset_m) for part in prism.parts)


@functools.cache
def edge_bars(block_type: BlockType, half_width_m: float) -> Mesh:
    """Square bars, `half_width_m` [m] to each side, along every edge sharper than 30 degrees."""
    solid = solid_mesh(block_type)
    vertices: list[NDArray[np.float64]] = []
    triangles: list[NDArray[np.int64]] = []
    for start, end, outward in _sharp_edges(solid):
        vertices.append(_bar(start, end, outward, half_width_m))
        triangles.append(_BOX_TRIANGLES + 8 * len(triangles))
    return Mesh(np.vstack(vertices), np.vstack(triangles))


def _arc(radius_m: float) -> Outline:
    """Half a circle above the first axis, from angle 0 to 180 degrees, shape (11, 2)."""
    angles = np.linspace(0.0, math.pi, _ARC_SEGMENTS + 1)
    return np.stack([radius_m * np.cos(angles), radius_m * np.sin(angles)], axis=1)


def _fan(corners: int) -> tuple[tuple[int, int, int], ...]:
    return tuple((0, i, i + 1) for i in range(1, corners - 1))


def _convex(outline: Outline, half_m: float, plane: tuple[int, int], axis: int) -> _Prism:
    return _Prism(outline, half_m, plane, axis, (outline,), _fan(len(outline)))


@functools.cache
def _prism(block_type: BlockType) -> _Prism:
    high = SHAPES[block_type].high_m
    if block_type == "arch":
        return _arch_prism()
    if block_type == "semi_cylinder":
        return _convex(_arc(high[1]), high[0], (1, 2), 0)
    if block_type == "triangle":
        corners = np.array([[high[1], 0.0], [0.0, high[2]], [-high[1], 0.0]])
        return _convex(corners, high[0], (1, 2), 0)
    if block_type == "cylinder":
        angles = np.radians(np.arange(0, 360, 20))
        circle = high[0] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return _convex(circle, high[2], (0, 1), 2)
    x, y, z = high
    return _convex(np.array([[x, y], [-x, y], [-x, -y], [x, -y]]), z, (0, 1), 2)


def _arch_prism() -> _Prism:
    half_x, half_y, half_z = SHAPES["arch"].high_m
    arc = _arc(_ARCH_HOLE_RADIUS_M) - [0.0, half_z]
    right_foot, right_top = [half_y, -half_z], [half_y, half_z]
    left_foot, left_top = [-half_y, -half_z], [-half_y, half_z]
    outline = np.array([*arc[::-1], right_foot, right_top, left_top, left_foot])
    right_leg = np.array([arc[0], right_foot, right_top, [arc[1, 0], half_z], arc[1]])
    left_leg = np.array([arc[-1], arc[-2], [arc[-2, 0], half_z], left_top, left_foot])
    slices = [
        np.array([arc[i], [arc[i, 0], half_z], [arc[i + 1, 0], half_z], arc[i + 1]])
        for i in range(1, _ARC_SEGMENTS - 1)
    ]
    last = _ARC_SEGMENTS
    middle = last // 2
    foot_right, top_right, top_left, foot_left = range(last + 1, last + 5)
    caps = [(foot_left, 0, top_left), (last, foot_right, top_right), (middle, top_right, top_left)]
    caps += [(top_left, i, i + 1) for i in range(middle)]
    caps += [(top_right, i, i + 1) for i in range(middle, last)]
    return _Prism(outline, half_x, (1, 2), 0, (right_leg, *slices, left_leg), tuple(caps))


def _place(prism: _Prism, outline: Outline, side: int, inset_m: float = 0.0) -> Outline:
    """The outline as the cap on one side of the prism, shape (n, 3)."""
    placed = np.empty((len(outline), 3))
    placed[:, prism.plane] = outline
    placed[:, prism.axis] = side * (prism.half_m - inset_m)
    return placed


def _shrink(outline: Outline, inset_m: float) -> Outline:
    """A convex outline with every side moved inward by `inset_m`."""
    sides = np.roll(outline, -1, axis=0) - outline
    normals = np.stack([sides[:, 1], -sides[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = np.einsum("ij,ij->i", normals, outline) - inset_m
    pairs = np.stack([np.roll(normals, 1, axis=0), normals], axis=1)
    rights = np.stack([np.roll(offsets, 1), offsets], axis=1)
    return np.linalg.solve(pairs, rights[..., None])[..., 0]


def _convex_prism(prism: _Prism, outline: Outline, inset_m: float) -> ConvexPiece:
    vertices = np.vstack([_place(prism, outline, side, inset_m) for side in (-1, 1)])
    axis = np.zeros(3)
    axis[prism.axis] = 1.0
    sides = np.zeros((len(outline), 3))
    sides[:, prism.plane] = np.roll(outline, -1, axis=0) - outline
    sides = _one_of_each_line(sides)
    normals = np.cross(sides, axis)
    return ConvexPiece(vertices, np.vstack([normals, axis]), np.vstack([sides, axis]))


def _one_of_each_line(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors, one for each set of parallel ones."""
    kept: list[NDArray[np.float64]] = []
    for vector in vectors / np.linalg.norm(vectors, axis=1, keepdims=True):
        if all(abs(vector @ other) < 1 - 1e-9 for other in kept):
            kept.append(vector)
    return np.array(kept)


def _sharp_edges(
    solid: Mesh,
) -> list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]]:
    """Start, end and outward bisector of each edge between faces that differ by 30 degrees."""
    normals = solid.normals
    beside: dict[tuple[int, int], list[int]] = {}
    for face, corners in enumerate(solid.triangles.tolist()):
        for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
            beside.setdefault((min(a, b), max(a, b)), []).append(face)
    edges = []
    for (a, b), (one, other) in sorted(beside.items()):
        if normals[one] @ normals[other] < _SHARP_COSINE:
            outward = normals[one] + normals[other]
            edges.append((solid.vertices_m[a], solid.vertices_m[b], outward))
    return edges


_BOX_SIGNS: Sequence[tuple[int, int, int]] = tuple(
    (i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)
)
_BOX_TRIANGLES = np.array(
    [
        *[(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5)],
        *[(0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6)],
        *[(0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)],
    ]
)


def _bar(
    start: NDArray[np.float64], end: NDArray[np.float64], outward: NDArray[np.float64], half: float
) -> NDArray[np.float64]:
    """Corners of a square bar along an edge, in the order of `_BOX_SIGNS`, shape (8, 3)."""
    along = (end - start) / np.linalg.norm(end - start)
    up = outward / np.linalg.norm(outward)
    frame = np.stack([along, up, np.cross(along, up)])
    reach = np.array([np.linalg.norm(end - start) / 2 + half, half, half])
    corners: NDArray[np.float64] = (start + end) / 2 + (np.array(_BOX_SIGNS) * reach) @ frame
    return corners
