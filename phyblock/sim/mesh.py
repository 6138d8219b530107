"""Triangle meshes and what follows: normals, faces, volume, center of mass, inertia."""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.sim.exact import cross, dot, rounded, unit

__all__ = ["Mesh"]

_SMOOTH_COSINE = math.cos(math.radians(30))
"""Triangles that meet at a smaller angle are parts of one surface, flat or curved."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh: `vertices_m` shape (n, 3) [m], `triangles` shape (m, 3), 0-based.

    Corners run counter-clockwise seen from outside. The mass properties are those of the solid
    that a closed mesh bounds, by the divergence theorem: sums over the tetrahedra that the
    triangles span with the origin.
    """

    vertices_m: NDArray[np.float64]
    triangles: NDArray[np.int64]

    @functools.cached_property
    def corners_m(self) -> NDArray[np.float64]:
        """Corner points of every triangle, shape (m, 3, 3) [m]."""
        corners: NDArray[np.float64] = self.vertices_m[self.triangles]
        return corners

    @functools.cached_property
    def normals(self) -> NDArray[np.float64]:
        """Outward unit normal of every triangle, shape (m, 3)."""
        a, b, c = self.corners_m.transpose(1, 0, 2)
        return unit(cross(b - a, c - a))

    @functools.cached_property
    def faces(self) -> NDArray[np.int64]:
        """The face that each triangle is part of, shape (m,), by the number of its first triangle.

        Neighbors whose normals differ by less than 30 degrees are parts of one face, which is flat
        or curved.
        """
        number = list(range(len(self.triangles)))
        for one, other in self._neighbors():
            if dot(self.normals[one], self.normals[other]) > _SMOOTH_COSINE:
                low, high = sorted((number[one], number[other]))
                number = [low if each == high else each for each in number]
        return np.array(number)

    @functools.cached_property
    def corner_normals(self) -> NDArray[np.float64]:
        """Outward unit normal of the face at each corner of every triangle, shape (m, 3, 3).

        On a curved face it is the mean of the triangles' around the corner, each counted by its
        angle there, which makes the facets of a cylinder look round.
        """
        before, after = (np.roll(self.corners_m, n, axis=1) - self.corners_m for n in (1, -1))
        sines = np.sqrt(dot(crossed := cross(after, before), crossed))
        angles = rounded(np.arctan2(sines, dot(after, before)))
        corner = self.triangles * len(self.triangles) + self.faces[:, None]
        _, place = np.unique(corner, return_inverse=True)
        place = place.reshape(corner.shape)
        sums = np.zeros((int(place.max()) + 1, 3))
        np.add.at(sums, place, angles[..., None] * self.normals[:, None])
        return rounded(unit(sums[place]))

    @functools.cached_property
    def volume_m3(self) -> float:
        """Volume of the solid [m3]."""
        return float(self._tetrahedra_m3.sum())

    @functools.cached_property
    def center_of_mass_m(self) -> NDArray[np.float64]:
        """Center of mass of the solid, shape (3,) [m]."""
        moments: NDArray[np.float64] = self._tetrahedra_m3 @ self.corners_m.sum(axis=1) / 4
        return moments / self.volume_m3

    @functools.cached_property
    def inertia_m2(self) -> NDArray[np.float64]:
        """Inertia about the center of mass for a unit mass, shape (3, 3) [m2]."""
        centered = self.corners_m - self.center_of_mass_m
        volumes = np.linalg.det(centered) / 6
        sums = centered.sum(axis=1)
        second: NDArray[np.float64] = np.einsum("t,tci,tcj->ij", volumes, centered, centered)
        second += np.einsum("t,ti,tj->ij", volumes, sums, sums)
        second /= 20 * self.volume_m3
        inertia: NDArray[np.float64] = np.trace(second) * np.eye(3) - second
        return inertia

    def _neighbors(self) -> list[tuple[int, int]]:
        """Pairs of triangles that share an edge."""
        beside: dict[tuple[int, int], int] = {}
        pairs = []
        for number, (a, b, c) in enumerate(self.triangles.tolist()):
            for start, end in ((a, b), (b, c), (c, a)):
                if (end, start) in beside:
                    pairs.append((beside[end, start], number))
                beside[start, end] = number
        return pairs

    @functools.cached_property
    def _tetrahedra_m3(self) -> NDArray[np.float64]:
        volumes: NDArray[np.float64] = np.linalg.det(self.corners_m) / 6
        return volumes
