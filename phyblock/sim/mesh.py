"""Triangle meshes and what follows from them: normals, volume, center of mass, inertia."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Mesh"]


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
        normals: NDArray[np.float64] = np.cross(b - a, c - a)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return normals

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

    def is_closed(self) -> bool:
        """Whether every edge is used exactly once in each direction."""
        edges = np.concatenate([self.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
        forward = {(int(a), int(b)) for a, b in edges}
        return len(forward) == len(edges) and all((b, a) in forward for a, b in forward)

    @functools.cached_property
    def _tetrahedra_m3(self) -> NDArray[np.float64]:
        volumes: NDArray[np.float64] = np.linalg.det(self.corners_m) / 6
        return volumes
