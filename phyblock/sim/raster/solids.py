"""Props as one table of triangles in the world, with all that drawing asks of a triangle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import quat_xyzw_to_matrix
from phyblock.sim.exact import rounded, turned
from phyblock.sim.renderer import Prop

__all__ = ["Solids", "solids"]

Floats = NDArray[np.float64]

_FLAT = 1e-9
"""Unit normals that differ by less in each component are those of one plane."""


@dataclass(frozen=True, eq=False)
class Solids:
    """Triangles of all props, n of them.

    `corners_m` shape (n, 3, 3) [m] in the world; `anchor_m` (n, 3) [m] a point of the plane that
    is the same for all triangles of a flat face; `normals` (n, 3) of the triangles, unit;
    `bends` (n, 3, 3) of the surface at their corners; `prop` (n,) the place of the prop in the
    list; `face` (n,) the face's number within it.
    """

    corners_m: Floats
    anchor_m: Floats
    normals: Floats
    bends: Floats
    prop: NDArray[np.int64]
    face: NDArray[np.int64]

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Solids:
        """Some of the triangles."""
        return Solids(
            self.corners_m[chosen],
            self.anchor_m[chosen],
            self.normals[chosen],
            self.bends[chosen],
            self.prop[chosen],
            self.face[chosen],
        )


def solids(props: Sequence[Prop]) -> Solids:
    """The table of some props, one at least.

    Its order does not depend on theirs, so that of two faces in one place the same one shows.
    """
    places = sorted(range(len(props)), key=lambda place: _name(props[place]))
    parts = [_placed(props[place], place) for place in places]
    return Solids(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _name(prop: Prop) -> tuple[object, ...]:
    pose = prop.pose
    return (
        pose.position_m.tolist(),
        pose.quat_xyzw.tolist(),
        prop.rgb,
        prop.mesh.vertices_m.ravel().tolist(),
    )


def _placed(prop: Prop, place: int) -> tuple[NDArray[np.float64] | NDArray[np.int64], ...]:
    mesh = prop.mesh
    matrix = rounded(quat_xyzw_to_matrix(prop.pose.quat_xyzw))
    corners_m = turned(mesh.corners_m, matrix) + prop.pose.position_m
    apart = np.abs(mesh.normals - mesh.normals[mesh.faces]).max(axis=1)
    anchors = np.where(apart < _FLAT, mesh.faces, np.arange(len(corners_m)))
    return (
        corners_m,
        corners_m[anchors, 0],
        turned(mesh.normals, matrix),
        turned(mesh.corner_normals, matrix),
        np.full(len(corners_m), place),
        mesh.faces,
    )
