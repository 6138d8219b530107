"""The reader of questions: what is sound reads back, what is broken is named with its line."""

import contextlib

import pytest
from hypothesis import given, settings

from phyblock.data.questions import read_questions
from phyblock.data.scenes import read_builtin
from phyblock.domain.question import Mark, QuestionPicture
from phyblock.errors import DataError
from tests.data.broken import sound_scene, with_value, without, write_scenes
from tests.fuzz.strategies import QUESTIONS, sound_question
from tests.sim.structures import block
from tests.workspace import problem_of, tower, write_questions

QUESTION = sound_question("s1") | {"id": "co-001"}


@pytest.fixture
def scenes(tmp_path):
    return read_builtin(write_scenes(tmp_path, sound_scene()))


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
    # A whole character in two escapes is fine.
    asked["question"] = "How many \U0001f9f1?"
    (task,) = read_questions(write_questions(tmp_path / "q", [asked]), scenes).tasks
    assert task.question.text == asked["question"]
    blocks = (
        block(2, "cuboid2", (0, 0, 0.1), (0, 0, 45), "green", (1,)),
        block(9, "cube", (0.2, 0, 0.025), (0, 0, 0)),
    )
    shown = {"marks": (Mark("A", (0, 0, 0.1)),), "framed": task.scene.blocks, "background": "lawn"}
    assert task.question.pictures == (QuestionPicture("scene", blocks, (90, 30), **shown),)


POSE = {"position": [0, 0, 0], "euler": [0, 0, 0]}
BALL = {"type": "ball", "color": "red"}
CUBE = sound_scene()["blocks"][0]
ALL = '["A", "B", "C", "D"]'
BROKEN = [
    # field of the question, its value, field of the problem, what was found
    ("scene_id", "s9", "scene_id", '"s9"'),
    ("answer", "E", "answer", '"E"'),
    ("answer", "BADC", "answer", '"BADC"'),
    ("options", ["red", "blue", "Red ", "green"], "options[2]", '"Red "'),
    ("options", ["red", "blue", "green"], "options", '["red", "blue", "green"]'),
    ("options", ["<img1>", "<img2>", "<img3>", "<img4>"], "pictures", ALL),
    ("options", [f"place {letter}" for letter in "ABCD"], "pictures", '["B", "C", "D"]'),
    ("subtask", "XX", "subtask", '"XX"'),
    ("category", "dynamic_reasoning", "category", '"dynamic_reasoning"'),
    ("question", " ", "question", '" "'),
    ("colors", {"7": "red"}, "colors", '"7"'),
    ("colors", {"1": "pink"}, "colors.1", '"pink"'),
    ("background", "sand", "background", '"sand"'),
    ("colours", {"1": "red"}, "colours", ""),
    ("pictures.0.view", [45, 0], "pictures[0].view[1]", "0"),
    ("pictures.0.view", [45], "pictures[0].view", "[45]"),
    ("pictures.0.label", "E", "pictures[0].label", '"E"'),
    ("pictures.0.without", [3], "pictures[0].without", "3"),
    ("pictures.0.without", [1, 2], "pictures[0]", ""),
    ("pictures.0.widthout", [1], "pictures[0].widthout", ""),
    ("pictures.0.poses", {"3": POSE}, "pictures[0].poses", '"3"'),
    ("pictures.0.swap", {"1": BALL}, "pictures[0].swap.1.type", '"ball"'),
    ("pictures.0.add", [CUBE], "pictures[0].add", "1"),
    ("pictures.0.marks", [{"letter": "E", "position": [0, 0, 0]}], "pictures[0].marks[0].letter",
     '"E"'),
    ("pictures.0.marks", [{"letter": "A", "position": [0, 0, 1e9]}],
     "pictures[0].marks[0].position[2]", "1000000000.0"),
]  # fmt: skip


@pytest.mark.parametrize(("at", "value", "field", "found"), BROKEN)
def test_what_is_wrong_is_named_with_its_line(tmp_path, scenes, at, value, field, found):
    broken = with_value(QUESTION | {"id": "co-002"}, at, value)
    folder = write_questions(tmp_path / "q", [QUESTION, broken])
    problem = problem_of(DataError, read_questions, folder, scenes)
    assert problem.where == f"{folder / 'questions.jsonl'}:2"
    assert (problem.field, problem.found) == (field, found)


def test_what_is_missing_or_there_twice_is_told(tmp_path, scenes):
    with pytest.raises(DataError, match=r"a folder with questions\.jsonl"):
        read_questions(tmp_path, scenes)
    twice = (QUESTION, QUESTION | {"id": "co-002"}, QUESTION)
    fields = ("id", "subtask", "scene_id", "question", "options", "answer")
    for lines, said in (
        ((), "holds no questions"),
        (twice, r"questions.jsonl:3: id: is used at .*:1 already"),
        *(([without(QUESTION, one)], rf"questions.jsonl:1: {one}: is missing") for one in fields),
    ):
        with pytest.raises(DataError, match=said):
            read_questions(write_questions(tmp_path / "q", lines), scenes)


OTHERS = {
    "question": "Which color has the cube?",
    "options": ["red", "blue", "yellow", "green"],
    "answer": "C",
    "colors": {"1": "blue"},
    "pictures": [{"label": "scene", "view": [45, 22], "without": [2]}],
    "evidence": {"slots": {"block": "blue cube"}},
    "wording": "co-2",
}


def test_the_digest_of_a_set_follows_every_field(tmp_path, scenes):
    changed = [QUESTION, QUESTION, *({**QUESTION, name: OTHERS[name]} for name in OTHERS)]
    folders = (write_questions(tmp_path / "q", [one]) for one in changed)
    digests = [read_questions(folder, scenes).sha256 for folder in folders]
    assert digests[0] == digests[1]
    assert len(set(digests)) == 1 + len(OTHERS)


def test_complaints_of_one_line_are_bounded(tmp_path, scenes):
    question = QUESTION | {f"field{i}": [0] * 20 for i in range(5_000)}
    with pytest.raises(DataError) as caught:
        read_questions(write_questions(tmp_path / "q", [question]), scenes)
    assert len(caught.value.problems) == 100


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
