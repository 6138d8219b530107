from __future__ import annotations

from pathlib import Path

import pytest

from phyblock.data import read_official
from phyblock.sim.dynamics import Trial, check
from phyblock.sim.engine import Physics
from tests.sim.structures import block, counterweighted_beam, tower
from tests.sim.test_support import FLOATING

QUICK = Trial(duration_s=1.0, physics=(Physics(),))


def test_a_tower_stands() -> None:
    found = check(tower(4))
    assert found.stable
    assert found.agreed
    assert found.moved_m < 0.002


def test_nothing_at_all_stands() -> None:
    assert check([]).stable


def test_an_overhang_falls() -> None:
    blocks = [*tower(1), block(2, "cuboid3", (0.08, 0.0, 0.0625))]
    found = check(blocks, QUICK)
    assert found.fallen == (2,)
    assert found.moved_m > 0.005


def test_prefixes_find_what_stands_only_when_finished() -> None:
    blocks = counterweighted_beam()
    assert check(blocks, QUICK).stable
    assert [check(blocks[:count], QUICK).stable for count in range(1, 5)] == [
        True,
        True,
        False,
        True,
    ]


def test_what_rests_on_nothing_falls_alone() -> None:
    blocks = [*tower(3), block(4, "cube", (0.2, 0.0, 0.025))]
    assert check(blocks[1:], QUICK).fallen == (2, 3)
    assert check(blocks[:-1], QUICK).stable


@pytest.mark.parametrize(
    ("name", "stands"),
    [("000", True), ("018", True), ("089", True), ("040", False), ("116", False), ("184", False)],
)
def test_official_scenes_stand_unless_a_block_floats(
    name: str, stands: bool, official_checkout: Path
) -> None:
    scenes = {task.scene.id: task.scene for task in read_official(official_checkout).tasks}
    assert check(scenes[name].blocks, QUICK).stable == stands


@pytest.mark.slow
def test_of_all_official_scenes_only_the_floating_fall(official_checkout: Path) -> None:
    trial = Trial(physics=(Physics(),))
    tasks = read_official(official_checkout).tasks
    assert {t.scene.id for t in tasks if not check(t.scene.blocks, trial).stable} == FLOATING
