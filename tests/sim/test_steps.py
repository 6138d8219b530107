from __future__ import annotations

from dataclasses import replace

import pytest

from phyblock.domain import Block
from phyblock.sim.contact import bounds_m
from phyblock.sim.dynamics import (
    DEFAULT_TRIAL,
    Rest,
    check,
    check_steps,
    groups,
)
from tests.designs.pad import Pad
from tests.designs.scenes import designed_scenes

SCENES = {scene.id: scene.blocks for scene in designed_scenes()}
FIRST = replace(DEFAULT_TRIAL, physics=DEFAULT_TRIAL.physics[:1])


def beam() -> list[Block]:
    """Stands when finished; falls when one end alone is loaded."""
    sketch = Pad()
    sketch.put("cube")
    sketch.put("cuboid3", pose="flat-y")
    sketch.pair("cube", 2.8)
    return sketch.blocks


def two_gates() -> list[Block]:
    sketch = Pad()
    for y in (-4, 4):
        sketch.put("arch", y)
        sketch.put("triangle", y)
    return sketch.blocks


@pytest.mark.parametrize("name", ["l1-dolmen", "l2-rocket", "l3-balance", "l4-playground"])
def test_steps_stand_as_the_long_trial_says(name: str) -> None:
    blocks = SCENES[name]
    assert [step.fallen for step in check_steps(blocks, FIRST)] == [()] * len(blocks)
    assert all(check(blocks[:count], FIRST).stable for count in range(1, 5))
    assert check(blocks, FIRST).stable


def test_what_falls_midway_is_named_at_its_step() -> None:
    steps = check_steps(beam(), FIRST)
    assert [step.fallen for step in steps] == [(), (), (2, 3), ()]
    assert [check(beam()[:n], FIRST).fallen for n in range(1, 5)] == [(), (), (2, 3), ()]


def test_a_slow_tip_is_not_taken_for_rest() -> None:
    """The load reaches 0.1 mm past the balance point: the slowest fall that a grid can hold."""
    sketch = Pad()
    sketch.put("cube")
    sketch.put("cuboid3", 1.004, pose="flat-y")
    assert not check(sketch.blocks, FIRST).stable
    assert check(sketch.blocks[:1], FIRST).stable


def test_groups_are_what_nothing_brings_near() -> None:
    gates = two_gates()
    assert [[b.order for b in group] for group in groups(gates)] == [[1, 2], [3, 4]]
    assert len(groups(gates, reach_m=0.2)) == 1
    assert groups([]) == ()


def test_a_fall_in_one_group_is_found_and_the_other_stands() -> None:
    gates = two_gates()
    x, y, z = gates[3].position_m
    gates[3] = replace(gates[3], position_m=(x, y, z + 0.03))
    assert check(gates, FIRST).fallen == (4,)
    assert [step.fallen for step in check_steps(gates, FIRST)] == [(), (), (), (4,)]


def test_a_longer_rest_changes_no_verdict() -> None:
    assert check_steps(beam(), FIRST, Rest(quiet_s=1.0))[2].fallen == (2, 3)


def test_bounds_are_those_of_the_turned_block() -> None:
    sketch = Pad()
    sketch.put("cuboid2", pose="flat-y")
    low, high = bounds_m(sketch.blocks[0])
    assert (high - low).tolist() == pytest.approx([0.05, 0.1, 0.025])
    assert low[2] == pytest.approx(0.0)
