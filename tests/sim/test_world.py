from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from phyblock.domain import BLOCK_TYPES, SHAPES, BlockType
from phyblock.errors import SimulationError
from phyblock.making.poses import POSES
from phyblock.sim.contact import drop_height_m
from phyblock.sim.dynamics import wait
from phyblock.sim.engine import ENGINES, Physics, Pose, World
from tests.sim.structures import block, counterweighted_beam, tower

LINE_BALANCED = {"bowl", "bowl-turned"}


def poses_as_hex(blocks, duration_s: float) -> str:
    with World() as world:
        world.place(*blocks)
        world.step(duration_s)
        rows = [np.concatenate([p.position_m, p.quat_xyzw]) for p in world.poses().values()]
    return np.stack(rows).tobytes().hex()


@pytest.mark.parametrize("block_type", BLOCK_TYPES)
def test_a_placed_block_is_at_its_goal_pose(block_type: BlockType) -> None:
    one = block(7, block_type, (0.3, -0.2, 0.5), (30.0, -70.0, 110.0))
    with World() as world:
        world.place(one)
        pose = world.pose(7)
    goal = Pose.goal(one)
    assert pose.distance_m(goal) < 1e-9
    assert pose.angle_deg(goal) < 1e-3


@pytest.mark.parametrize(
    ("block_type", "pose"),
    [(t, p) for t, poses in POSES.items() for p in poses if p not in LINE_BALANCED],
)
def test_a_block_stays_where_it_is_laid_down(block_type: BlockType, pose: str) -> None:
    lifted = block(1, block_type, (0.0, 0.0, 0.5), POSES[block_type][pose])
    down = replace(lifted, position_m=(0.0, 0.0, 0.5 - drop_height_m(lifted, [])))
    with World() as world:
        world.place(down)
        world.step(0.5)
        assert world.pose(1).distance_m(Pose.goal(down)) < 0.001
        assert world.pose(1).angle_deg(Pose.goal(down)) < 1.0


def test_a_dropped_cube_settles_on_the_ground() -> None:
    with World() as world:
        world.place(block(1, "cube", (0.0, 0.0, 0.1)))
        assert wait(world, 5.0)
        assert world.pose(1).position_m[2] == pytest.approx(0.025, abs=0.001)


def test_settling_gives_up_on_what_still_falls() -> None:
    with World() as world:
        world.place(block(1, "cube", (0.0, 0.0, 50.0)))
        assert not wait(world, 0.3)


def test_free_fall_follows_gravity() -> None:
    """To the 4 percent of speed a second that Bullet's damping takes."""
    with World(Physics(time_step_s=1 / 2000)) as world:
        world.place(block(1, "arch", (0.0, 0.0, 5.0)))
        world.step(0.5)
        fallen_m = 5.0 - world.pose(1).position_m[2]
    assert fallen_m == pytest.approx(9.81 * 0.5**2 / 2, rel=0.03)


@pytest.mark.parametrize(("friction", "slides"), [(0.35, True), (3.0, False)])
def test_friction_of_the_pair_decides_whether_a_slab_slides(friction: float, slides: bool) -> None:
    """On the 45 degree side of a wedge on a cube: it takes a coefficient over 1 to hold."""
    post, wedge = block(1, "cube", (0.0, 0.0, 0.025)), block(3, "triangle", (0.0, 0.0, 0.05))
    out = 0.0125 / 2**0.5 + SHAPES["triangle"].high_m[2] / 2
    slab = block(2, "cuboid1", (0.0, out, 0.05 + out), (-45.0, 0.0, 0.0))
    with World(Physics(friction=friction)) as world:
        world.place(post, wedge, slab)
        world.step(0.25)
        assert (world.pose(2).distance_m(Pose.goal(slab)) > 0.005) == slides


def test_removing_a_block_lets_the_one_above_fall() -> None:
    with World() as world:
        world.place(*tower(2))
        world.remove(1)
        assert set(world.poses()) == {2}
        wait(world, 5.0)
        assert world.pose(2).position_m[2] == pytest.approx(0.025, abs=0.001)


def test_the_same_scene_gives_the_same_bits_in_another_process() -> None:
    blocks = counterweighted_beam()[:3]
    here = poses_as_hex(blocks, 0.5)
    assert poses_as_hex(blocks, 0.5) == here
    code = (
        "from tests.sim.structures import counterweighted_beam\n"
        "from tests.sim.test_world import poses_as_hex\n"
        "print(poses_as_hex(counterweighted_beam()[:3], 0.5))\n"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == here
    assert answer.stderr == ""


def test_importing_the_package_loads_no_engine() -> None:
    libraries = {engine.library for engine in ENGINES.values()}
    code = (
        "import sys, phyblock.sim, phyblock.making.scenes\n"
        f"print(not {libraries}.isdisjoint(sys.modules))"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert answer.stdout.strip() == "False"


def test_turns_are_measured_whichever_sign_a_quaternion_has() -> None:
    quarter = Pose.goal(block(1, "cube", (0.0, 0.0, 0.0), (0.0, 0.0, 90.0)))
    still = Pose.goal(block(1, "cube", (0.0, 0.0, 0.0)))
    flipped = Pose(quarter.position_m, -quarter.quat_xyzw)
    assert_allclose([quarter.angle_deg(still), flipped.angle_deg(still)], 90.0)


def test_wrong_use_is_said() -> None:
    world = World()
    with pytest.raises(SimulationError, match="not open"):
        world.step(0.1)
    with world:
        world.place(block(1, "cube", (0.0, 0.0, 0.025)))
        with pytest.raises(SimulationError, match="already"):
            world.place(block(1, "cube", (0.0, 0.0, 0.025)))
        with pytest.raises(SimulationError, match="not in the world"):
            world.remove(2)
        with pytest.raises(SimulationError, match="not in the world"):
            world.pose(3)
    with pytest.raises(SimulationError, match="not open"):
        world.place(block(1, "cube", (0.0, 0.0, 0.025)))
