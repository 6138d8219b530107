"""Geometry of the blocks: meshes, convex pieces, and reproducible arithmetic for pictures.

`SHAPES` gives each prism a closed mesh for its inertia, a finer one for pictures, and convex pieces
for physics. Curved sides are polygons: a smooth cylinder rolls away where an 18-gon stands.

A BLAS sums in another order, and with fused operations, on other machines; C libraries differ in
the last digit of sines. Plain numpy arithmetic in 64 bits is the same everywhere, and so are
pictures made only with it (`dot`, `cross`, `turned`, `unit`) and a few rounded sines (`rounded`).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import SHAPES, BlockType, Euler, Profile, Shape, euler_deg_to_matrix
from phyblock.domain.scene import Block, CandidateSet, PoseStep

Vectors = NDArray[np.float64]

_DIGITS = 12


def dot(one: Vectors, other: Vectors) -> Vectors:
    """Scalar products along the last axis, which has length 3; the rest broadcasts."""
    terms = [one[..., axis] * other[..., axis] for axis in range(3)]
    return terms[0] + terms[1] + terms[2]


def cross(one: Vectors, other: Vectors) -> Vectors:
    """Vector products along the last axis, as `np.cross` but three times as fast."""
    a, b, c = one[..., 0], one[..., 1], one[..., 2]
    x, y, z = other[..., 0], other[..., 1], other[..., 2]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def turned(points: Vectors, matrix: Vectors) -> Vectors:
    """The matrix (3, 3) applied to points (..., 3), as in `points @ matrix.T`."""
    return np.stack([dot(points, row) for row in matrix], axis=-1)


def unit(vectors: Vectors) -> Vectors:
    """Vectors (..., 3) scaled to length 1; none may be zero."""
    return vectors / np.sqrt(dot(vectors, vectors))[..., None]


def rounded(numbers: Vectors) -> Vectors:
    """Numbers to 12 decimals, on which C libraries agree; zeros have no sign."""
    return np.round(numbers, _DIGITS) + 0.0


def significant(number: float) -> float:
    """A number to 12 significant digits, on which machines agree."""
    return float(f"{number:.{_DIGITS}g}")


_SMOOTH_COSINE = math.cos(math.radians(30))
"""Triangles that meet at a smaller angle are parts of one surface, flat or curved."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices (n, 3) [m] and triangles (m, 3) of a mesh, counter-clockwise seen from outside."""

    vertices_m: NDArray[np.float64]
    triangles: NDArray[np.int64]

    @functools.cached_property
    def corners_m(self) -> NDArray[np.float64]:
        """Corner points of every triangle, shape (m, 3, 3) [m]."""
        return self.vertices_m[self.triangles]

    @functools.cached_property
    def normals(self) -> NDArray[np.float64]:
        """Outward unit normal of every triangle, shape (m, 3)."""
        a, b, c = self.corners_m.transpose(1, 0, 2)
        return unit(cross(b - a, c - a))

    @functools.cached_property
    def faces(self) -> NDArray[np.int64]:
        """The face of each triangle, (m,), by its first triangle: neighbors within 30 degrees."""
        number = list(range(len(self.triangles)))
        owner: dict[tuple[int, int], int] = {}
        for one, (a, b, c) in enumerate(self.triangles.tolist()):
            for start, end in ((a, b), (b, c), (c, a)):
                owner[start, end] = one
                other = owner.get((end, start), one)
                if other != one and dot(self.normals[other], self.normals[one]) > _SMOOTH_COSINE:
                    low, high = sorted((number[other], number[one]))
                    number = [low if each == high else each for each in number]
        return np.array(number)

    @functools.cached_property
    def corner_normals(self) -> NDArray[np.float64]:
        """Outward unit normal of the face, flat or round, at each corner, shape (m, 3, 3)."""
        before, after = (np.roll(self.corners_m, n, axis=1) - self.corners_m for n in (1, -1))
        sines = np.sqrt(dot(crossed := cross(after, before), crossed))
        angles = rounded(np.arctan2(sines, dot(after, before)))
        corner = self.triangles * len(self.triangles) + self.faces[:, None]
        _, place = np.unique(corner, return_inverse=True)
        place = place.reshape(corner.shape)
        sums = np.zeros((int(place.max()) + 1, 3))
        np.add.at(sums, place, angles[..., None] * self.normals[:, None])
        return rounded(unit(sums[place]))


@dataclass(frozen=True, eq=False)
class ConvexPiece:
    """A convex polytope; a unit vector (3,) for each set of parallel faces, and of edges."""

    vertices_m: NDArray[np.float64]
    face_normals: NDArray[np.float64]
    edge_directions: NDArray[np.float64]


@functools.cache
def solid_mesh(block_type: BlockType) -> Mesh:
    """The block's surface: closed, outward, every corner once, in the body frame."""
    return _mesh(SHAPES[block_type], SHAPES[block_type].profile)


@functools.cache
def principal_inertia_m2(block_type: BlockType) -> tuple[float, float, float]:
    """Moments of inertia of the solid about its body axes through its center, per mass [m2]."""
    shape = SHAPES[block_type]
    centered = solid_mesh(block_type).corners_m - np.array(shape.center_of_mass_m)
    volumes = np.linalg.det(centered) / 6
    sums = centered.sum(axis=1)
    second: NDArray[np.float64] = np.einsum("t,tci,tcj->ij", volumes, centered, centered)
    second += np.einsum("t,ti,tj->ij", volumes, sums, sums)
    second /= 20 * shape.volume_m3
    x, y, z = map(significant, np.diag(np.trace(second) * np.eye(3) - second).tolist())
    return x, y, z


@functools.cache
def drawn_mesh(block_type: BlockType) -> Mesh:
    """The surface in pictures: as `solid_mesh`, but finer if the block is round."""
    shape = SHAPES[block_type]
    mesh = _mesh(shape, shape.drawn or shape.profile)
    return Mesh(rounded(mesh.vertices_m), mesh.triangles)


def _mesh(shape: Shape, profile: Profile) -> Mesh:
    n, half_m = len(profile.outline), shape.length_m / 2
    vertices = np.vstack([_cap(shape, profile.outline, along) for along in (-half_m, half_m)])
    triangles: list[tuple[int, int, int]] = []
    for a, b, c in profile.caps:
        triangles += [(c, b, a), (n + a, n + b, n + c)]
    for i in range(n):
        j = (i + 1) % n
        triangles += [(i, j, n + j), (i, n + j, n + i)]
    return Mesh(vertices, np.array(triangles))


def _cap(shape: Shape, outline: Vectors, along_m: float) -> Vectors:
    """The outline (n, 2) in the body frame at a place along the axis, shape (n, 3) [m]."""
    return np.insert(outline, 0 if shape.axis == "x" else 2, along_m, axis=1)


def corners_m(
    block_type: BlockType, position_m: tuple[float, float, float], euler_deg: Euler
) -> NDArray[np.float64]:
    """World corners of a block's solid at a pose, shape (n, 3) [m]."""
    corners: Vectors = solid_mesh(block_type).vertices_m @ euler_deg_to_matrix(euler_deg).T
    corners += np.array(position_m)
    return corners


def centers_m(blocks: Sequence[Block]) -> NDArray[np.float64]:
    """The centers of mass of blocks at their poses, shape (n, 3) [m]."""
    centers = np.zeros((len(blocks), 3))
    for center, b in zip(centers, blocks, strict=True):
        center += euler_deg_to_matrix(b.euler_deg) @ np.array(SHAPES[b.type].center_of_mass_m)
        center += b.position_m
    return centers


@functools.cache
def collision_pieces(block_type: BlockType, inset_m: float = 0.0) -> tuple[ConvexPiece, ...]:
    """Convex pieces that fill the block, ten of an arch, every plane `inset_m` [m] further in."""
    shape = SHAPES[block_type]
    half_m = shape.length_m / 2 - inset_m
    axis = np.array([1.0, 0.0, 0.0] if shape.axis == "x" else [0.0, 0.0, 1.0])
    pieces = []
    for part in shape.profile.parts:
        sides = np.roll(part, -1, axis=0) - part
        outward = np.stack([sides[:, 1], -sides[:, 0]], axis=1)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        offsets = np.einsum("ij,ij->i", outward, part) - inset_m
        pairs = np.stack([np.roll(outward, 1, axis=0), outward], axis=1)
        rights = np.stack([np.roll(offsets, 1), offsets], axis=1)
        outline = np.linalg.solve(pairs, rights[..., None])[..., 0]
        vertices = np.vstack([_cap(shape, outline, along) for along in (-half_m, half_m)])
        sides = _cap(shape, np.roll(outline, -1, axis=0) - outline, 0.0)
        edges: list[NDArray[np.float64]] = []
        for side in sides / np.linalg.norm(sides, axis=1, keepdims=True):
            if all(abs(side @ other) < 1 - 1e-9 for other in edges):  # Not parallel to one before.
                edges.append(side)
        normals = np.cross(np.array(edges), axis)
        pieces.append(ConvexPiece(vertices, np.vstack([normals, axis]), np.vstack([edges, axis])))
    return tuple(pieces)


_CM = 100.0


def center_cm(block: Block) -> tuple[float, float, float]:
    """The center of the box around a block at its pose [cm]."""
    x, y, z = (np.array(block.position_m) + _box_middle_m(block.type, block.euler_deg)) * _CM
    return float(x), float(y), float(z)


def box_height_cm(block: Block) -> float:
    """The height of the box around a block in its orientation [cm]."""
    return float(np.ptp(corners_m(block.type, (0.0, 0.0, 0.0), block.euler_deg)[:, 2])) * _CM


def origin_m(
    block_type: BlockType, euler_deg: Euler, center_cm: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return the origin of the body frame [m] of a block whose box has this center [cm]."""
    x, y, z = np.array(center_cm) / _CM - _box_middle_m(block_type, euler_deg)
    return float(x), float(y), float(z)


def put(step: PoseStep, candidates: CandidateSet) -> Block | None:
    """The block of a step, in the orientation of its candidate; None if it names none."""
    if not 1 <= step.candidate <= len(candidates):
        return None
    candidate = candidates[step.candidate]
    place = origin_m(candidate.type, candidate.euler_deg, step.center_cm)
    return Block(1, candidate.type, candidate.color, place, candidate.euler_deg, (), 1)


@functools.lru_cache(maxsize=4096)
def _box_middle_m(block_type: BlockType, euler_deg: Euler) -> NDArray[np.float64]:
    """The center of the box around a block with its body frame at the origin, shape (3,) [m]."""
    corners = corners_m(block_type, (0.0, 0.0, 0.0), euler_deg)
    middle: NDArray[np.float64] = (corners.min(axis=0) + corners.max(axis=0)) / 2
    middle.setflags(write=False)
    return middle
