"""Blocks: Euler angles, orientation classes, sizes and masses by geometry; laws of AOV graphs."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from phyblock.domain import blocks as domain
from phyblock.domain.blocks import BLOCK_TYPES, SHAPES, orientation_class
from phyblock.domain.scene import AOVGraph, CycleError, angles_deg
from tests.scoring.cases import acyclic, any_edges
from tests.shipped import official_tasks

ANGLES = st.floats(-720, 720)
EULERS = st.tuples(ANGLES, ANGLES, ANGLES)
GRID_EULERS = st.tuples(*[st.sampled_from([-90, 0, 30, 45, 60, 90, 120, 180, 270])] * 3)
TYPES = st.sampled_from(BLOCK_TYPES)


def arc(radius, step_deg, end_deg=180):
    """Points around the origin, from the first axis on."""
    angles = np.radians(np.arange(0, end_deg + 1, step_deg))
    return [(radius * math.cos(angle), radius * math.sin(angle)) for angle in angles]


def extruded(profile_yz):
    return np.array([(x, y, z) for x in (-0.025, 0.025) for y, z in profile_yz])


def box(x, y, z):
    return np.array(list(itertools.product((-x, x), (-y, y), (-z, z))))


# Vertices [m], written here apart from the package: a block looks the same in two orientations
# when its vertices fall on the same points.
VERTICES = {
    "cube": box(0.025, 0.025, 0.025),
    "cuboid1": box(0.025, 0.025, 0.0125),
    "cuboid2": box(0.05, 0.025, 0.0125),
    "cuboid3": box(0.075, 0.025, 0.0125),
    "cylinder": np.array([(*at, z) for at in arc(0.025, 20, 340) for z in (-0.05, 0.05)]),
    "semi_cylinder": extruded(arc(0.025, 18)),
    "triangle": extruded([(-0.05 / 2**0.5, 0), (0.05 / 2**0.5, 0), (0, 0.05 / 2**0.5)]),
    "arch": extruded(
        [(-0.05, -0.025), (0.05, -0.025), (0.05, 0.025), (-0.05, 0.025)]
        + [(y, z - 0.025) for y, z in arc(0.0375, 18)]
    ),
}


def looks_alike(block_type, one, other):
    a, b = one.apply(VERTICES[block_type]), other.apply(VERTICES[block_type])
    distance_m = np.linalg.norm(a[:, None] - b[None], axis=2)
    return bool(distance_m.min(axis=0).max() < 1e-5 and distance_m.min(axis=1).max() < 1e-5)


def rotation(euler_deg):
    return Rotation.from_euler("xyz", euler_deg, degrees=True)


@given(euler_deg=EULERS)
def test_euler_angles_are_extrinsic_x_y_z(euler_deg):
    quat_xyzw, expected = domain.euler_deg_to_quat_xyzw(euler_deg), rotation(euler_deg)
    same_sign = np.sign(quat_xyzw @ expected.as_quat())
    np.testing.assert_allclose(same_sign * quat_xyzw, expected.as_quat(), atol=1e-9)
    matrix = domain.quat_xyzw_to_matrix(quat_xyzw)
    np.testing.assert_allclose(matrix, expected.as_matrix(), atol=1e-9)


@given(TYPES, GRID_EULERS, GRID_EULERS, st.tuples(*[st.integers(-2, 2)] * 3))
def test_orientations_are_one_class_exactly_when_the_block_looks_alike(kind, one, other, turns):
    """And whole turns change nothing."""
    more = tuple(angle + 360 * turn for angle, turn in zip(one, turns, strict=True))
    name, second, third = (orientation_class(kind, euler) for euler in (one, other, more))
    assert (name == second) == looks_alike(kind, rotation(one), rotation(other))
    assert third == name


TURNS = [*itertools.product((0, 90, 180, 270), repeat=3), *((0, 0, n) for n in range(20, 360, 20))]
SYMMETRIES = {
    kind: [one for one in map(rotation, TURNS) if looks_alike(kind, one, Rotation.identity())]
    for kind in BLOCK_TYPES
}


@given(block_type=TYPES, euler_deg=GRID_EULERS, data=st.data())
def test_a_symmetry_of_the_block_leaves_its_class(block_type, euler_deg, data):
    turn = data.draw(st.sampled_from(SYMMETRIES[block_type]))
    again = angles_deg((rotation(euler_deg) * turn).as_matrix())
    assert orientation_class(block_type, again) == orientation_class(block_type, euler_deg)


def test_on_the_official_data_classes_and_euler_angles_tell_the_same_apart(official_checkout):
    used = {}
    for task in official_tasks(official_checkout):
        for block in (*task.scene.blocks, *task.candidates.candidates):
            used.setdefault(block.type, set()).add(block.euler_deg)
    for block_type, eulers in used.items():
        classes = {orientation_class(block_type, euler) for euler in eulers}
        assert len(classes) == len(eulers), block_type


@pytest.mark.parametrize("block_type", BLOCK_TYPES)
def test_sizes_are_those_of_the_kit(block_type):
    shape = SHAPES[block_type]
    np.testing.assert_allclose(shape.low_m, VERTICES[block_type].min(axis=0), atol=1e-9)
    np.testing.assert_allclose(shape.high_m, VERTICES[block_type].max(axis=0), atol=1e-9)
    assert shape.mass_kg == pytest.approx(1040 * shape.volume_m3)


SEEDS = st.integers(0, 2**32 - 1)


@given(edges=acyclic(), seed=SEEDS, data=st.data())
def test_layers_ready_blocks_and_random_orders_follow_the_dependencies(edges, seed, data):
    graph, n = AOVGraph(edges), len(edges)
    for vertex, needed in enumerate(edges):
        assert graph.layers[vertex] == 1 + max((graph.layers[w] for w in needed), default=0)
    placed = data.draw(st.integers(0, (1 << n) - 1))
    inside = {v for v in range(n) if placed & 1 << v}
    expected = [v for v in range(n) if v not in inside and edges[v] <= inside]
    assert list(graph.ready(placed)) == expected
    assert [v for v in range(n) if graph.is_ready(v, placed)] == expected
    order = graph.random_order(np.random.default_rng(seed))
    assert graph.is_valid(order)
    assert order == graph.random_order(np.random.default_rng(seed))


@given(edges=acyclic(max_size=5), data=st.data())
def test_valid_orders_are_the_permutations_that_respect_every_dependency(edges, data):
    graph, n = AOVGraph(edges), len(edges)
    others = data.draw(st.lists(st.lists(st.integers(-1, n), max_size=n + 1), max_size=20))
    for order in [*itertools.permutations(range(n)), *others]:
        at = {vertex: i for i, vertex in enumerate(order)}
        is_whole = sorted(order) == [*range(n)]
        assert graph.is_valid(order) == (
            is_whole and all(at[w] < at[v] for v, needed in enumerate(edges) for w in needed)
        )


def test_random_orders_reach_every_order():
    graph = AOVGraph((frozenset(), frozenset(), frozenset({0}), frozenset()))
    rng = np.random.default_rng(7)
    drawn = {graph.random_order(rng) for _ in range(400)}
    assert drawn == {o for o in itertools.permutations(range(4)) if graph.is_valid(o)}


@given(edges=any_edges())
def test_a_graph_is_refused_exactly_when_no_order_exists(edges):
    left = set(range(len(edges)))
    while free := {v for v in left if not edges[v] & left}:
        left -= free
    if not left:
        assert AOVGraph(edges).is_valid(AOVGraph(edges).random_order(np.random.default_rng(0)))
        return
    with pytest.raises(CycleError) as caught:
        AOVGraph(edges)
    cycle = caught.value.vertices
    assert len(set(cycle)) == len(cycle) >= 1
    assert all(after in edges[v] for v, after in zip(cycle, cycle[1:] + cycle[:1], strict=True))


def test_a_long_chain_needs_no_deep_recursion():
    n = 3000
    chain = AOVGraph(tuple(frozenset({v + 1}) if v + 1 < n else frozenset() for v in range(n)))
    assert chain.ready() == (n - 1,)
