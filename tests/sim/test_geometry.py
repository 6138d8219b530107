from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import ConvexHull

from phyblock.domain import BLOCK_TYPES, KIT_PALETTE, SHAPES, BlockType, Color
from phyblock.sim.geometry import Mesh, collision_pieces, drawn_mesh, solid_mesh

every_type = pytest.mark.parametrize("block_type", BLOCK_TYPES)


def is_closed(mesh: Mesh) -> bool:
    """True if every edge is used exactly once in each direction."""
    edges = np.concatenate([mesh.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    forward = {(int(a), int(b)) for a, b in edges}
    return len(forward) == len(edges) and all((b, a) in forward for a, b in forward)


@every_type
def test_mass_and_extent_are_those_of_the_block_library(block_type: BlockType) -> None:
    solid, shape = solid_mesh(block_type), SHAPES[block_type]
    assert_allclose(solid.volume_m3, shape.volume_m3, rtol=1e-9)
    assert_allclose(solid.center_of_mass_m, shape.center_of_mass_m, atol=1e-9)
    assert_allclose(solid.vertices_m.min(axis=0), shape.low_m, atol=1e-9)
    assert_allclose(solid.vertices_m.max(axis=0), shape.high_m, atol=1e-9)


@every_type
def test_pieces_are_convex_and_fill_the_block(block_type: BlockType) -> None:
    pieces = collision_pieces(block_type)
    assert len(pieces) == (10 if block_type == "arch" else 1)
    hulls = [ConvexHull(piece.vertices_m) for piece in pieces]
    assert_allclose(sum(hull.volume for hull in hulls), SHAPES[block_type].volume_m3, rtol=1e-9)
    for hull, piece in zip(hulls, pieces, strict=True):
        assert len(hull.vertices) == len(piece.vertices_m)


@every_type
def test_inset_moves_every_plane_by_that_much(block_type: BlockType) -> None:
    inset_m = 0.001
    full, inset = collision_pieces(block_type), collision_pieces(block_type, inset_m)
    for outer, inner in zip(full, inset, strict=True):
        normals = np.vstack([outer.face_normals, -outer.face_normals])
        planes = ConvexHull(outer.vertices_m).equations
        for normal in normals:
            if np.any(planes[:, :3] @ normal > 1 - 1e-9):
                moved = (outer.vertices_m @ normal).max() - (inner.vertices_m @ normal).max()
                assert moved == pytest.approx(inset_m, abs=1e-9)


@every_type
def test_what_is_drawn_is_the_solid_made_round(block_type: BlockType) -> None:
    """Full circles hold 2 % more than 18-gons, and half circles 2 % more than ten chords."""
    drawn, solid, shape = drawn_mesh(block_type), solid_mesh(block_type), SHAPES[block_type]
    assert is_closed(drawn)
    assert drawn.volume_m3 == pytest.approx(solid.volume_m3, rel=0.025)
    assert_allclose(drawn.vertices_m.min(axis=0), shape.low_m, atol=4e-4)
    assert_allclose(drawn.vertices_m.max(axis=0), shape.high_m, atol=4e-4)


FACES = {"arch": 8, "cylinder": 3, "semi_cylinder": 4, "triangle": 5}


@every_type
@pytest.mark.parametrize("mesh_of", [solid_mesh, drawn_mesh])
def test_a_round_side_is_one_face(
    mesh_of: Callable[[BlockType], Mesh], block_type: BlockType
) -> None:
    assert len(set(mesh_of(block_type).faces.tolist())) == FACES.get(block_type, 6)


@pytest.mark.parametrize(("block_type", "color"), KIT_PALETTE)
def test_agrees_with_the_official_mesh(
    block_type: BlockType, color: Color, official_checkout: Path
) -> None:
    path = official_checkout / "data" / "block_assets" / f"{block_type}_{color}.obj"
    official, solid = _colored_part(path), solid_mesh(block_type)
    for low_or_high in (np.min, np.max):
        ours = low_or_high(solid.vertices_m, axis=0)
        theirs = low_or_high(official.vertices_m, axis=0)
        assert_allclose(ours, theirs, atol=1e-4)
    assert solid.volume_m3 == pytest.approx(official.volume_m3, rel=0.005)
    assert_allclose(solid.center_of_mass_m, official.center_of_mass_m, atol=1e-4)


def _colored_part(path: Path) -> Mesh:
    """The object of an OBJ whose material is the block's color, not its black edges."""
    vertices: list[list[float]] = []
    triangles: list[list[int]] = []
    colored = False
    for line in path.read_text(encoding="utf-8").splitlines():
        word, _, rest = line.partition(" ")
        if word == "v":
            vertices.append([float(number) for number in rest.split()])
        elif word == "usemtl":
            colored = rest.startswith("block_")
        elif word == "f" and colored:
            corners = [int(corner.split("/")[0]) - 1 for corner in rest.split()]
            triangles += [[corners[0], *corners[i : i + 2]] for i in range(1, len(corners) - 1)]
    used = sorted({corner for triangle in triangles for corner in triangle})
    number = {corner: index for index, corner in enumerate(used)}
    faces = [[number[corner] for corner in triangle] for triangle in triangles]
    return Mesh(np.array([vertices[corner] for corner in used]), np.array(faces))
