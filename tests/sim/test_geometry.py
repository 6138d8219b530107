"""Geometry: the blocks themselves, and blocks in contact."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from phyblock.domain.blocks import BLOCK_TYPES, KIT_PALETTE, SHAPES
from phyblock.sim import contact
from phyblock.sim.contact import find_gaps, find_overlaps, separating_axes, support_graph
from phyblock.sim.geometry import collision_pieces, drawn_mesh, solid_mesh
from tests.shipped import TASKS
from tests.sim.structures import angles_deg, block, block_types, eulers, tower, turned

every_type = pytest.mark.parametrize("block_type", BLOCK_TYPES)


@every_type
def test_mass_and_extent_are_those_of_the_block_library(block_type):
    """What is drawn is the solid made round, of closed faces: full circles hold 2 % more than
    18-gons, and half circles 2 % more than ten chords.
    """
    solid, drawn, shape = solid_mesh(block_type), drawn_mesh(block_type), SHAPES[block_type]
    parts_m3, drawn_m3 = (np.linalg.det(mesh.corners_m) / 6 for mesh in (solid, drawn))
    assert_allclose(parts_m3.sum(), shape.volume_m3, rtol=1e-9)
    center_m = parts_m3 @ solid.corners_m.sum(axis=1) / 4 / parts_m3.sum()
    assert_allclose(center_m, shape.center_of_mass_m, atol=1e-9)
    assert drawn_m3.sum() == pytest.approx(shape.volume_m3, rel=0.025)
    for mesh, off_m in ((solid, 1e-9), (drawn, 4e-4)):
        assert_allclose(mesh.vertices_m.min(axis=0), shape.low_m, atol=off_m)
        assert_allclose(mesh.vertices_m.max(axis=0), shape.high_m, atol=off_m)
    edges = [(a, b) for one in drawn.triangles.tolist() for a, b in pairwise([*one, one[0]])]
    assert sorted(edges) == sorted({(b, a) for a, b in edges})


@every_type
def test_pieces_are_convex_and_fill_the_block(block_type):
    pieces = collision_pieces(block_type)
    assert len(pieces) == (10 if block_type == "arch" else 1)
    hulls = [ConvexHull(piece.vertices_m) for piece in pieces]
    assert_allclose(sum(hull.volume for hull in hulls), SHAPES[block_type].volume_m3, rtol=1e-9)
    for hull, piece in zip(hulls, pieces, strict=True):
        assert len(hull.vertices) == len(piece.vertices_m)


@every_type
def test_inset_moves_every_plane_by_that_much(block_type):
    full, inset = collision_pieces(block_type), collision_pieces(block_type, 0.001)
    for outer, inner in zip(full, inset, strict=True):
        planes = ConvexHull(outer.vertices_m).equations
        for normal in (*outer.face_normals, *-outer.face_normals):
            if np.any(planes[:, :3] @ normal > 1 - 1e-9):
                moved_m = (outer.vertices_m @ normal).max() - (inner.vertices_m @ normal).max()
                assert moved_m == pytest.approx(0.001, abs=1e-9)


FACES = {"arch": 8, "cylinder": 3, "semi_cylinder": 4, "triangle": 5}


@every_type
@pytest.mark.parametrize("mesh_of", [solid_mesh, drawn_mesh])
def test_a_round_side_is_one_face(mesh_of, block_type):
    assert len(set(mesh_of(block_type).faces.tolist())) == FACES.get(block_type, 6)


@pytest.mark.parametrize(("block_type", "color"), KIT_PALETTE)
def test_extents_are_those_of_the_official_mesh(block_type, color, official_checkout):
    """Of its part in the block's color, without black edges."""
    path = official_checkout / "data" / "block_assets" / f"{block_type}_{color}.obj"
    vertices, used, colored = [], set(), False
    for word, *rest in filter(None, map(str.split, path.read_text(encoding="utf-8").splitlines())):
        colored = rest[0].startswith("block_") if word == "usemtl" else colored
        if word == "v":
            vertices.append([float(number) for number in rest])
        elif word == "f" and colored:
            used |= {int(corner.split("/")[0]) - 1 for corner in rest}
    points, solid = np.array([vertices[number] for number in used]), solid_mesh(block_type)
    for end in (np.min, np.max):
        assert_allclose(end(points, axis=0), end(solid.vertices_m, axis=0), atol=1e-4)


shifts_m = st.floats(-0.12, 0.12)


def share_a_point(first, second):
    """True if two convex hulls meet, asked of a linear program."""
    n, m = len(first.vertices_m), len(second.vertices_m)
    equal = np.zeros((5, n + m))
    equal[:3, :n], equal[:3, n:] = first.vertices_m.T, -second.vertices_m.T
    equal[3, :n], equal[4, n:] = 1.0, 1.0
    answer = linprog(np.zeros(n + m), A_eq=equal, b_eq=[0, 0, 0, 1, 1], bounds=(0, None))
    return bool(answer.status == 0)


@st.composite
def pairs(draw, heights_m):
    """Two convex pieces, the second at one of these heights above the first."""
    place_m = (draw(shifts_m), draw(shifts_m), draw(heights_m))
    first = block(1, draw(block_types), (0.0, 0.0, 0.0), draw(eulers))
    second = block(2, draw(block_types), place_m, draw(eulers))
    return contact.pieces_of(first)[0], contact.pieces_of(second)[0]


@given(pairs(shifts_m))
@settings(max_examples=60)
def test_separation_agrees_with_a_linear_program(pair):
    first, second = pair
    gap_m = separating_axes(first, second).gap_m
    assume(abs(gap_m) > 1e-5)
    assert share_a_point(first, second) == (gap_m < 0)
    assert separating_axes(second, first).gap_m == pytest.approx(gap_m, abs=1e-12)


@given(pairs(st.just(0.4)))
@settings(max_examples=60)
def test_a_block_falls_just_until_it_touches(pair):
    first, second = pair
    fall_m = contact.drop_m(separating_axes(first, second))
    low = replace(second, vertices_m=second.vertices_m - [0.0, 0.0, fall_m or 0.4])
    gap_m = separating_axes(first, low).gap_m
    assert gap_m > -1e-9 if fall_m is None else gap_m == pytest.approx(0.0, abs=1e-9)


@given(angles_deg, shifts_m, shifts_m, st.integers(1, 5))
@settings(max_examples=25)
def test_support_of_a_turned_tower(angle_deg, x, y, height):
    graph = support_graph(turned(tower(height), angle_deg, (x, y)))
    assert graph == {i + 1: frozenset({i}) for i in range(height)}


def test_supports_of_built_in_scenes_are_those_that_they_declare():
    for task in TASKS[::16]:
        blocks = task.scene.blocks
        assert not find_gaps(blocks), task.scene.id
        assert not find_overlaps(blocks), task.scene.id
        for some in (blocks, blocks[::-1]):
            declared = {one.order: set(one.depend or [contact.GROUND]) for one in some}
            assert support_graph(some) == declared, task.scene.id


@given(st.floats(-0.02, 0.3))
def test_a_block_hangs_or_overlaps_by_what_it_was_moved(rise_m):
    assume(abs(rise_m) > 0.0011)
    pair = [*tower(1), block(2, "cube", (0.0, 0.0, 0.075 + rise_m))]
    gaps, overlaps = find_gaps(pair, 0.001), find_overlaps(pair, 0.001)
    assert [*gaps] == [2] * (rise_m > 0)
    assert [(one.first, one.second) for one in overlaps] == [(1, 2)] * (rise_m < 0)
    found_m = gaps[2] if gaps else -overlaps[0].depth_m
    assert found_m == pytest.approx(rise_m, abs=1e-9)


def test_a_plank_rests_on_both_its_posts_and_nothing_under_the_arch():
    posts = [block(i, "cube", (0.0, y, 0.025)) for i, y in ((1, -0.05), (2, 0.05))]
    plank = block(3, "cuboid3", (0.0, 0.0, 0.0625), (0.0, 0.0, 90.0))
    arch = block(4, "arch", (0.0, 0.0, 0.1))
    under = block(5, "semi_cylinder", (0.0, 0.0, 0.075))
    graph = support_graph([*posts, plank, arch, under])
    assert (graph[3], graph[4], graph[5]) == ({1, 2}, {3}, {3})
    # An edge on a face carries; on its border it counts where there is nothing else.
    for y in (0.0, 0.025):
        edge = block(2, "triangle", (0.0, y, 0.05 + 0.05 / 2**0.5), (180.0, 0.0, 0.0))
        assert support_graph([*tower(1), edge])[2] == {1}
