"""Blocks let go: worlds, trials, building steps, states of a structure, removals and pushes."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.making.scenes.sketch import POSES
from phyblock.sim import dynamics
from phyblock.sim.contact import drop_height_m
from phyblock.sim.dynamics import DEFAULT_TRIAL, ONE_SETTING, check, check_steps, settle
from phyblock.sim.engine import Pose, open_world
from tests.shipped import TASKS
from tests.sim.structures import block, built, counterweighted_beam, tower

FIRST = replace(DEFAULT_TRIAL, physics=DEFAULT_TRIAL.physics[:1])
LINE_BALANCED = {"bowl", "bowl-turned"}
BEAM = tuple(counterweighted_beam())


@pytest.mark.parametrize(
    ("block_type", "pose"),
    [(t, p) for t, poses in POSES.items() for p in poses if p not in LINE_BALANCED],
)
def test_a_block_stays_where_it_is_laid_down(block_type, pose):
    lifted = block(1, block_type, (0.0, 0.0, 0.5), POSES[block_type][pose])
    down = replace(lifted, position_m=(0.0, 0.0, 0.5 - drop_height_m(lifted, [])))
    with open_world() as world:
        world.place(down)
        world.step(0.5)
        assert world.pose(1).distance_m(Pose.goal(down)) < 0.001
        assert world.pose(1).angle_deg(Pose.goal(down)) < 1.0


SHAKEN = """
import sys
from dataclasses import replace
import numpy as np
from phyblock.making import scenes
from phyblock.sim.dynamics import execute
from phyblock.sim.engine import ENGINES
from tests.shipped import TASKS
assert {*ENGINES}.isdisjoint(sys.modules)
rng = np.random.default_rng(0)
(blocks,) = (task.scene.blocks for task in TASKS if task.scene.id == "l4-001-avenue")
print(execute([
    replace(block, position_m=tuple((block.position_m + rng.normal(0, 0.003, 3)).tolist()))
    for block in blocks
]))
"""
"""A plan that falls here and there, where a last digit decides how blocks come to lie."""


def test_execution_depends_on_no_process_and_no_processor_and_loads_engines_late():
    """OpenBLAS adds up in another order, and without fused operations, for an old processor."""

    def printed(**more):
        command, root = [sys.executable, "-c", SHAKEN], Path(__file__).parents[2]
        env = os.environ | more
        done = subprocess.run(command, cwd=root, env=env, capture_output=True, check=True)
        assert not done.stderr
        return done.stdout

    assert printed() == printed(OPENBLAS_CORETYPE="Nehalem")


def test_what_falls_midway_or_slowly_is_named_at_its_step():
    steps = [(), (), (2, 3), ()]
    assert [step.fallen for step in check_steps(BEAM, FIRST)] == steps
    assert [check(BEAM[:n], FIRST).fallen for n in range(1, 5)] == steps
    # The load reaches 0.1 mm past the balance point: the slowest fall that a grid can hold.
    slow = built("cube; cuboid3:flat-y 1.004")
    assert check(slow.blocks, FIRST).fallen


WHEELS = built("2 cylinder:lying-x 2; cuboid3:flat-y; cube -2; cylinder:lying-y 1").blocks
"""Statics leave it open, and in PyBullet the load rolls off here and there."""
shifts_m = st.floats(-1, 1).map(lambda meters: round(meters, 6))


@settings(max_examples=4)
@given(shifts_m, shifts_m)
def test_no_verdict_depends_on_a_place(x_m, y_m):
    moved = [
        replace(one, position_m=(round(x + x_m, 6), round(y + y_m, 6), z))
        for one in WHEELS
        for x, y, z in [one.position_m]
    ]
    for verdict in (check_steps, check, lambda *one: settle(*one).fallen):
        assert verdict(moved, FIRST) == verdict(WHEELS, FIRST)


@pytest.mark.parametrize("trial", [ONE_SETTING, DEFAULT_TRIAL], ids=["one", "default"])
def test_the_same_falls_whatever_was_tried_before(trial):
    def settled(blocks, *, in_new_worlds):
        forgotten = (dynamics._settled, dynamics._stays)
        for cached in (*forgotten, dynamics._kept_world) if in_new_worlds else forgotten:
            cached.cache_clear()
        return settle(blocks, trial)

    structures = [task.scene.blocks for task in TASKS[::150]]
    structures += [BEAM[:3], structures[0][:1], BEAM, ()]
    first = [settled(blocks, in_new_worlds=True) for blocks in structures]
    again = [settled(blocks, in_new_worlds=False) for blocks in reversed(structures)][::-1]
    assert first == again == [settle(blocks, trial) for blocks in structures]
    assert not settle(BEAM, trial).fallen
    tipped = settle(BEAM[:3])
    assert tipped.fallen == check(BEAM[:3]).fallen == (2, 3)
    assert tipped.blocks[0] == BEAM[0]
    assert tipped.blocks[2].position_m[2] < BEAM[2].position_m[2] - 0.01


def test_what_rests_on_a_removed_block_moves_and_nothing_else():
    three = (*tower(2), block(3, "cube", (0.1, 0.0, 0.025)))
    outcome = dynamics.after_removal(three, 1)
    assert (outcome.is_clear, outcome.moved) == (True, (2,))
    assert outcome == dynamics.after_removal(three, 1)
    (height_m,) = (one.position_m[2] for one in outcome.settled if one.order == 2)
    assert height_m == pytest.approx(0.025, abs=0.002)
    alone = dynamics.after_removal(three, 3)
    assert (alone.moved, alone.settled) == ((), three[:2])


@pytest.mark.parametrize(("over_m", "verdict"), [(0.025, None), (0.035, False), (0.015, True)])
def test_weight_just_over_an_edge_is_not_clear(over_m, verdict):
    """A cube half of which hangs over falls in every level world, and stays on many a table."""
    pair = (*tower(1), block(2, "cube", (over_m, 0.0, 0.075)))
    assert dynamics.holds(pair, 2) is verdict
