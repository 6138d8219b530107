"""The official layout: its scenes, its recordings, question files, and the names of its models."""

import json
import os
from collections import Counter
from datetime import date

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from phyblock.data import official
from phyblock.data.official import match_published, read_official, read_official_questions
from phyblock.data.scenes import read_builtin
from phyblock.errors import DataError
from phyblock.results.tables import published_table
from tests.data.broken import sound_scene, with_value, write_checkout, write_scenes
from tests.workspace import problem_of

SCENE = {**sound_scene(), "levels": [3], "parents": ["s1"]}


def problems_of(root):
    with pytest.raises(DataError) as caught:
        read_official(root)
    return caught.value.problems


GOAL = "data/SCENEs_400_Goal_Jsons/s1.json"
CANDIDATES = "data/SCENEs_400_Cand_Jsons/s1_16_cand_blocks.json"


def change(path, field, value):
    path.write_text(json.dumps(with_value(json.loads(path.read_text()), field, value)))


def test_both_formats_say_the_same_and_what_only_official_files_have_is_read(tmp_path):
    read = read_official(write_checkout(tmp_path, SCENE))
    assert read.tasks == read_builtin(write_scenes(tmp_path, SCENE)).tasks
    assert read.name == "official"
    (task,) = read.tasks
    assert (task.scene.look_at_m, task.composite, task.scene.parents) == (None, None, ("s1",))
    # A level-2 scene counts in level 1 too; declared layers are taken as they are.
    extra = {"level": 2, "combined": "080_092", "lookat_pos": [0, 0, 0.1], "blocks.1.layer": 5}
    for field, value in extra.items():
        change(tmp_path / GOAL, field, value)
    picture = tmp_path / "data/SCENEs_400_Goal_and_Cand_Imgs_resized/s1.png"
    picture.parent.mkdir()
    picture.write_bytes(b"")
    (task,) = read_official(tmp_path).tasks
    scene = task.scene
    assert (scene.levels, scene.level, scene.parents) == ((1, 2), 2, ("080", "092"))
    assert (scene.look_at_m, task.composite) == ((0, 0, 0.1), picture)
    assert (scene.blocks[1].layer, scene.graph.layers) == (5, (1, 2))


@pytest.mark.parametrize(
    ("name", "path", "value", "field", "message"),
    [
        (GOAL, "level", 5, "level", "out of range"),
        (GOAL, "combined", 80, "combined", "wrong type"),
        (GOAL, "combined", "_", "combined", "wrong form"),
        (GOAL, "lookat_pos", [0, 0, "0"], "lookat_pos[2]", "wrong type"),
        (GOAL, "blocks.1.depend", [9], "blocks[1].depend", "names no block"),
        (CANDIDATES, "1.position", 3, "[1].position", "is wrong"),
        (CANDIDATES, "1.euler", [0, 0, -90], "[2]", "looks the same as candidate 2"),
        (CANDIDATES, "0.color", "blue", "candidates", "hold nothing that block 1"),
    ],
)
def test_what_is_broken_is_named_with_file_and_field(tmp_path, name, path, value, field, message):
    file = write_checkout(tmp_path, SCENE) / name
    change(file, path, value)
    (problem,) = problems_of(tmp_path)
    assert (problem.where, problem.field) == (str(file), field)
    assert message in problem.message


def test_what_is_wrong_in_every_scene_is_said_at_once_and_no_scenes_are_no_checkout(tmp_path):
    (problem,) = problems_of(tmp_path)
    assert problem.where == str(tmp_path)
    assert "checkout" in problem.allowed
    write_checkout(tmp_path, SCENE, {**SCENE, "id": "s2"}, {**SCENE, "id": "s3"})
    goals = (tmp_path / GOAL).parent
    (tmp_path / CANDIDATES).unlink()
    (goals / "s2.json").write_text("{\n  oops")
    (goals / "s3.json").rename(goals / os.fsdecode(b"\xff.json"))
    (missing, syntax, name) = problems_of(tmp_path)
    assert missing.where == str(tmp_path / CANDIDATES)
    assert "No such file" in missing.message
    assert syntax.where.endswith("s2.json:2:3")
    assert "not a name" in name.message


def test_recordings_are_folders_and_the_prompt_is_what_most_of_them_carry(tmp_path):
    def record(model, **raw):
        (tmp_path / "outputs" / model).mkdir()
        (tmp_path / "outputs" / model / "000.json").write_text(json.dumps(raw))

    (tmp_path / "outputs" / "empty").mkdir(parents=True)
    with pytest.raises(DataError, match="holds no recorded replies"):
        official.recorded_models(tmp_path)
    record("plain", choices=[])
    with pytest.raises(DataError, match="no recording carries the official prompt"):
        official.official_prompt(tmp_path)
    record("b", instruction="<|image_pad|><|image_pad|>Build it.")
    record("a", instruction="<IMG_CONTEXT><IMG_CONTEXT>Build it.")
    record("c", instruction="<image>\n<image>Build this.")
    assert official.official_prompt(tmp_path) == "Build it."
    assert list(official.recorded_models(tmp_path)) == ["a", "b", "c", "plain"]
    record("d", instruction="Build this.")
    with pytest.raises(DataError, match="different prompts"):
        official.official_prompt(tmp_path)


def test_the_official_scenes(official_checkout):
    scenes = [task.scene for task in read_official(official_checkout).tasks]
    assert [scene.id for scene in scenes] == [f"{i:03}" for i in range(400)]
    assert Counter(scene.levels for scene in scenes) == {(1, 2): 123, (3,): 158, (4,): 119}
    base = {scene.id for scene in scenes if scene.parents == (scene.id,)}
    assert len(base) == 150
    for scene in scenes:
        assert base.issuperset(scene.parents)
        assert len(scene.parents) == (1 if scene.id in base else 2)


COLOR = {"scene_id": "t1", "question": "What color is on top?", "answer": "B"}
COLOR["options"] = ["red", "blue", "green", "yellow"]
NEXT = {"scene_id": "t2", "question": "What comes next?", "answer": "<img3>"}
NEXT["options"] = [f"<img{number}>" for number in range(1, 5)]


def test_texts_pictures_and_orders_are_read(tmp_path, towers):
    for name, content in {
        "color.json": [COLOR, {**COLOR, "id": "mine", "answer": "blue"}],
        "PD.json": [NEXT],
        "Ordering.json": [{**NEXT, "answer": "CABD"}],
    }.items():
        (tmp_path / name).write_text(json.dumps(content))
    several = ("pd-001/img{}.png", "or-001/img{}.png")
    for name in ("t1.png", *(one.format(i) for one in several for i in range(1, 5))):
        path = tmp_path / "images" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", (8, 8), "red").save(path)
    tasks = read_official_questions(tmp_path, towers).tasks
    labels = [[picture.label for picture in task.question.pictures] for task in tasks]
    found = {
        task.key: (task.question.subtask, task.question.answer_letters, [*task.files], labels[n])
        for n, task in enumerate(tasks)
    }
    assert found == {
        "co-001": ("CO", "B", ["scene"], []),
        "mine": ("CO", "B", ["scene"], []),
        "or-001": ("OR", "CABD", [*"ABCD"], []),
        "pd-001": ("PD", "C", [*"ABCD"], ["scene"]),
    }
    files = {task.key: task.files for task in tasks}
    assert files["mine"] == {"scene": tmp_path / "images" / "t1.png"}


FAULTS = [
    ("CO.json", "{", ":2: is not JSON"),
    ("CO.json", {"scene_id": 1}, ": has the wrong type"),
    ("CO.json", [3], ": [0]: has the wrong type"),
    ("CO.json", [{**COLOR, "options": ["red", "blue"]}], ": [0].options: has too few items"),
    ("CO.json", [{**COLOR, "answer": 2}], ": [0].answer: has the wrong type"),
    ("CO.json", [COLOR, {**COLOR, "answer": "E"}], "[1]: answer: is none of the options"),
    ("CO.json", [{**COLOR, "answer": "purple"}], "[0]: answer: is none of the options"),
    ("CO.json", [{**COLOR, "scene_id": "t9"}], "[0]: scene_id: is not in the data set"),
    ("CO.json", [{**COLOR, "options": NEXT["options"]}], "[0]: options: the file is missing"),
    ("CO.json", [COLOR, {**COLOR, "id": "co-001"}], "[1]: id: is used at"),
    ("nonsense.json", [COLOR], ": the file: names no subtask"),
]


@pytest.mark.parametrize(("name", "content", "said"), FAULTS)
def test_each_fault_is_one_error_with_file_and_place(tmp_path, towers, name, content, said):
    with pytest.raises(DataError, match="holds no question files"):
        read_official_questions(tmp_path, towers)
    (tmp_path / name).write_text(content if content == "{" else json.dumps(content))
    problem = problem_of(DataError, read_official_questions, tmp_path, towers)
    assert str(problem).startswith(f"{tmp_path / name}{said}")


SPELLINGS = {
    "claude-3-5-haiku-20241022": "Claude-3.5 Haiku",
    "anthropic/claude-3-5-haiku@20241022": "Claude-3.5 Haiku",
    "claude-3-5-sonnet-latest": "Claude-3.5 Sonnet",
    "claude-3-7": "Claude-3.7 Sonnet",
    "claude-3-7-sonnet-20250219-thinking": "Claude-3.7 Sonnet-Thinking",
    "gpt4o": "GPT-4o",
    "openai/gpt-4o-2024-08-06": "GPT-4o",
    "gpt-4o-mini-2024-07-18": "GPT-4o-mini",
    "o1-2024-12-17": "GPT-o1",
    "o3": "GPT-o3",
    "gemini-1.5-flash-002": "Gemini-1.5-flash",
    "gemini-1.5-flash-8b-001": "Gemini-1.5-flash-8b",
    "gemini-2.0-flash-lite-preview-02-05": "Gemini-2.0-flash-lite",
    "gemini-2.0-flash-thinking-exp-1219": "Gemini-2.0-flash-thinking-exp",
    "qwen-vl-max-2025-01-25": "Qwen-VL-Max",
    "OpenGVLab/InternVL2_5-78B": "InternVL2.5-78B",
    "Qwen2_5-VL-3B": "Qwen2.5-VL-3B-Instruct",
    "llava-onevision-qwen2-7b-ov": "LLaVa-OneVision-7B",
    "lmms-lab/llava-onevision-qwen2-0.5b-ov": "LLaVa-OneVision-0.5B",
    "random": "Random",
}
OTHERS = [
    *("", "/", "日本", "claude-3-5", "claude-3-5-thinking", "claude-4-sonnet", "gpt-4", "o1-mini"),
    *("gpt-4o-audio-preview", "chatgpt-4o-latest", "gemini-2.0", "gemini-2.0-flash-exp"),
    *("gemini-1.5-pro", "gemini-2.5-flash-lite", "gemini-2.0-flash-8b", "qwen2-vl-max"),
    *("Qwen2.5-7B-Instruct", "Qwen2.5-VL-7B-Instruct-AWQ", "InternVL2-8B", "InternVL2_5-78B-MPO"),
    *("llava-onevision-qwen2-7b-ov-chat", "llava-onevision-qwen2-72b-ov", "random-4"),
]
ROWS = [*dict.fromkeys([*published_table(1)["model"], *published_table(2)["model"]])]


KNOWN = SPELLINGS | dict(zip(ROWS, ROWS, strict=True)) | dict.fromkeys(OTHERS)


@pytest.mark.parametrize(("name", "published"), KNOWN.items())
def test_known_spellings_are_those_of_published_models_and_others_of_none(name, published):
    assert match_published(name) == published


names = st.sampled_from([*ROWS, *SPELLINGS])
dates = st.dates(date(2020, 1, 1), date(2030, 12, 31))
FORMS = ["%Y-%m-%d", "%Y%m%d", "%Y_%m_%d", "%m-%d", "%m%d"]


@given(st.sampled_from(ROWS), dates, st.sampled_from(FORMS))
def test_a_release_date_changes_nothing(name, day, form):
    assert match_published(f"{name}-{day:{form}}") == name


@given(names, st.randoms())
def test_case_and_separators_change_nothing(name, draw):
    other = "".join(
        draw.choice("-_. ") if char in "-_. " else draw.choice([char.lower(), char.upper()])
        for char in name.rpartition("/")[2]
    )
    assert match_published(other) == match_published(name)


@given(names, st.from_regex(r"[a-z]{2,9}", fullmatch=True))
def test_an_unknown_word_makes_it_another_model(name, word):
    known = {"mini", "thinking", "lite", "latest", "preview", "exp", "instruct", "ov", "hf"}
    if word not in known:
        assert match_published(f"{name}-{word}") is None


@given(st.text(max_size=40))
def test_any_text_is_a_published_name_or_unknown(name):
    assert match_published(name) in {None, *ROWS}
