from __future__ import annotations

from pathlib import Path

import pytest

from phyblock.datasets import read_builtin
from phyblock.errors import DataError
from phyblock.making.auditing.salvage import salvage
from tests.datasets.broken import sound_scene, with_value, without, write_checkout, write_scenes

TOLERATED = {
    "a cycle": ("blocks.0.depend", [2], "cycle"),
    "a dangling dependency": ("blocks.1.depend", [9], "names no block"),
    "candidates that look alike": ("candidates.2.euler", [0, 0, 0], "looks the same"),
    "a wrong layer": ("blocks.1.layer", 7, ""),
}
REFUSED = {
    "an unknown type": ("blocks.1.type", "sphere"),
    "an order twice": ("blocks.1.order", 1),
    "a position that is none": ("blocks.0.position", [0, 0, "high"]),
}


@pytest.mark.parametrize("official", [False, True])
@pytest.mark.parametrize("name", TOLERATED)
def test_blocks_that_make_sense_are_kept(name: str, official: bool, tmp_path: Path) -> None:
    field, value, said = TOLERATED[name]
    write = write_checkout if official else write_scenes
    write(tmp_path, with_value(sound_scene(), field, value))
    salvaged = salvage(tmp_path)
    assert [len(task.scene) for task in salvaged.tasks] == [2]
    assert [said in finding.message for finding in salvaged.findings] == ([True] if said else [])
    assert all(finding.scene == "s1" for finding in salvaged.findings)
    assert (salvaged.tasks[0].candidates is None) == ("alike" in name)


@pytest.mark.parametrize("official", [False, True])
@pytest.mark.parametrize("name", REFUSED)
def test_the_rest_is_told_and_left_out(name: str, official: bool, tmp_path: Path) -> None:
    good = with_value(sound_scene(), "id", "s2")
    write = write_checkout if official else write_scenes
    write(tmp_path, with_value(sound_scene(), *REFUSED[name]), good)
    salvaged = salvage(tmp_path)
    assert [task.scene.id for task in salvaged.tasks] == ["s2"]
    assert [finding.scene for finding in salvaged.findings] == ["s1" if official else "line 1"]


def test_a_missing_candidate_file_leaves_the_scene(tmp_path: Path) -> None:
    write_checkout(tmp_path, sound_scene())
    next((tmp_path / "data" / "SCENEs_400_Cand_Jsons").iterdir()).unlink()
    salvaged = salvage(tmp_path)
    assert [task.candidates for task in salvaged.tasks] == [None]
    assert "cannot be read" in salvaged.findings[0].message


def test_an_id_twice_is_kept_once(tmp_path: Path) -> None:
    write_scenes(tmp_path, sound_scene(), sound_scene())
    salvaged = salvage(tmp_path)
    assert len(salvaged.tasks) == 1
    assert "line 1 already" in salvaged.findings[0].message


def test_a_sound_set_reads_as_ever(tmp_path: Path) -> None:
    write_scenes(tmp_path, sound_scene())
    salvaged = salvage(tmp_path)
    assert salvaged.findings == ()
    (task,) = read_builtin(tmp_path).tasks
    assert (salvaged.tasks[0].scene, salvaged.tasks[0].candidates) == (task.scene, task.candidates)


def test_what_is_no_data_set_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no official scenes"):
        salvage(tmp_path)
    write_scenes(tmp_path, without(sound_scene(), "blocks"))
    assert salvage(tmp_path).tasks == ()
