"""The official layout: its scenes, its recordings, question files, and the names of its models."""

import json
import os
from collections import Counter

import pytest

from phyblock.data.official import (
    match_published,
    official_prompt,
    read_official,
    recorded_models,
)
from phyblock.data.scenes import read_builtin
from phyblock.errors import DataError
from phyblock.results.paper import published_table
from tests.data.broken import sound_scene, with_value, write_checkout, write_scenes

SCENE = {**sound_scene(), "levels": [3], "parents": ["s1"]}


def problems_of(root):
    with pytest.raises(DataError) as caught:
        read_official(root)
    return caught.value.problems


def goal_path(root):
    return root / "data" / "SCENEs_400_Goal_Jsons" / "s1.json"


def candidates_path(root):
    return root / "data" / "SCENEs_400_Cand_Jsons" / "s1_16_cand_blocks.json"


def change(path, field, value):
    raw = json.loads(path.read_text(encoding="utf-8"))
    changed = with_value({"root": raw}, f"root.{field}", value)["root"]
    path.write_text(json.dumps(changed), encoding="utf-8")


def test_both_formats_say_the_same_and_what_only_official_files_have_is_read(tmp_path):
    official = read_official(write_checkout(tmp_path, SCENE))
    assert official.tasks == read_builtin(write_scenes(tmp_path, SCENE)).tasks
    assert official.name == "official"
    (task,) = official.tasks
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


@pytest.mark.parametrize(
    ("file_of", "path", "value", "field", "message"),
    [
        (goal_path, "level", 5, "level", "out of range"),
        (goal_path, "combined", 80, "combined", "wrong type"),
        (goal_path, "combined", "_", "combined", "wrong form"),
        (goal_path, "lookat_pos", [0, 0, "0"], "lookat_pos[2]", "wrong type"),
        (goal_path, "blocks.1.depend", [9], "blocks[1].depend", "names no block"),
        (candidates_path, "1.position", 3, "[1].position", "is wrong"),
        (candidates_path, "1.euler", [0, 0, -90], "[2]", "looks the same as candidate 2"),
        (candidates_path, "0.color", "blue", "candidates", "hold nothing that block 1"),
    ],
)
def test_what_is_broken_is_named_with_file_and_field(
    tmp_path, file_of, path, value, field, message
):
    file = file_of(write_checkout(tmp_path, SCENE))
    change(file, path, value)
    (problem,) = problems_of(tmp_path)
    assert (problem.where, problem.field) == (str(file), field)
    assert message in problem.message


def test_what_is_wrong_in_every_scene_is_said_at_once_and_no_scenes_are_no_checkout(tmp_path):
    (problem,) = problems_of(tmp_path)
    assert problem.where == str(tmp_path)
    assert "checkout" in problem.allowed
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


def record(root, model, scene, raw):
    folder = root / "outputs" / model
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{scene}.json").write_text(json.dumps(raw), encoding="utf-8")


def test_recorded_models_are_the_folders_that_hold_replies(tmp_path):
    with pytest.raises(DataError, match="holds no recorded replies"):
        recorded_models(tmp_path)
    (tmp_path / "outputs" / "empty").mkdir(parents=True)
    with pytest.raises(DataError, match="holds no recorded replies"):
        recorded_models(tmp_path)
    record(tmp_path, "b", "000", {})
    record(tmp_path, "a", "000", {})
    assert list(recorded_models(tmp_path)) == ["a", "b"]


def test_the_official_prompt_is_what_all_recordings_carry_that_carry_one(tmp_path):
    record(tmp_path, "plain", "000", {"choices": []})
    with pytest.raises(DataError, match="carry 0 official prompts"):
        official_prompt(tmp_path)
    record(tmp_path, "a", "000", {"instruction": "<IMG_CONTEXT><IMG_CONTEXT>Build it."})
    record(tmp_path, "b", "000", {"instruction": "<|image_pad|><|image_pad|>Build it."})
    assert official_prompt(tmp_path) == "Build it."
    record(tmp_path, "c", "000", {"instruction": "<image>\n<image>Build this."})
    with pytest.raises(DataError, match="carry 2 official prompts"):
        official_prompt(tmp_path)


def test_the_official_scenes(official_checkout):
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


ROWS = [*dict.fromkeys([*published_table(1)["model"], *published_table(2)["model"]])]
FOLDERS = {
    "claude-3-5-haiku": "Claude-3.5 Haiku",
    "claude-3-7-thinking": "Claude-3.7 Sonnet-Thinking",
    "Qwen-VL-max": "Qwen-VL-Max",
    "gpt-o1": "GPT-o1",
    **dict.fromkeys(("InternVL2.5-4B", "claude-3-5", "gemini-2.0", "", "random-4")),
}


@pytest.mark.parametrize(("name", "row"), [*FOLDERS.items(), *zip(ROWS, ROWS, strict=True)])
def test_rows_are_found_by_names_of_models_and_of_folders(name, row):
    assert match_published(name) == match_published(name.upper()) == row
