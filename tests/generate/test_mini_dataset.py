from __future__ import annotations

from pathlib import Path

import pytest

from phyblock.datasets import read_builtin
from phyblock.errors import DataError, StoreError
from phyblock.generate import accept, designed_scenes, form_problems, make_candidates, write_dataset
from phyblock.generate.__main__ import main
from phyblock.sim import PictureStyle, find_gaps, find_overlaps
from phyblock.sim.pictures import drawn, goal_camera
from phyblock.sim.render import shoot

STORED = Path(__file__).parents[2] / "benchmarks" / "data" / "phyblock-mini"
SCENES = designed_scenes()
RECHECKED = {"l1-boat", "l1-dolmen", "l2-bridge", "l2-rocket", "l3-balance", "l3-robot"}


def test_the_stored_files_are_what_the_designs_give(tmp_path: Path) -> None:
    folder = tmp_path / STORED.name
    assert write_dataset(folder, SCENES, check=False) == len(SCENES)
    for name in ("scenes.jsonl", "README.md"):
        assert (folder / name).read_bytes() == (STORED / name).read_bytes()


def test_the_reader_gives_back_what_was_written() -> None:
    tasks = read_builtin(STORED).tasks
    assert tuple(task.scene for task in tasks) == SCENES
    assert [task.candidates for task in tasks] == [make_candidates(scene) for scene in SCENES]


def test_every_level_has_its_scenes() -> None:
    for level in (1, 2, 3, 4):
        assert sum(level in scene.levels for scene in SCENES) >= 5
    assert sum(scene.levels == (1, 2) for scene in SCENES) == 2


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.id)
def test_a_scene_is_in_form_and_fits_together(scene) -> None:
    assert form_problems(scene) == ()
    assert find_overlaps(scene.blocks) == ()
    assert find_gaps(scene.blocks) == ()


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.id)
def test_every_block_shows_in_the_goal_picture(scene) -> None:
    size_px = 256
    shot = shoot(drawn(scene), goal_camera(scene, PictureStyle()), size_px)
    for number, block in enumerate(scene.blocks):
        assert (shot.block == number).sum() >= 12, block


@pytest.mark.parametrize("scene", [s for s in SCENES if s.id in RECHECKED], ids=lambda s: s.id)
def test_physics_again(scene) -> None:
    accept(scene)


@pytest.mark.slow
def test_the_command_checks_and_writes_everything(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / STORED.name
    assert main([str(folder)]) == 0
    assert f"{len(SCENES)} scenes" in capsys.readouterr().out
    assert (folder / "scenes.jsonl").read_bytes() == (STORED / "scenes.jsonl").read_bytes()


def test_an_unsound_scene_writes_nothing(tmp_path: Path) -> None:
    gate = next(scene for scene in SCENES if scene.id == "l1-gate")
    broken = type(gate)("broken", (4,), gate.blocks, ("broken",))
    with pytest.raises(DataError, match="13 to 22 at level 4"):
        write_dataset(tmp_path / "out", [gate, broken])
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StoreError, match="cannot be written"):
        write_dataset(tmp_path / "file" / "out", SCENES[:1], check=False)
