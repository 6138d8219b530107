from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.data import read_builtin
from phyblock.domain import Scene
from phyblock.domain.symmetry import canonical_form
from phyblock.errors import DataError, StoreError
from phyblock.making.scenes.files import SetWriter, card, open_writer, sums_text
from phyblock.making.scenes.production import Order, Share, produce, shares
from phyblock.making.workers import open_workers
from phyblock.sim.engine import (
    REFERENCE_ENGINE,
    described_engine,
    installed_engines,
    other_engine,
    physics_engine,
)
from phyblock.sim.pictures import hidden_blocks
from tests.designs.acceptance import accept

SMALL = Order(3, "kit", (Share("1", 3, 1), Share("2", 4, 2), Share("3", 2, 1)))


def made(order: Order, jobs: int = 1) -> list[Scene]:
    with open_workers(jobs) as workers:
        return list(produce(order, workers))


def write(folder: Path, scenes: list[Scene]) -> SetWriter:
    with open_writer(folder, "kit") as writer:
        for scene in scenes:
            writer.add(scene)
        writer.finish("card\n")
    return writer


@pytest.fixture(scope="module")
def scenes() -> list[Scene]:
    return made(SMALL)


def test_a_card_names_another_engine_and_not_the_usual_one(
    scenes: list[Scene], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written = write(tmp_path / "set", scenes)
    others = f", by {other_engine()}" if other_engine() else ""
    assert bool(others) == (physics_engine().name != REFERENCE_ENGINE)
    here = card("few", written, "make", "kit")
    assert f"number of processes{others}.\n" in here
    usual = here.replace(others, "")
    if "mujoco" in installed_engines():
        monkeypatch.setenv("PHYBLOCK_PHYSICS", "mujoco")
        told = f"number of processes, by the physics engine {described_engine()}"
        assert card("few", written, "make", "kit") == usual.replace("number of processes", told)


@given(st.integers(1, 5000), st.sets(st.integers(1, 4), min_size=1))
def test_shares_add_up(count: int, levels: set[int]) -> None:
    found = shares(count, sorted(levels))
    assert sum(share.base + share.varied for share in found) == count
    assert {level for share in found for level in map(int, share.group.split("+"))} <= levels


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.slow)])
def test_every_scene_is_accepted_again_with_the_long_trial(scenes: list[Scene], every: int) -> None:
    for scene in scenes[::every]:
        accept(scene)
        assert hidden_blocks(scene) == ()


def test_no_two_scenes_are_the_same(scenes: list[Scene]) -> None:
    assert len({canonical_form(scene.blocks) for scene in scenes}) == len(scenes)


def test_variations_name_base_scenes(scenes: list[Scene]) -> None:
    bases = {scene.id for scene in scenes if scene.parents == (scene.id,)}
    varied = [scene for scene in scenes if scene.id not in bases]
    assert varied
    assert all(set(scene.parents) <= bases for scene in varied)


@pytest.mark.slow
def test_two_processes_give_the_same_bytes(tmp_path: Path, scenes: list[Scene]) -> None:
    for jobs, folder in ((1, tmp_path / "one" / "set"), (2, tmp_path / "two" / "set")):
        write(folder, made(SMALL, jobs))
    one, two = ((tmp_path / name / "set" / "scenes.jsonl").read_bytes() for name in ("one", "two"))
    assert one == two
    assert len(one.splitlines()) == len(scenes)


def test_what_is_written_is_read_back(tmp_path: Path, scenes: list[Scene]) -> None:
    folder = tmp_path / "set"
    writer = write(folder, scenes)
    assert [task.scene for task in read_builtin(folder).tasks] == sorted(
        scenes, key=lambda scene: scene.id
    )
    assert (folder / "SHA256SUMS").read_text() == sums_text(folder)
    assert sorted(path.name for path in folder.iterdir()) == [
        "README.md",
        "SHA256SUMS",
        "VERSION",
        "scenes.jsonl",
    ]
    assert writer.levels[2].scenes == 6
    with pytest.raises(StoreError, match="holds a data set already"), open_writer(folder, "kit"):
        pass


def test_a_failure_leaves_nothing_half_written(tmp_path: Path, scenes: list[Scene]) -> None:
    folder = tmp_path / "set"
    with pytest.raises(DataError, match="at most 16"):
        write(folder, [scenes[0], too_many_looks(scenes[0])])
    assert list(folder.iterdir()) == []


def too_many_looks(scene: Scene) -> Scene:
    block = scene.blocks[0]
    blocks = tuple(replace(block, euler_deg=(0.0, 0.0, 3.0 * i)) for i in range(18))
    return replace(scene, blocks=tuple(replace(b, type="arch", color="red") for b in blocks))


def test_rules_that_give_no_more_say_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("phyblock.making.scenes.production._PATIENCE", 3)
    order = Order(0, "kit", (Share("1", 100_000, 0),))
    with pytest.raises(DataError, match="new scenes of 100000"):
        for _ in zip(range(400), produce(order, _Nothing()), strict=False):
            pass


class _Nothing:
    """Workers whose rules never give a scene."""

    def map(self, function, tasks):
        del function
        return (None for _ in tasks)
