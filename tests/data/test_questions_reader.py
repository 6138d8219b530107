"""The reader of questions: what is sound reads back, what is broken is named with its line."""

import contextlib
import copy

import pytest
from hypothesis import given, settings

from phyblock.data.questions import read_questions
from phyblock.data.scenes import read_builtin
from phyblock.domain.question import Mark
from phyblock.domain.scene import Block
from phyblock.errors import DataError
from tests.data.broken import sound_scene, without, write_scenes
from tests.fuzz.strategies import QUESTIONS
from tests.workspace import tower, write_lines

QUESTION = {
    "id": "co-001",
    "subtask": "CO",
    "category": "object_property",
    "scene_id": "s1",
    "wording": "co-1",
    "question": "What is the color of the cube?",
    "options": ["red", "blue", "green", "yellow"],
    "answer": "B",
    "colors": {"1": "blue"},
    "pictures": [{"label": "scene", "view": [45, 22]}],
    "evidence": {"slots": {"block": "cube"}},
}


@pytest.fixture
def scenes(tmp_path):
    return read_builtin(write_scenes(tmp_path, sound_scene()))


def write(folder, *questions):
    folder.mkdir(exist_ok=True)
    return write_lines(folder / "questions.jsonl", questions).parent


def read_one(folder, scenes, question):
    (task,) = read_questions(write(folder, question), scenes).tasks
    return task


def test_a_picture_is_the_scene_but_for_what_its_recipe_says(tmp_path, scenes):
    added = sound_scene()["blocks"][0] | {"order": 9, "position": [0.2, 0, 0.025]}
    recipe = {
        "label": "scene",
        "view": [90, 30],
        "without": [1],
        "poses": {"2": {"position": [0, 0, 0.1], "euler": [0, 0, 45]}},
        "swap": {"2": {"type": "cuboid2", "color": "green"}},
        "add": [added],
        "marks": [{"letter": "A", "position": [0, 0, 0.1]}],
        "framed": True,
    }
    asked = QUESTION | {"pictures": [recipe], "background": "lawn"}
    task = read_one(tmp_path / "q", scenes, asked)
    (picture,) = task.question.pictures
    assert picture.background == "lawn"
    assert picture.blocks == (
        Block(2, "cuboid2", "green", (0, 0, 0.1), (0, 0, 45), (1,), 2),
        Block(9, "cube", "red", (0.2, 0, 0.025), (0, 0, 0), (), 1),
    )
    assert picture.marks == (Mark("A", (0, 0, 0.1)),)
    assert picture.framed == task.scene.blocks


PICTURE_OPTIONS = ["<img1>", "<img2>", "<img3>", "<img4>"]
BROKEN = {
    "a scene that is not there": ({"scene_id": "s9"}, "scene_id", '"s9"'),
    "an answer outside the options": ({"answer": "E"}, "answer", '"E"'),
    "an order for one answer": ({"answer": "BADC"}, "answer", '"BADC"'),
    "two equal options": ({"options": ["red", "blue", "Red ", "green"]}, "options[2]", '"Red "'),
    "three options": ({"options": ["red", "blue", "green"]}, "options", "3"),
    "an unknown subtask": ({"subtask": "XX"}, "subtask", '"XX"'),
    "another category": ({"category": "dynamic_reasoning"}, "category", '"dynamic_reasoning"'),
    "a blank text": ({"question": " "}, "question", '" "'),
    "a color of no block": ({"colors": {"7": "red"}}, "colors", '"7"'),
    "an unknown background": ({"background": "sand"}, "background", '"sand"'),
    "an unknown color": ({"colors": {"1": "pink"}}, "colors.1", '"pink"'),
    "a misspelled field": ({"colours": {"1": "red"}}, "colours", ""),
    "places that are not marked": (
        {"options": [f"place {letter}" for letter in "ABCD"]},
        "pictures",
        '["A", "B", "C", "D"]',
    ),
    "pictures that are missing": ({"options": PICTURE_OPTIONS}, "pictures", '["A", "B", "C", "D"]'),
}
BROKEN_PICTURES = {
    "a view from below": ({"view": [45, 0]}, "pictures[0].view[1]", "0"),
    "a view with one angle": ({"view": [45]}, "pictures[0].view", "[45]"),
    "an unknown label": ({"label": "E"}, "pictures[0].label", '"E"'),
    "no such block": ({"without": [3]}, "pictures[0].without", "3"),
    "a pose of no block": (
        {"poses": {"3": {"position": [0, 0, 0], "euler": [0, 0, 0]}}},
        "pictures[0].poses",
        '"3"',
    ),
    "a type that is not known": (
        {"swap": {"1": {"type": "ball", "color": "red"}}},
        "pictures[0].swap.1.type",
        '"ball"',
    ),
    "a block added twice": ({"add": [sound_scene()["blocks"][0]]}, "pictures[0].add", "1"),
    "nothing to draw": ({"without": [1, 2]}, "pictures[0]", ""),
    "a misspelled field": ({"widthout": [1]}, "pictures[0].widthout", ""),
    "a mark beyond": (
        {"marks": [{"letter": "A", "position": [0, 0, 1e9]}]},
        "pictures[0].marks[0].position[2]",
        "1000000000.0",
    ),
    "too many blocks": ({"add": [sound_scene()["blocks"][0]] * 100}, "pictures[0].add", None),
    "a mark of no letter": (
        {"marks": [{"letter": "E", "position": [0, 0, 0]}]},
        "pictures[0].marks[0].letter",
        '"E"',
    ),
}


@pytest.mark.parametrize(("change", "field", "found"), BROKEN.values(), ids=BROKEN)
def test_what_is_wrong_is_named_with_its_line(tmp_path, scenes, change, field, found):
    folder = write(tmp_path / "q", QUESTION, QUESTION | {"id": "co-002"} | change)
    with pytest.raises(DataError) as caught:
        read_questions(folder, scenes)
    (problem,) = caught.value.problems
    assert problem.where == f"{folder / 'questions.jsonl'}:2"
    assert (problem.field, problem.found) == (field, found)


@pytest.mark.parametrize(
    ("change", "field", "found"), BROKEN_PICTURES.values(), ids=BROKEN_PICTURES
)
def test_what_is_wrong_in_a_picture_is_named(tmp_path, scenes, change, field, found):
    question = copy.deepcopy(QUESTION)
    question["pictures"][0] |= change
    with pytest.raises(DataError) as caught:
        read_questions(write(tmp_path / "q", question), scenes)
    (problem,) = caught.value.problems
    assert problem.field == field
    assert found in (None, problem.found)


def test_a_number_that_is_used_twice_is_told(tmp_path, scenes):
    folder = write(tmp_path / "q", QUESTION, QUESTION | {"id": "co-002"}, QUESTION)
    with pytest.raises(DataError, match=r"questions.jsonl:3: id: is used at .*:1 already"):
        read_questions(folder, scenes)


@pytest.mark.parametrize("field", ["id", "subtask", "scene_id", "question", "options", "answer"])
def test_a_missing_field_is_told(tmp_path, scenes, field):
    with pytest.raises(DataError, match=rf"questions.jsonl:1: {field}: is missing"):
        read_questions(write(tmp_path / "q", without(QUESTION, field)), scenes)


def test_an_empty_file_and_no_file_are_told(tmp_path, scenes):
    with pytest.raises(DataError, match="holds no questions"):
        read_questions(write(tmp_path / "q"), scenes)
    with pytest.raises(DataError, match=r"a folder with questions\.jsonl"):
        read_questions(tmp_path, scenes)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("question", "Which color has the cube?"),
        ("options", ["red", "blue", "yellow", "green"]),
        ("answer", "C"),
        ("colors", {"1": "green"}),
        ("pictures", [{"label": "scene", "view": [45, 22], "without": [2]}]),
        ("evidence", {"slots": {"block": "blue cube"}}),
        ("wording", "co-2"),
    ],
)
def test_the_digest_of_a_set_follows_every_field(tmp_path, scenes, field, value):
    digests = [
        read_questions(write(tmp_path / name, question), scenes).sha256
        for name, question in (("a", QUESTION), ("b", QUESTION), ("c", {**QUESTION, field: value}))
    ]
    assert digests[0] == digests[1] != digests[2]


def test_complaints_of_one_line_are_bounded(tmp_path, scenes):
    question = copy.deepcopy(QUESTION)
    question["pictures"][0]["without"] = [9] * 20
    question.update({f"field{i}": [0] * 20 for i in range(5_000)})
    with pytest.raises(DataError) as caught:
        read_questions(write(tmp_path / "q", question), scenes)
    assert len(caught.value.problems) == 100


def test_a_whole_character_in_two_escapes_is_fine(tmp_path, scenes):
    text = "How many \U0001f9f1?"
    assert read_one(tmp_path / "q", scenes, QUESTION | {"question": text}).question.text == text


@settings(max_examples=40)
@given(QUESTIONS)
def test_any_question_is_read_or_refused(tmp_path_factory, line):
    folder = tmp_path_factory.getbasetemp()
    scenes = read_builtin(write_scenes(folder, tower("t1", [1, 2], ("red", "blue"))))
    (folder / "questions.jsonl").write_bytes(line)
    with contextlib.suppress(DataError):
        questions = read_questions(folder, scenes)
        assert len(questions.sha256) == 64
        assert all(task.question.text.encode() for task in questions.tasks)
