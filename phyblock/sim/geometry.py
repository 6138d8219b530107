"""Parametric geometry of the eight block types, in the body frames of `phyblock.domain.blocks`.

Every block is a prism: a flat outline pushed along an axis. From the outline come three things:
a closed triangle mesh for mass properties, one for pictures, and the convex pieces that physics
and the overlap test use. Curved sides are polygons (18 facets for the cylinder, 10 for the arcs),
because that is what the blocks are: a smooth cylinder rolls away where an 18-gon stands. Pictures
show them round, by facets of five degrees.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import SHAPES, BlockType, Euler, euler_deg_to_matrix
from phyblock.sim.exact import rounded
from phyblock.sim.mesh import Mesh

__all__ = ["ConvexPiece", "collision_pieces", "corners_m", "drawn_mesh", "solid_mesh"]

Outline = NDArray[np.float64]
"""Corners of a polygon, shape (n, 2) [m], counter-clockwise."""

_ARC_SEGMENTS, _FACETS = 10, 18
_ROUND_ARC_SEGMENTS, _ROUND_FACETS = 36, 72
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
    return _mesh(_prism(block_type))


@functools.cache
def drawn_mesh(block_type: BlockType) -> Mesh:
    """The surface as pictures show it: as `solid_mesh`, but finer where the block is round."""
    mesh = _mesh(_prism(block_type, _ROUND_ARC_SEGMENTS, _ROUND_FACETS))
    return Mesh(rounded(mesh.vertices_m), mesh.triangles)


def _mesh(prism: _Prism) -> Mesh:
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


def _arc(radius_m: float, segments: int) -> Outline:
    """Half a circle above the first axis, from angle 0 to 180 degrees, shape (segments + 1, 2)."""
    angles = np.linspace(0.0, math.pi, segments + 1)
    return np.stack([radius_m * np.cos(angles), radius_m * np.sin(angles)], axis=1)


def _fan(corners: int) -> tuple[tuple[int, int, int], ...]:
    return tuple((0, i, i + 1) for i in range(1, corners - 1))


def _convex(outline: Outline, half_m: float, plane: tuple[int, int], axis: int) -> _Prism:
    return _Prism(outline, half_m, plane, axis, (outline,), _fan(len(outline)))


@functools.cache
def _prism(
    block_type: BlockType, arc_segments: int = _ARC_SEGMENTS, facets: int = _FACETS
) -> _Prism:
    """A block with half circles of so many segments, and circles of so many facets.

    Raises ValueError for a type that has no outline here.
    """
    shape = SHAPES[block_type]
    high = shape.high_m
    if block_type == "arch":
        return _arch_prism(arc_segments)
    if block_type == "semi_cylinder":
        return _convex(_arc(high[1], arc_segments), high[0], (1, 2), 0)
    if block_type == "triangle":
        corners = np.array([[high[1], 0.0], [0.0, high[2]], [-high[1], 0.0]])
        return _convex(corners, high[0], (1, 2), 0)
    if block_type == "cylinder":
        angles = np.radians(np.arange(facets) * (360 / facets))
        circle = high[0] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        return _convex(circle, high[2], (0, 1), 2)
    if not shape.is_box:
        raise ValueError(f"{block_type} has no geometry")
    x, y, z = high
    return _convex(np.array([[x, y], [-x, y], [-x, -y], [x, -y]]), z, (0, 1), 2)


def _arch_prism(segments: int) -> _Prism:
    half_x, half_y, half_z = SHAPES["arch"].high_m
    arc = _arc(_ARCH_HOLE_RADIUS_M, segments) - [0.0, half_z]
    right_foot, right_top = [half_y, -half_z], [half_y, half_z]
    left_foot, left_top = [-half_y, -half_z], [-half_y, half_z]
    outline = np.array([*arc[::-1], right_foot, right_top, left_top, left_foot])
    right_leg = np.array([arc[0], right_foot, right_top, [arc[1, 0], half_z], arc[1]])
    left_leg = np.array([arc[-1], arc[-2], [arc[-2, 0], half_z], left_top, left_foot])
    slices = [
        np.array([arc[i], [arc[i, 0], half_z], [arc[i + 1, 0], half_z], arc[i + 1]])
        for i in range(1, segments - 1)
    ]
    last = segments
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
