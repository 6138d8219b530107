"""Balance by statics: by hand, against simulations, and with proofs that nothing changed passes."""

import ast
import math
import sys
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from phyblock.domain.blocks import SHAPES
from phyblock.sim import balance, certificate
from phyblock.sim.certificate import ONE, Falls, Stands, proves
from phyblock.sim.contact import drop_height_m
from phyblock.sim.dynamics import ONE_SETTING, groups, stands
from phyblock.sim.engine import installed_engines
from tests.shipped import TASKS
from tests.sim.structures import block, tower, turned

SCENES = {task.scene.id: task.scene.blocks for task in TASKS}
SMALL = [blocks for blocks in SCENES.values() if len(blocks) <= 6]
HALF_CUBE_M = 0.025
offsets_m = st.floats(-0.045, 0.045)
angles_deg = st.floats(0, 90)


@given(offset_m=offsets_m, angle_deg=angles_deg)
def test_a_cube_stands_on_another_as_far_as_its_middle_is_over_it(offset_m, angle_deg):
    pair = [block(1, "cube", (0, 0, 0.025)), block(2, "cube", (offset_m, 0, 0.075))]
    pair = turned(pair, angle_deg, (0.3, -0.2))
    inside_m = HALF_CUBE_M - abs(offset_m)
    if abs(inside_m) > 1e-4:
        assert balance.is_balanced(pair) is (inside_m > 0)
    if abs(abs(inside_m) - balance.MARGIN_M) > 2e-3:
        assert balance.surely_stands(pair) is (inside_m > balance.MARGIN_M)
        assert balance.surely_falls(pair) is (inside_m < -balance.MARGIN_M)


def loaded(plank, plank_m, weight_m=None, beside_m=None):
    """A plank across a cube with up to two weights, one on it and one beside it."""
    blocks = [*tower(1), block(2, plank, (0, plank_m, 0.0625), (0, 0, 90))]
    if weight_m is not None:
        blocks.append(block(3, "cylinder", (0, weight_m, 0.125)))
    if beside_m is not None:
        blocks.append(block(4, "cube", (beside_m, 0.2, 0.025)))
    return blocks


# On the grid that scenes are built on.
places_m = st.integers(-5, 5).map(lambda steps: 0.0125 * steps)
some_m = st.none() | places_m
loaded_planks = st.builds(loaded, st.sampled_from(["cuboid3", "cuboid2"]), places_m, some_m, some_m)


@settings(max_examples=40)
@given(loaded_planks)
# These tip for sure, and least squares say that nothing is left over (scipy 1.15 to 1.17).
@example(loaded("cuboid3", -0.0625, -0.025))
@example(loaded("cuboid2", 0.05, 0.0125))
@example(loaded("cuboid2", -0.0375, -0.05))
def test_least_squares_and_linear_programming_agree(blocks):
    def finds_none(forces, weights):
        return np.zeros((forces.shape[1], weights.shape[1])), np.zeros(weights.shape[1], dtype=bool)

    by_squares = balance.is_balanced(blocks), balance.surely_stands(blocks)
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(balance, "_least_squares", finds_none)
        assert (balance.is_balanced(blocks), balance.surely_stands(blocks)) == by_squares


@given(
    loaded_planks, st.floats(0, balance.MARGIN_M), angles_deg.map(lambda a: 4 * a), st.floats(0, 1)
)
def test_a_sure_verdict_holds_for_all_shifts_and_masses_between(blocks, radius_m, angle_deg, share):
    angle, (light, heavy) = math.radians(angle_deg), balance.MASS_FACTORS
    shift_m = (radius_m * math.cos(angle), radius_m * math.sin(angle))
    factor = light + share * (heavy - light)
    weights, met = balance._weights(blocks, shift_m, factor)[:, None], balance._contacts(blocks)
    borne = [
        balance._pushes(balance._matrix(met, len(blocks), friction), weights) is not None
        for friction in balance.FRICTIONS
    ]
    assert borne[0] or not balance.surely_stands(blocks)
    assert not (borne[1] and balance.surely_falls(blocks))


@pytest.mark.parametrize(("off_m", "falls"), [(0.002, False), (0.0035, False), (0.007, True)])
def test_a_balance_nearer_than_the_margin_is_no_sure_fall(off_m, falls):
    """On a ridge a slab balances at one place alone, which is on no ring round another."""
    slab = block(2, "cuboid1", (off_m, off_m, 0.05 / 2**0.5 + 0.0125))
    assert balance.surely_falls([block(1, "triangle", (0, 0, 0)), slab]) is falls


@given(st.floats(-0.01, 0.02), angles_deg)
def test_a_plank_surely_stands_on_posts_that_it_covers_by_the_margin(over_m, angle_deg):
    """Its weight is always between the posts; it slips off them where it covers too little."""
    post_m = max(SHAPES["cuboid3"].high_m) + HALF_CUBE_M - over_m
    posts = [block(i, "cube", (0, y, 0.025)) for i, y in ((1, -post_m), (2, post_m))]
    bridge = [*posts, block(3, "cuboid3", (0, 0, 0.0625), (0, 0, 90))]
    if abs(over_m - balance.MARGIN_M) > 1e-4:
        bridge = turned(bridge, angle_deg, (0.1, 0.2))
        assert balance.surely_stands(bridge) is (over_m > balance.MARGIN_M)


@st.composite
def disturbed(draw):
    """A small scene of the data set, a support taken away, a block put elsewhere or turned."""
    blocks = list(draw(st.sampled_from(SMALL)))
    if draw(st.booleans()):
        blocks.pop(draw(st.integers(0, len(blocks) - 2)))
    steps_m = st.sampled_from([-0.05, -0.025, -0.0125, 0.0, 0.0125, 0.025, 0.05])
    for moved in draw(st.sets(st.sampled_from(blocks), max_size=2)):
        x, y = (at + draw(steps_m | st.floats(-0.03, 0.03)) for at in moved.position_m[:2])
        roll, pitch, yaw = moved.euler_deg
        yaw += draw(st.sampled_from([0.0, 0.0, 90.0, 45.0]))
        blocks.remove(moved)
        put = replace(moved, position_m=(x, y, 0.5), euler_deg=(roll, pitch, yaw))
        blocks.append(replace(put, position_m=(x, y, 0.5 - drop_height_m(put, blocks))))
    return blocks


def stands_in(engine, blocks):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PHYBLOCK_PHYSICS", engine)
        return stands(blocks, ONE_SETTING)


@settings(max_examples=25)
@given(disturbed())
@example([one for one in SCENES["l1-007-slide"] if one.order != 1])
@example([one for one in SCENES["l2-032-slide"] if one.order != 1])
def test_no_engine_contradicts_a_proof(blocks):
    for group in groups(blocks):
        proven = balance.prove(group)
        assert proven is None or proven.stands or not balance.is_balanced(group)
        for engine in installed_engines() if proven else ():
            assert stands_in(engine, group) is proven.stands
        if balance.surely_stands(group):
            assert all(stands_in(engine, group) for engine in installed_engines())


@pytest.mark.parametrize(("name", "stands"), [("l1-007-slide", False), ("l2-032-slide", True)])
def test_a_wedge_on_two_ridges_surely_stands_where_it_covers_them(name, stands):
    """Its base ends over the ridges, and both engines drop it, or reaches 1 cm beyond them."""
    left = [one for one in SCENES[name] if one.order != 1]
    assert balance.is_balanced(left)
    assert balance.surely_stands(left) is stands


STANDING = balance.prove(loaded("cuboid3", 0))
FALLING = balance.prove([*tower(1), block(2, "cuboid2", (0.06, 0, 0.0625))])


def put(value, path, change):
    """Nested tuples with the number at a path changed."""
    if not path:
        return change(value)
    at, *rest = path
    parts = (*value[:at], put(value[at], rest, change), *value[at + 1 :])
    return type(value)(*parts) if hasattr(value, "_fields") else parts


def numbers(value, path=()):
    """The path of each number in nested tuples."""
    if not isinstance(value, tuple):
        yield path
    else:
        for at, part in enumerate(value):
            yield from numbers(part, (*path, at))


def test_a_proof_holds_for_what_it_was_found_for_alone():
    assert (STANDING.stands, FALLING.stands) == (True, False)
    for one, other in product((STANDING, FALLING), repeat=2):
        assert proves(one.proof, other.structure) is (one is other)


def test_a_proof_with_any_force_changed_or_left_out_is_refused():
    paths = list(numbers(STANDING.proof))
    for path in paths[:: max(1, len(paths) // 150)]:
        for by in (ONE // 10**4, -ONE // 10**4):
            wrong = put(STANDING.proof, path, lambda number, by=by: number + by)
            assert not proves(wrong, STANDING.structure)
    forces = STANDING.proof.forces
    for fewer in ((), forces[:-1], (forces[0][:-1], *forces[1:]), (*forces, forces[0])):
        assert not proves(Stands(fewer), STANDING.structure)


def other_than(n):
    """Change an index, a flag or a length to what it is not."""
    return (not n) if isinstance(n, bool) else n + (1 if abs(n) < 9 and n else ONE // 20)


@pytest.mark.parametrize("field", ["bodies", "contacts", "narrow"])
def test_a_standing_that_is_not_as_its_proof_has_it_is_refused(field):
    at = STANDING.structure._fields.index(field)
    for path in numbers(STANDING.structure[at]):
        # How high a weight is, or forces that are all upright, does not matter.
        if path[1:] != (2, 2):
            wrong = put(STANDING.structure, (at, *path), other_than)
            assert not proves(STANDING.proof, wrong), (field, path)


def test_a_fall_with_its_motion_or_its_contacts_changed_is_refused():
    motion = FALLING.proof.motion
    still = ((0, 0, 0), (0, 0, 0))
    up = tuple(((-a, -b, -c), (-d, -e, -f)) for (a, b, c), (d, e, f) in motion)
    for wrong in ((), motion[:-1], (still,) * len(motion), up, (motion[1], motion[0])):
        assert not proves(Falls(wrong), FALLING.structure)
    for body, axis, by in product((0, 1), (0, 1, 2), (ONE, -ONE)):
        wrong = put(FALLING.proof, (0, body, 0, axis), lambda number, by=by: number + by)
        assert not proves(wrong, FALLING.structure), (body, axis, by)
    changes = (((0,), lambda _: 7), ((1,), lambda _: 7), ((3, 2), lambda number: number // 2))
    for contact, (path, change) in product(range(len(FALLING.structure.wide)), changes):
        wrong = put(FALLING.structure, (3, contact, *path), change)
        assert not proves(FALLING.proof, wrong)


def test_the_checker_needs_the_standard_library_alone():
    tree = ast.parse(Path(certificate.__file__).read_text(encoding="utf-8"))
    names = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.Import)]
    assert {str(name).partition(".")[0] for name in names} <= set(sys.stdlib_module_names)
