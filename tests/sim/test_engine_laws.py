"""Laws of every physics engine that is installed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from phyblock.domain import BLOCK_TYPES, SHAPES, Block, BlockType
from phyblock.errors import InputError
from phyblock.sim.engine import (
    ENGINES,
    GRAVITY_M_S2,
    Physics,
    PhysicsEngine,
    Pose,
    Simulation,
    Velocity,
    installed_engines,
    physics_engine,
)
from tests.sim.structures import block, block_types, counterweighted_beam, eulers, tower

PHYSICS = Physics()
heights = st.floats(0.5, 2.0)


def chosen(word: str) -> PhysicsEngine:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PHYBLOCK_PHYSICS", word)
        return physics_engine()


@pytest.fixture(params=installed_engines(), scope="module")
def engine(request: pytest.FixtureRequest) -> PhysicsEngine:
    """Any engine."""
    return chosen(request.param)


@pytest.fixture
def simulation(engine: PhysicsEngine) -> Iterator[Simulation]:
    with engine.open(PHYSICS) as opened:
        yield opened


def add_all(simulation: Simulation, blocks: list[Block]) -> None:
    for one in blocks:
        simulation.add(one.order, one.type, Pose.goal(one))


def bits(simulation: Simulation, blocks: list[Block]) -> str:
    """Where blocks are and how they move, to the last bit."""
    rows = []
    for one in blocks:
        pose, velocity = simulation.pose(one.order), simulation.velocity(one.order)
        rows += [pose.position_m, pose.quat_xyzw, *map(np.array, velocity)]
    return np.concatenate(rows).tobytes().hex()


def fall(engine: PhysicsEngine, blocks: list[Block], steps: int) -> str:
    with engine.open(PHYSICS) as opened:
        add_all(opened, blocks)
        opened.step(steps)
        return bits(opened, blocks)


@given(block_types, heights, eulers)
@settings(max_examples=20)
def test_a_block_is_where_it_was_put_and_at_rest(
    engine: PhysicsEngine, block_type: BlockType, height_m: float, euler_deg
) -> None:
    one = block(3, block_type, (0.3, -0.2, height_m), euler_deg)
    with engine.open(PHYSICS) as opened:
        add_all(opened, [one])
        assert opened.pose(3).distance_m(Pose.goal(one)) < 1e-9
        assert opened.pose(3).angle_deg(Pose.goal(one)) < 1e-3
        assert_allclose(opened.velocity(3), 0.0)


@pytest.mark.parametrize("block_type", BLOCK_TYPES)
def test_a_block_on_the_floor_stands(simulation: Simulation, block_type: BlockType) -> None:
    one = block(1, block_type, (0.1, 0.2, -SHAPES[block_type].low_m[2]))
    add_all(simulation, [one])
    simulation.step(120)
    assert simulation.pose(1).distance_m(Pose.goal(one)) < 0.001
    assert simulation.pose(1).angle_deg(Pose.goal(one)) < 1.0


def test_a_velocity_is_the_one_that_was_set(simulation: Simulation) -> None:
    add_all(simulation, tower(2))
    given_one = Velocity((0.1, -0.2, 0.3), (0.4, 0.5, -0.6))
    simulation.set_velocity(2, given_one)
    assert_allclose(simulation.velocity(2), given_one)
    assert_allclose(simulation.velocity(1), 0.0)


def test_the_same_calls_give_the_same_bits_beside_others(engine: PhysicsEngine) -> None:
    falling = counterweighted_beam()[:3]
    alone = fall(engine, falling, 40)
    with engine.open(Physics(1 / 300, 80, 0.1)) as other:
        add_all(other, tower(3))
        other.step(5)
        assert fall(engine, falling, 40) == alone
        other.step(5)
    assert fall(engine, falling, 40) == alone


def test_a_block_in_the_air_falls_the_way_of_gravity(engine: PhysicsEngine) -> None:
    downhill = (0.6, 0.0, -0.8)
    x, y, z = (GRAVITY_M_S2 * part for part in downhill)
    one, duration_s = block(1, "triangle", (0.0, 0.0, 3.0)), 0.25
    with engine.open(Physics(1 / 2000, gravity_m_s2=(x, y, z))) as opened:
        add_all(opened, [one])
        opened.step(500)
        way = opened.pose(1).position_m - np.array(one.position_m)
        speed = opened.velocity(1).linear_m_s
    assert_allclose(
        way, GRAVITY_M_S2 * np.array(downhill) * duration_s**2 / 2, rtol=0.03, atol=1e-9
    )
    assert_allclose(speed, GRAVITY_M_S2 * np.array(downhill) * duration_s, rtol=0.03, atol=1e-9)


@pytest.mark.parametrize(("friction", "slides"), [(0.5, True), (0.7, False)])
def test_friction_holds_a_block_on_a_floor_that_leans(
    engine: PhysicsEngine, friction: float, slides: bool
) -> None:
    """By 31 degrees: a coefficient over 0.6 holds."""
    x, z = (GRAVITY_M_S2 * part for part in (0.6 * 0.857, -0.857))
    one = block(1, "cuboid2", (0.0, 0.0, 0.0125))
    with engine.open(Physics(friction=friction, gravity_m_s2=(x, 0.0, z))) as opened:
        add_all(opened, [one])
        opened.step(60)
        assert (opened.pose(1).distance_m(Pose.goal(one)) > 0.02) == slides


def test_masses_decide_on_a_beam(engine: PhysicsEngine) -> None:
    """A slab holds a cylinder on the other end where it is heavy."""
    beam = counterweighted_beam()
    beam[2] = replace(beam[2], type="cylinder", position_m=(0.0, 0.07, 0.125))
    beam[3] = replace(beam[3], type="cuboid1", position_m=(0.0, -0.05, 0.0875))
    for factor, falls in ((0.3, True), (2.0, False)):
        physics = Physics(mass_factors=(("cuboid1", factor),))
        assert physics.mass_kg("cuboid1") == pytest.approx(factor * SHAPES["cuboid1"].mass_kg)
        with engine.open(physics) as opened:
            add_all(opened, beam)
            opened.step(240)
            assert (opened.pose(2).angle_deg(Pose.goal(beam[1])) > 5) == falls


@pytest.mark.parametrize("name", ENGINES)
def test_an_engine_that_is_not_installed_is_refused_with_where_to_get_it(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("phyblock.sim.engine.find_spec", lambda _: None)
    with pytest.raises(InputError, match="is not installed") as caught:
        chosen(name)
    assert ENGINES[name].hint in str(caught.value)
    assert installed_engines() == ()
    with pytest.raises(InputError, match="is not installed"):
        physics_engine()


@pytest.mark.parametrize("word", ["bullet", "", "phyblock.sim.mujoco:MujocoEngine"])
def test_a_word_that_names_no_engine_is_refused(word: str) -> None:
    with pytest.raises(InputError, match=f"allowed: {', '.join(ENGINES)}"):
        chosen(word)
