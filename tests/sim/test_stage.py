from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from phyblock.domain import euler_deg_to_quat_xyzw
from phyblock.sim import PictureStyle, goal_png
from phyblock.sim.bullet.stage import Stage, stage
from phyblock.sim.geometry import solid_mesh
from phyblock.sim.pose import Pose
from phyblock.sim.renderer import Prop
from tests.designs.scenes import designed_scenes

SMALL = PictureStyle(size_px=128)
UPRIGHT = euler_deg_to_quat_xyzw((0.0, 0.0, 0.0))
PROPS: list[Prop] = [
    Prop(solid_mesh("cube"), (255, 0, 0), Pose(np.array([0.0, 0.0, 0.1 * i]), UPRIGHT))
    for i in range(3)
]


def tiny() -> Stage:
    return stage(with_egl=False)


def test_bodies_leave_and_their_numbers_come_back() -> None:
    with tiny().showing(PROPS) as (bullet, client, first):
        assert bullet.getNumBodies(physicsClientId=client) == len(set(first)) == 3
    assert bullet.getNumBodies(physicsClientId=client) == 0
    with tiny().showing(PROPS) as (_, _, second):
        assert second == first


def test_bodies_leave_when_the_picture_fails() -> None:
    with (
        pytest.raises(ZeroDivisionError),
        tiny().showing(PROPS) as (bullet, client, _),
    ):
        1 / 0  # noqa: B018
    assert bullet.getNumBodies(physicsClientId=client) == 0


def test_a_picture_does_not_depend_on_those_before_it() -> None:
    scenes = designed_scenes()
    forward = [goal_png(scene, SMALL) for scene in scenes]
    backward = [goal_png(scene, SMALL) for scene in scenes[::-1]]
    assert backward[::-1] == forward


def test_threads_take_turns() -> None:
    scenes = designed_scenes()[::8]
    alone = [goal_png(scene, SMALL) for scene in scenes]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(goal_png, scenes * 3, [SMALL] * (3 * len(scenes)))) == alone * 3
