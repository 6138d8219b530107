"""Laws of setting C: whom steps stand for, the two frames, and what cannot matter."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from phyblock.domain.blocks import BLOCK_TYPES, SHAPES, euler_deg_to_matrix, symmetries, turn_deg
from phyblock.domain.scene import Candidate, CandidateSet, Plan, Scene, angles_deg
from phyblock.scoring.plan import Goal, most_placed
from phyblock.scoring.pose import Motion, Nearness, PoseScorer, cheapest, matched, overlap_volume
from phyblock.sim.contact import pieces_of
from tests.scoring.cases import cases
from tests.sim.structures import block

KINDS = ("cube", "cuboid2", "triangle", "arch")
FLAT = (0.0, 0.0, 0.0)


@st.composite
def scenes(draw):
    """Blocks anywhere, in any valid order: geometry does not ask whether they would stand."""
    n = draw(st.integers(2, 6))
    grid = st.integers(-6, 6).map(lambda k: k * 0.025)
    blocks = []
    for order in range(1, n + 1):
        kind = draw(st.sampled_from(KINDS[: draw(st.integers(1, 4))]))
        turn = draw(st.integers(0, 3))
        place = (draw(grid), draw(grid), draw(st.integers(0, 5)) * 0.025)
        below = draw(st.sets(st.integers(1, n), max_size=2))
        depend = tuple(sorted(o for o in below if o < order))
        blocks.append(block(order, kind, place, (0.0, 0.0, 90.0 * turn), depend=depend))
    looks = {one.look: one for one in (*blocks, block(7, "cylinder", FLAT))}
    candidates = tuple(Candidate(*one.kind, one.euler_deg) for one in looks.values())
    return Scene("s", (2,), tuple(blocks), ("s",)), CandidateSet(candidates)


def scored(scene, candidates, steps, named=None):
    """Score blocks as steps that name the candidates which look so, or like those of `named`."""
    numbers = [candidates.index_of(step.look) for step in named or steps]
    return PoseScorer(scene, candidates).score(numbers, steps)


def laid(scene, order):
    return [scene.blocks[vertex] for vertex in order]


def noisy(steps, rng, sigma_m):
    places = (step.position_m + rng.normal(0, sigma_m, 3) for step in steps)
    return [replace(a, position_m=tuple(b.tolist())) for a, b in zip(steps, places, strict=True)]


def turned(step, angle_deg, shift_m):
    """Only the place is turned: candidates keep how they were shown."""
    x, y, z = euler_deg_to_matrix((0.0, 0.0, angle_deg)) @ step.position_m
    return replace(step, position_m=(x + shift_m[0], y + shift_m[1], z))


def summary(score):
    fits = [fit for fit in score.fits if fit is not None]
    far = sorted(round(fit.position_cm, 2) for fit in fits)
    shared = sorted(round(fit.iou, 2) for fit in fits if fit.iou is not None)
    return score.right, len(fits), far, shared


@settings(max_examples=20)
@given(scenes(), st.integers(0, 99))
def test_a_valid_order_at_true_poses_is_wholly_right(drawn, seed):
    scene, candidates = drawn
    order = scene.graph.random_order(np.random.default_rng(seed))
    for score in scored(scene, candidates, laid(scene, order)):
        assert score.right == (len(scene),) * 4
        assert all(fit is not None and fit.iou in (1, None) for fit in score.fits)


@settings(max_examples=20)
@given(scenes(), st.integers(0, 99), st.sampled_from([0.002, 0.01, 0.04]), st.data())
def test_no_more_steps_are_right_than_without_poses_and_wider_tolerances_lose_none(
    drawn, seed, sigma_m, data
):
    scene, candidates = drawn
    vertices = data.draw(st.lists(st.integers(0, len(scene) - 1), max_size=7))
    steps = noisy(laid(scene, vertices), np.random.default_rng(seed), sigma_m)
    numbers = tuple(candidates.index_of(step.look) for step in steps)
    most = most_placed(Goal(scene, candidates, "A"), Plan(numbers))
    for score in scored(scene, candidates, steps):
        assert sum(fit is not None for fit in score.fits) == most
        assert list(score.right) == sorted(score.right)
        assert score.right[-1] <= most


@settings(max_examples=25)
@given(
    scenes(),
    st.integers(0, 999),
    st.sampled_from([0.0, 0.003, 0.012]),
    st.floats(-180, 180),
    st.tuples(st.floats(-0.8, 0.8), st.floats(-0.8, 0.8)),
)
def test_aligned_does_not_change_when_the_whole_plan_is_shifted_and_turned(
    drawn, seed, sigma_m, angle_deg, shift_m
):
    """Meters away none stands where it should: what is aligned there is what was sought."""
    scene, candidates = drawn
    rng = np.random.default_rng(seed)
    steps = noisy(laid(scene, list(scene.graph.random_order(rng))), rng, sigma_m)
    away = [turned(step, 0.0, (5.0, 0.0)) for step in steps]
    moved = [turned(step, angle_deg, shift_m) for step in away]
    here, one, other = (scored(scene, candidates, plan)[1] for plan in (steps, away, moved))
    assert one.right == other.right
    assert sum(here.right) >= sum(one.right)
    if sigma_m == 0:
        assert other.right == (len(scene),) * 4
        assert max(fit.position_cm for fit in other.fits if fit is not None) < 1e-3


@settings(max_examples=40)
@given(scenes(), st.randoms(use_true_random=False), st.sampled_from([0.005, 0.015, 0.03]))
def test_the_best_motion_of_a_plan_is_no_worse_than_none(drawn, random, sigma_m):
    scene, candidates = drawn
    order = random.choices(range(len(scene)), k=random.randint(1, len(scene)))
    steps = noisy(laid(scene, order), np.random.default_rng(random.getrandbits(32)), sigma_m)
    absolute, aligned = scored(scene, candidates, steps)
    assert sum(aligned.right) >= sum(absolute.right)
    if aligned.motion == Motion():
        assert aligned.right == absolute.right


TWO = (block(1, "cube", FLAT), block(2, "cube", (0.0, 0.025, 0.0), depend=(1,)))
HALF_TURN = Scene("s", (2,), TWO, ("s",)), CandidateSet((Candidate("cube", "red", FLAT),))
"""A goal that looks the same after half a turn, which only one order of its blocks may make."""


@settings(max_examples=20)
@given(scenes(), st.integers(0, 99))
@example(HALF_TURN, 0)
@example(HALF_TURN, 1)
@example(HALF_TURN, 2)
def test_symmetries_and_the_order_of_equal_blocks_in_the_file_change_nothing(drawn, seed):
    scene, candidates = drawn
    rng = np.random.default_rng(seed)
    steps = noisy(laid(scene, list(scene.graph.random_order(rng))), rng, 0.012)
    other = []
    for step in steps:
        alike = symmetries(step.type)
        turn = euler_deg_to_matrix(step.euler_deg) @ alike[int(rng.integers(len(alike)))]
        other.append(replace(step, euler_deg=angles_deg(turn)))
    one = scored(scene, candidates, steps)
    for order in (rng.permutation(len(scene)), range(len(scene))[::-1]):
        shuffled = replace(scene, blocks=tuple(laid(scene, order)))
        two = scored(shuffled, candidates, other, steps)
        assert [summary(score) for score in one] == [summary(score) for score in two]


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 9999))
def test_assignments_are_as_cheap_as_those_of_scipy(rows, columns, seed):
    cost = np.round(np.random.default_rng(seed).uniform(0, 4, (rows, columns)), 1)
    pairs = cheapest(cost)
    assert len({r for r, _ in pairs}) == len({c for _, c in pairs}) == min(rows, columns)
    assert sum(cost[p] for p in pairs) == pytest.approx(cost[linear_sum_assignment(cost)].sum())


@settings(max_examples=60)
@given(cases(max_blocks=5, max_steps=6).filter(lambda case: case.plan.steps), st.integers(0, 9999))
def test_steps_are_matched_at_the_least_cost_of_all_valid_ways(case, seed):
    scene, numbers = case.scene, case.plan.steps
    goal = Goal(scene, case.candidates, "A")
    equal = np.array([[v in goal.equal_to[n] for v in range(len(scene))] for n in numbers])
    distance = np.round(np.random.default_rng(seed).uniform(0, 8, equal.shape), 1)
    near = Nearness(distance, np.zeros(equal.shape), equal)
    found = matched(goal, numbers, near)

    def cost(way):
        pairs = [(s, v) for s, v in enumerate(way) if v is not None]
        return -len(pairs), round(sum(float(near.cost[pair]) for pair in pairs), 9)

    ways = itertools.product(*([None, *np.flatnonzero(row).tolist()] for row in equal))
    assert cost(found) == min(cost(way) for way in ways if valid(scene.graph, way))
    assert valid(scene.graph, found)


def valid(graph, way):
    done = set()
    for vertex in way:
        if vertex is not None:
            if vertex in done or not graph.depends_on[vertex] <= done:
                return False
            done.add(vertex)
    return True


@pytest.mark.parametrize("block_type", BLOCK_TYPES)
def test_pieces_fill_their_block_and_its_symmetries_map_it_onto_itself(block_type):
    one = block(1, block_type, FLAT)
    for rotation in symmetries(block_type)[:6]:
        shared = overlap_volume(one, replace(one, euler_deg=angles_deg(rotation)))
        assert shared == pytest.approx(SHAPES[block_type].volume_m3)
        assert turn_deg(block_type, rotation, np.eye(3)) == pytest.approx(0, abs=1e-4)


@settings(max_examples=20)
@given(st.sampled_from(BLOCK_TYPES), st.sampled_from(BLOCK_TYPES), st.integers(0, 999))
def test_shared_volumes_agree_with_points_drawn_at_random(one, other, seed):
    rng = np.random.default_rng(seed)
    turn, place = rng.uniform(-180, 180, 3), rng.uniform(-0.03, 0.03, 3)
    first, second = block(1, one, FLAT), block(2, other, tuple(place), tuple(turn))
    low, high = np.array(SHAPES[one].low_m), np.array(SHAPES[one].high_m)
    points, box_m3 = rng.uniform(low, high, (20_000, 3)), float(np.prod(high - low))

    def are_in(solid):
        found = np.zeros(len(points), dtype=bool)
        for piece in pieces_of(solid):
            spans = piece.vertices_m @ piece.face_normals.T
            heights = points @ piece.face_normals.T
            found |= ((heights >= spans.min(axis=0)) & (heights <= spans.max(axis=0))).all(axis=1)
        return found

    drawn_m3 = (are_in(first) & are_in(second)).mean() * box_m3
    found_m3 = overlap_volume(first, second)
    assert found_m3 == pytest.approx(drawn_m3, abs=0.02 * box_m3)
    assert found_m3 == pytest.approx(overlap_volume(second, first), abs=1e-12)
