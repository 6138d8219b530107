from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from phyblock.data import read_official
from phyblock.domain import Block, euler_deg_to_quat_xyzw, quat_xyzw_to_matrix
from phyblock.sim.contact import (
    GROUND,
    drop_height_m,
    drop_m,
    find_gaps,
    find_overlaps,
    moved,
    separating_axes,
    support_graph,
)
from phyblock.sim.geometry import ConvexPiece, collision_pieces
from tests.sim.structures import angles_deg, block, block_types, clouds, eulers, tower, turned

OVERLAPPING = {"001", "003", "187", "214", "297", "342"}
FLOATING = {
    *("006", "040", "097", "116", "117", "153", "184", "212", "242", "254", "255"),
    *("274", "288", "290", "292", "307", "313", "318", "325", "327", "333"),
}
ANNOTATION_ERROR_M = 0.002

shifts_m = st.floats(-0.12, 0.12, allow_nan=False)


def placed(one: Block) -> list[ConvexPiece]:
    rotation = quat_xyzw_to_matrix(euler_deg_to_quat_xyzw(one.euler_deg))
    return [moved(p, rotation, np.array(one.position_m)) for p in collision_pieces(one.type)]


def share_a_point(first: ConvexPiece, second: ConvexPiece) -> bool:
    """True if two convex hulls meet, asked of a linear program."""
    n, m = len(first.vertices_m), len(second.vertices_m)
    equal = np.zeros((5, n + m))
    equal[:3, :n], equal[:3, n:] = first.vertices_m.T, -second.vertices_m.T
    equal[3, :n], equal[4, n:] = 1.0, 1.0
    answer = linprog(np.zeros(n + m), A_eq=equal, b_eq=[0, 0, 0, 1, 1], bounds=(0, None))
    return bool(answer.status == 0)


@given(block_types, eulers, block_types, eulers, shifts_m, shifts_m, shifts_m)
@settings(max_examples=60, deadline=None)
def test_separation_agrees_with_a_linear_program(one, turn, other, twist, x, y, z) -> None:
    first = placed(block(1, one, (0.0, 0.0, 0.0), turn))[0]
    second = placed(block(2, other, (x, y, z), twist))[0]
    gap_m = separating_axes(first, second).gap_m
    assume(abs(gap_m) > 1e-5)
    assert share_a_point(first, second) == (gap_m < 0)
    assert separating_axes(second, first).gap_m == pytest.approx(gap_m, abs=1e-12)


@given(block_types, eulers, block_types, eulers, shifts_m, shifts_m)
@settings(max_examples=60, deadline=None)
def test_a_block_falls_just_until_it_touches(one, turn, other, twist, x, y) -> None:
    first = placed(block(1, one, (0.0, 0.0, 0.0), turn))[0]
    second = placed(block(2, other, (x, y, 0.4), twist))[0]
    fall_m = drop_m(separating_axes(first, second))
    low = replace_height(second, -(fall_m or 0.4))
    gap_m = separating_axes(first, low).gap_m
    if fall_m is None:
        assert gap_m > -1e-9
    else:
        assert gap_m == pytest.approx(0.0, abs=1e-9)


def replace_height(piece: ConvexPiece, rise_m: float) -> ConvexPiece:
    return replace(piece, vertices_m=piece.vertices_m + np.array([0.0, 0.0, rise_m]))


@given(clouds(), angles_deg, shifts_m, shifts_m)
@settings(max_examples=25, deadline=None)
def test_turning_a_structure_changes_nothing(blocks, angle_deg, x, y) -> None:
    other = turned(blocks, angle_deg, (x, y))
    before = {(o.first, o.second): o.depth_m for o in find_overlaps(blocks, 1e-5)}
    after = {(o.first, o.second): o.depth_m for o in find_overlaps(other, 1e-5)}
    for pair in before.keys() | after.keys():
        assert before.get(pair, 0.0) == pytest.approx(after.get(pair, 0.0), abs=1.1e-5)
    for one, same in zip(blocks, other, strict=True):
        assert drop_height_m(same, []) == pytest.approx(drop_height_m(one, []), abs=1e-9)


@given(angles_deg, shifts_m, shifts_m, st.integers(1, 5))
@settings(max_examples=25, deadline=None)
def test_support_of_a_turned_tower(angle_deg, x, y, height) -> None:
    graph = support_graph(turned(tower(height), angle_deg, (x, y)))
    assert graph == {i + 1: frozenset({i}) for i in range(height)}


@given(st.floats(0.0011, 0.3))
def test_a_lifted_block_hangs_by_what_it_was_lifted(lift_m) -> None:
    lower, upper = tower(2)
    x, y, z = upper.position_m
    floating = replace(upper, position_m=(x, y, z + lift_m))
    (gap,) = find_gaps([lower, floating], 0.001)
    assert gap.order == 2
    assert gap.height_m == pytest.approx(lift_m, abs=1e-9)


@given(st.floats(0.0011, 0.02))
def test_a_sunken_block_overlaps_by_what_it_was_sunk(depth_m) -> None:
    lower, upper = tower(2)
    x, y, z = upper.position_m
    (overlap,) = find_overlaps([lower, replace(upper, position_m=(x, y, z - depth_m))], 0.001)
    assert (overlap.first, overlap.second) == (1, 2)
    assert overlap.depth_m == pytest.approx(depth_m, abs=1e-9)


def test_a_cylinder_on_its_ridge_rests_on_what_it_lies_on() -> None:
    """Turned so that a vertex of the 18-gon is lowest: a line of contact, with no area."""
    plank = block(1, "cuboid3", (0.0, 0.0, 0.0125))
    log = block(2, "cylinder", (0.0, 0.0, 0.05), (0.0, 90.0, 0.0))
    assert support_graph([plank, log])[2] == {1}


def test_a_plank_rests_on_both_its_posts_and_nothing_under_the_arch() -> None:
    posts = [block(i, "cube", (0.0, y, 0.025)) for i, y in ((1, -0.05), (2, 0.05))]
    plank = block(3, "cuboid3", (0.0, 0.0, 0.0625), (0.0, 0.0, 90.0))
    arch = block(4, "arch", (0.0, 0.0, 0.1))
    under = block(5, "semi_cylinder", (0.0, 0.0, 0.075))
    graph = support_graph([*posts, plank, arch, under])
    assert graph[3] == {1, 2}
    assert graph[4] == {3}
    assert graph[5] == {3}


@pytest.mark.slow
def test_all_official_scenes(official_checkout: Path) -> None:
    tasks = read_official(official_checkout).tasks
    assert _broken(tasks) == (OVERLAPPING, FLOATING)
    hits = found = declared = 0
    for task in tasks:
        graph = support_graph(task.scene.blocks)
        for one in task.scene.blocks:
            said, seen = set(one.depend) or {GROUND}, graph[one.order]
            hits, found, declared = hits + len(said & seen), found + len(seen), declared + len(said)
    assert hits / found > 0.98
    assert hits / declared > 0.98


def _broken(tasks) -> tuple[set[str], set[str]]:
    overlapping = {t.scene.id for t in tasks if find_overlaps(t.scene.blocks, ANNOTATION_ERROR_M)}
    floating = {t.scene.id for t in tasks if find_gaps(t.scene.blocks, ANNOTATION_ERROR_M)}
    return overlapping, floating
