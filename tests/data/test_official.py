"""The reader of the official layout, on checkouts written here and on the real one."""

from __future__ import annotations

import json
import os
from collections import Counter
from pathlib import Path

import pytest

from phyblock.data import official_prompt, read_builtin, read_official, recorded_models
from phyblock.errors import DataError, Problem
from tests.data.broken import sound_scene, with_value, write_checkout, write_scenes

SCENE = {**sound_scene(), "levels": [3], "parents": ["s1"]}


def problems_of(root: Path) -> tuple[Problem, ...]:
    with pytest.raises(DataError) as caught:
        read_official(root)
    return caught.value.problems


def goal_path(root: Path) -> Path:
    return root / "data" / "SCENEs_400_Goal_Jsons" / "s1.json"


def candidates_path(root: Path) -> Path:
    return root / "data" / "SCENEs_400_Cand_Jsons" / "s1_16_cand_blocks.json"


def change(path: Path, field: str, value: object) -> None:
    raw = json.loads(path.read_text(encoding="utf-8"))
    changed = with_value({"root": raw}, f"root.{field}", value)["root"]
    path.write_text(json.dumps(changed), encoding="utf-8")


def test_both_formats_say_the_same(tmp_path: Path) -> None:
    official = read_official(write_checkout(tmp_path, SCENE))
    assert official.tasks == read_builtin(write_scenes(tmp_path, SCENE)).tasks
    assert official.name == "official"


def test_what_only_official_files_have_is_read(tmp_path: Path) -> None:
    (task,) = read_official(write_checkout(tmp_path, SCENE)).tasks
    assert (task.scene.look_at_m, task.composite, task.scene.parents) == (None, None, ("s1",))
    # A level-2 scene counts in level 1 too; declared layers are taken as they are.
    for field, value in (
        *(("level", 2), ("combined", "080_092"), ("lookat_pos", [0, 0, 0.1])),
        ("blocks.1.layer", 5),
    ):
        change(goal_path(tmp_path), field, value)
    picture = tmp_path / "data" / "SCENEs_400_Goal_and_Cand_Imgs_resized" / "s1.png"
    picture.parent.mkdir()
    picture.write_bytes(b"")
    (task,) = read_official(tmp_path).tasks
    scene = task.scene
    assert (scene.levels, scene.level, scene.parents) == ((1, 2), 2, ("080", "092"))
    assert (scene.look_at_m, task.composite) == ((0, 0, 0.1), picture)
    assert (scene.blocks[1].layer, scene.graph.layers) == (5, (1, 2))


BROKEN_GOALS: dict[str, tuple[str, object, str, str]] = {
    "level 5": ("level", 5, "level", "allowed number"),
    "combined is a number": ("combined", 80, "combined", "not allowed"),
    "combined names nothing": ("combined", "_", "combined", "not allowed"),
    "camera target": ("lookat_pos", [0, 0], "lookat_pos", "not a vector"),
    "dangling depend": ("blocks.1.depend", [9], "blocks[1].depend", "names no block"),
}


@pytest.mark.parametrize("name", BROKEN_GOALS)
def test_a_broken_goal_is_named_with_file_and_field(tmp_path: Path, name: str) -> None:
    path, value, field, message = BROKEN_GOALS[name]
    goal = goal_path(write_checkout(tmp_path, SCENE))
    change(goal, path, value)
    (problem,) = problems_of(tmp_path)
    assert (problem.where, problem.field) == (str(goal), field)
    assert message in problem.message


BROKEN_CANDIDATES: dict[str, tuple[str, object, str, str]] = {
    "wrong number": ("1.position", 3, "candidates[1].position", "is wrong"),
    "duplicate look": ("1.euler", [0, 0, -90], "candidates[2]", "looks the same as candidate 2"),
    "unsolvable": ("0.color", "blue", "candidates", "hold nothing that block 1"),
}


@pytest.mark.parametrize("name", BROKEN_CANDIDATES)
def test_a_broken_candidate_set_is_named_with_file_and_field(tmp_path: Path, name: str) -> None:
    path, value, field, message = BROKEN_CANDIDATES[name]
    candidates = candidates_path(write_checkout(tmp_path, SCENE))
    change(candidates, path, value)
    (problem,) = problems_of(tmp_path)
    assert (problem.where, problem.field) == (str(candidates), field)
    assert message in problem.message


def test_what_is_wrong_in_every_scene_is_said_at_once(tmp_path: Path) -> None:
    write_checkout(tmp_path, SCENE, {**SCENE, "id": "s2"}, {**SCENE, "id": "s3"})
    goals = goal_path(tmp_path).parent
    candidates_path(tmp_path).unlink()
    (goals / "s2.json").write_text("{\n  oops")
    (goals / "s3.json").rename(goals / os.fsdecode(b"\xff.json"))
    (missing, syntax, name) = problems_of(tmp_path)
    assert missing.where == str(candidates_path(tmp_path))
    assert "No such file" in missing.message
    assert syntax.where.endswith("s2.json:2:3")
    assert "not a name" in name.message


def test_a_folder_without_scenes_is_no_checkout(tmp_path: Path) -> None:
    (problem,) = problems_of(tmp_path)
    assert problem.where == str(tmp_path)
    assert "checkout" in problem.allowed


def record(root: Path, model: str, scene: str, raw: object) -> None:
    folder = root / "outputs" / model
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{scene}.json").write_text(json.dumps(raw), encoding="utf-8")


def test_recorded_models_are_the_folders_that_hold_replies(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="holds no recorded replies"):
        recorded_models(tmp_path)
    (tmp_path / "outputs" / "empty").mkdir(parents=True)
    with pytest.raises(DataError, match="holds no recorded replies"):
        recorded_models(tmp_path)
    record(tmp_path, "b", "000", {})
    record(tmp_path, "a", "000", {})
    assert list(recorded_models(tmp_path)) == ["a", "b"]


def test_the_official_prompt_is_what_most_recordings_carry(tmp_path: Path) -> None:
    record(tmp_path, "plain", "000", {"choices": []})
    with pytest.raises(DataError, match="no recording carries the official prompt"):
        official_prompt(tmp_path)
    record(tmp_path, "a", "000", {"instruction": "<IMG_CONTEXT><IMG_CONTEXT>Build it."})
    record(tmp_path, "b", "000", {"instruction": "<|image_pad|><|image_pad|>Build it."})
    assert official_prompt(tmp_path) == "Build it."
    record(tmp_path, "c", "000", {"instruction": "<image>\n<image>Build this."})
    assert official_prompt(tmp_path) == "Build it."
    record(tmp_path, "d", "000", {"instruction": "Build this."})
    with pytest.raises(DataError, match="different prompts"):
        official_prompt(tmp_path)


def test_the_official_scenes(official_checkout: Path) -> None:
    tasks = read_official(official_checkout).tasks
    assert len(tasks) == 400
    assert [task.scene.id for task in tasks] == [f"{i:03}" for i in range(400)]
    assert Counter(task.scene.levels for task in tasks) == {(1, 2): 123, (3,): 158, (4,): 119}
    ids = {task.scene.id for task in tasks}
    base = {task.scene.id for task in tasks if task.scene.parents == (task.scene.id,)}
    assert len(base) == 150
    for task in tasks:
        assert ids.issuperset(task.scene.parents)
        if task.scene.id not in base:
            assert len(task.scene.parents) == 2
            assert base.issuperset(task.scene.parents)


def test_the_official_prompt_asks_for_the_form_that_is_parsed(official_checkout: Path) -> None:
    assert "Move block with index" in official_prompt(official_checkout)
