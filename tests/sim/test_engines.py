"""Laws of every physics engine that is installed, and of plans executed in it."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from phyblock.domain.blocks import SHAPES
from phyblock.errors import InputError
from phyblock.scoring.pose import blocks_reached, overlap_volume
from phyblock.sim import engine as engines
from phyblock.sim.contact import voxel_iou
from phyblock.sim.dynamics import execute
from phyblock.sim.engine import GRAVITY_M_S2, Physics, Pose
from tests.sim.structures import block, block_types, counterweighted_beam, eulers, tower

PHYSICS = Physics()
heights = st.floats(0.5, 2.0)


def chosen(word):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PHYBLOCK_PHYSICS", word)
        return engines.physics_engine()


@pytest.fixture(params=engines.installed_engines(), scope="module")
def engine(request):
    return chosen(request.param)


def fall(engine, blocks, steps):
    """Return places and motions of blocks after so many steps, to the last bit."""
    with engine(PHYSICS) as world:
        world.place(*blocks)
        world.step(steps * PHYSICS.time_step_s)
        places = world.poses().items()
        moved = [(one.position_m, one.quat_xyzw, *world.velocity(n)) for n, one in places]
        return np.hstack([*itertools.chain(*moved)]).tobytes()


@given(block_types, heights, eulers)
@settings(max_examples=20)
def test_a_block_is_where_it_was_put_and_at_rest(engine, block_type, height_m, euler_deg):
    one = block(3, block_type, (0.3, -0.2, height_m), euler_deg)
    with engine(PHYSICS) as opened:
        opened.place(one)
        assert opened.pose(3).distance_m(Pose.goal(one)) < 1e-9
        assert opened.pose(3).angle_deg(Pose.goal(one)) < 1e-3
        assert_allclose(opened.velocity(3), 0.0)


def test_the_same_calls_give_the_same_bits_beside_others(engine):
    falling = counterweighted_beam()[:3]
    alone = fall(engine, falling, 40)
    with engine(Physics(1 / 300, 80, 0.1)) as other:
        other.place(*tower(3))
        other.step(5 / 300)
        assert fall(engine, falling, 40) == alone
        other.step(5 / 300)
    assert fall(engine, falling, 40) == alone


def test_a_block_in_the_air_falls_the_way_of_gravity(engine):
    gravity = GRAVITY_M_S2 * np.array([0.6, 0.0, -0.8])
    one, duration_s = block(1, "triangle", (0.0, 0.0, 3.0)), 0.25
    with engine(Physics(1 / 2000, gravity_m_s2=tuple(gravity.tolist()))) as opened:
        opened.place(one)
        opened.step(duration_s)
        way = opened.pose(1).position_m - np.array(one.position_m)
        speed = opened.velocity(1)[0]
    assert_allclose(way, gravity * duration_s**2 / 2, rtol=0.03, atol=1e-9)
    assert_allclose(speed, gravity * duration_s, rtol=0.03, atol=1e-9)


@pytest.mark.parametrize(("friction", "slides"), [(0.5, True), (0.7, False)])
def test_friction_holds_a_block_on_a_floor_that_leans(engine, friction, slides):
    """By 31 degrees: a coefficient over 0.6 holds."""
    x, z = (GRAVITY_M_S2 * part for part in (0.6 * 0.857, -0.857))
    one = block(1, "cuboid2", (0.0, 0.0, 0.0125))
    with engine(Physics(friction=friction, gravity_m_s2=(x, 0.0, z))) as opened:
        opened.place(one)
        opened.step(60 / 240)
        assert (opened.pose(1).distance_m(Pose.goal(one)) > 0.02) == slides


def test_masses_decide_on_a_beam(engine):
    """A slab holds a cylinder on the other end where it is heavy."""
    beam = counterweighted_beam()
    beam[2] = replace(beam[2], type="cylinder", position_m=(0.0, 0.07, 0.125))
    beam[3] = replace(beam[3], type="cuboid1", position_m=(0.0, -0.05, 0.0875))
    for factor, falls in ((0.3, True), (2.0, False)):
        with engine(Physics(mass_factors=(("cuboid1", factor),))) as opened:
            opened.place(*beam)
            opened.step(1)
            assert (opened.pose(2).angle_deg(Pose.goal(beam[1])) > 5) == falls


@pytest.mark.parametrize("name", engines.ENGINES)
def test_an_engine_that_is_unknown_or_not_installed_is_refused(name, monkeypatch):
    with pytest.raises(InputError, match=f"allowed: {', '.join(engines.ENGINES)}"):
        chosen("phyblock.sim.mujoco:MujocoEngine")
    monkeypatch.setattr(engines, "find_spec", lambda _: None)
    with pytest.raises(InputError, match="is not installed") as caught:
        chosen(name)
    assert engines.ENGINES[name].hint in str(caught.value)
    assert engines.installed_engines() == ()


def at(one, x_m, y_m, z_m):
    return replace(one, position_m=(x_m, y_m, z_m))


FIRST = tower(1)[0]
DEEP, SLIGHT = at(FIRST, 0.03, 0, 0.025), at(FIRST, 0.046, 0, 0.025)
LOW = [at(FIRST, 0, 0, z) for z in (0.01, -0.5, 0.0215)]


def test_a_step_stands_falls_or_is_refused(engine):
    for blocks, wanted in (
        (tower(3), ["stands", "stands", "stands"]),
        (tower(3)[2:], ["falls"]),
        ([FIRST, DEEP, SLIGHT], ["stands", "overlaps", "stands"]),
        ([FIRST, at(FIRST, 0.044, 0, 0.025)], ["stands", "overlaps"]),
        ([*LOW[:2], None, LOW[2]], ["under_floor", "under_floor", "no_block", "stands"]),
    ):
        done = execute(blocks, engine)
        assert [step.end for step in done.steps] == wanted
        is_put = [end in ("stands", "falls") for end in wanted]
        assert [len(world) for world in done.worlds] == [*itertools.accumulate(is_put)]


def test_small_overlaps_give_way_and_a_tower_is_reached(engine):
    done = execute([FIRST, DEEP, SLIGHT], engine=engine)
    assert done.steps[1].overlap_cm == pytest.approx(2, abs=0.01)
    assert done.steps[2].overlap_cm == pytest.approx(0.4, abs=0.05)
    assert done.blocks[1].position_m[0] == pytest.approx(0.05, abs=0.001)
    done = execute(tower(3), engine=engine)
    assert voxel_iou(tower(3), done.blocks) == 1
    assert blocks_reached(tower(3), done.blocks, 1, 10) == 3


def test_who_is_knocked_over_is_named_and_stays_so(engine):
    beam = counterweighted_beam()
    done = execute([*beam[:3], None, beam[0]], engine=engine)
    assert [step.end for step in done.steps[:3]] == ["stands", "stands", "knocks_over"]
    assert done.steps[2].knocked == (2,)
    assert done.worlds[3] == done.worlds[2]
    assert blocks_reached(beam, done.blocks, 1, 10) < len(beam)


def test_a_plan_ends_the_same_whatever_came_before_or_stands_elsewhere(engine):
    far = [at(one, 0.3, 0.3, one.position_m[2]) for one in tower(3)]
    near = counterweighted_beam()[:3]
    alone, beside = execute(near, engine=engine), execute([*far, *near], engine=engine)
    assert execute(near, engine=engine) == alone
    places = [one.position_m for one in beside.blocks[len(far) :]]
    assert places == [one.position_m for one in alone.blocks]
    assert [s.end for s in beside.steps[len(far) :]] == [s.end for s in alone.steps]


@settings(max_examples=40)
@given(
    st.sampled_from(("cube", "cuboid2", "triangle", "arch", "cylinder")),
    st.tuples(*[st.floats(-0.03, 0.03)] * 3),
    st.floats(0.0, 90.0),
)
def test_voxels_know_what_two_blocks_share_nearly(kind, way_m, turn_deg):
    one = block(1, kind, (0.01, 0.02, 0.06))
    moved = tuple(map(sum, zip(one.position_m, way_m, strict=True)))
    other = replace(one, position_m=moved, euler_deg=(0.0, 0.0, turn_deg))
    shared = overlap_volume(one, other)
    iou = shared / (2 * SHAPES[kind].volume_m3 - shared)
    assert voxel_iou([one], [other]) == pytest.approx(iou, abs=0.08)
    assert voxel_iou([one], [one]) == 1


def test_a_voxel_counts_by_how_much_of_it_a_block_fills():
    cube = block(1, "cube", (0.0, 0.0, 0.025))
    assert voxel_iou([cube], [at(cube, 0, 0, 0.02625)]) == pytest.approx(39 / 41)
    assert voxel_iou([cube, cube], [cube]) == 1
    assert voxel_iou([], []) == 1
    assert voxel_iou([cube], []) == 0
