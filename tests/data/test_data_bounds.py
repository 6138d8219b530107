"""Data lines within bounds: whatever a file holds, it is read or refused, and soon."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings

from phyblock.data import read_builtin, read_official, read_official_questions, read_questions
from phyblock.data.official import read_candidates
from phyblock.domain import MAX_CANDIDATES
from phyblock.errors import DataError, Problem
from tests.data.broken import sound_scene, with_value, write_checkout
from tests.fuzz.strategies import CANDIDATES, QUESTIONS, SCENES, sound_question
from tests.workspace import tower

SCENE = tower("t1", [1, 2], ("red", "blue"))


def write(folder: Path, text: str | bytes, name: str = "scenes.jsonl") -> Path:
    folder.mkdir(exist_ok=True, parents=True)
    data = text if isinstance(text, bytes) else text.encode()
    (folder / name).write_bytes(data)
    return folder


def problems_of(read: Callable[..., object], *args: object) -> list[Problem]:
    with pytest.raises(DataError) as caught:
        read(*args)
    return list(caught.value.problems)


FAR = {
    "down": ("blocks.0.position", [0, 0, -1e308], "blocks[0].position"),
    "far": ("blocks.0.position", [101, 0, 0], "blocks[0].position"),
    "turned": ("blocks.1.euler", [0, 0, 1e9], "blocks[1].euler"),
    "candidate": ("candidates.3.euler", [-1e308, 0, 0], "candidates[3].euler"),
    "order": ("blocks.0.order", 10_000, "blocks[0].order"),
    "layer": ("blocks.0.layer", 10**18, "blocks[0].layer"),
    "depend": ("blocks.1.depend", [10**18], "blocks[1].depend[0]"),
}


@pytest.mark.parametrize(("at", "value", "field"), FAR.values(), ids=FAR)
def test_numbers_beyond_all_use_are_out_of_range(
    tmp_path: Path, at: str, value: object, field: str
) -> None:
    (problem,) = problems_of(
        read_builtin, write(tmp_path, json.dumps(with_value(SCENE, at, value)))
    )
    assert problem.field == field
    assert problem.allowed


MANY = {
    "blocks": ("blocks", [SCENE["blocks"][0]] * 2_000),
    "candidates": ("candidates", [1] * 20_000),
    "levels": ("levels", [1] * 20_000),
    "parents": ("parents", ["x/"] * 20_000),
    "depend": ("blocks.0.depend", [1] * 20_000),
}


@pytest.mark.parametrize(("at", "value"), MANY.values(), ids=MANY)
def test_a_list_without_end_is_refused_in_few_words(tmp_path: Path, at: str, value: object) -> None:
    folder = write(tmp_path, json.dumps(with_value(SCENE, at, value)))
    found = problems_of(read_builtin, folder)
    assert len(found) <= 100
    assert all(problem.allowed for problem in found)
    assert {problem.field.partition("[")[0] for problem in found} == {at.partition(".")[0]}


LINES = {
    "long": (b"[" * 3_000_000, "too long a line"),
    "deep": (b"[" * 200_000, "nested more than 64"),
    "deep but whole": (b"[" * 80 + b"]" * 80, "nested more than 64"),
    "digits": (b'{"id": ' + b"9" * 900_000 + b"}", "of 900,000 digits"),
    "twice": (b'{"id": 1, "id": 2}', "twice"),
    "half a character": (b'{"id": "\\ud800"}', "half of a character"),
    "no number": (b'{"id": 0x1f}', "not valid JSON"),
}


@pytest.mark.parametrize(("line", "said"), LINES.values(), ids=LINES)
def test_a_bad_line_is_one_problem(tmp_path: Path, line: bytes, said: str) -> None:
    (problem,) = problems_of(read_builtin, write(tmp_path, line))
    assert said in problem.message
    assert problem.where.startswith(f"{tmp_path}/scenes.jsonl:1")


def test_a_whole_character_in_two_escapes_is_fine(tmp_path: Path) -> None:
    question = json.dumps({**sound_question(), "question": "How many \U0001f9f1?"})
    assert "\\ud83e" in question
    scenes = read_builtin(write(tmp_path, json.dumps(SCENE)))
    write(tmp_path, question, "questions.jsonl")
    assert read_questions(tmp_path, scenes).tasks[0].question.text == "How many \U0001f9f1?"


def test_reading_stops_where_all_is_garbage(tmp_path: Path) -> None:
    write(tmp_path, "x\n" * 200_000)
    write(tmp_path, "x\n" * 200_000, "questions.jsonl")
    scenes = read_builtin(write(tmp_path / "sound", json.dumps(SCENE)))
    assert len(problems_of(read_builtin, tmp_path)) == 1_002
    first, *_ = problems_of(read_questions, tmp_path, scenes)
    assert "more than 1,000 faults" in first.message


def test_the_complaints_of_one_line_are_bounded(tmp_path: Path) -> None:
    scenes = read_builtin(write(tmp_path, json.dumps(SCENE)))
    question = sound_question()
    question["pictures"][0]["without"] = [9] * 20
    question["evidence"] = {str(i): i for i in range(9_000)}
    question.update({f"field{i}": [0] * 20 for i in range(5_000)})
    write(tmp_path, json.dumps(question), "questions.jsonl")
    assert len(problems_of(read_questions, tmp_path, scenes)) == 100


RECIPES: dict[str, tuple[str, Any]] = {
    "mark": ("marks.0.position", [0, 0, 1e9]),
    "pose": ("poses.1.position", [1e300, 0, 0]),
    "view": ("view", [1e300, 45]),
    "added": ("add", [SCENE["blocks"][0]] * 1_000),
    "marks": ("marks", [{"letter": "A", "position": [0, 0, 0]}] * 1_000),
    "framed": ("framed", [SCENE["blocks"][0]] * 1_000),
}


@pytest.mark.parametrize(("at", "value"), RECIPES.values(), ids=RECIPES)
def test_recipes_within_bounds(tmp_path: Path, at: str, value: object) -> None:
    scenes = read_builtin(write(tmp_path, json.dumps(SCENE)))
    question = with_value(sound_question(), f"pictures.0.{at}", value)
    write(tmp_path, json.dumps(question), "questions.jsonl")
    (problem,) = problems_of(read_questions, tmp_path, scenes)
    assert problem.field.startswith("pictures[0].")
    assert problem.allowed


def test_official_names_and_pictures(tmp_path: Path) -> None:
    root = write_checkout(tmp_path / "a", {**sound_scene(), "id": "000"})
    goals = root / "data" / "SCENEs_400_Goal_Jsons"
    odd = os.fsdecode(b"\xff")
    (goals / "000.json").rename(goals / f"{odd}.json")
    sets = root / "data" / "SCENEs_400_Cand_Jsons"
    (sets / "000_16_cand_blocks.json").rename(sets / f"{odd}_16_cand_blocks.json")
    (problem,) = problems_of(read_official, root)
    assert "not a name" in problem.message
    assert str(problem).isprintable() or "\n" in str(problem)


def test_a_file_of_official_questions_takes_linear_time(tmp_path: Path) -> None:
    scenes = read_builtin(write(tmp_path / "scenes", json.dumps(SCENE)))
    folder = write(tmp_path / "asked", "[" + "\n1," * 50_000 + "1]", "SH.json")
    first, second, *_ = problems_of(read_official_questions, folder, scenes)
    assert "more than 1,000 faults" in first.message
    assert second.where == f"{folder}/SH.json[0]"
    write(folder, "[" + "\n1," * 100_000 + "1]", "SH.json")
    (problem,) = problems_of(read_official_questions, folder, scenes)
    assert "too long an array" in problem.message


@pytest.mark.parametrize("named", ["x" * 5_000, "a\0b", "../own.png", "/etc/hostname"])
def test_official_pictures_that_cannot_be_named(tmp_path: Path, named: str) -> None:
    (tmp_path / "own.png").write_bytes(b"mine")
    scenes = read_builtin(write(tmp_path / "scenes", json.dumps(SCENE)))
    entry = {
        "scene_id": "t1",
        "question": "How many?",
        "options": ["1", "2", "3", "4"],
        "answer": "A",
        "images": {"scene": named},
    }
    folder = write(tmp_path / "asked", json.dumps([entry]), "CO.json")
    (problem,) = problems_of(read_official_questions, folder, scenes)
    assert problem.message == "no such file in the folder"


def test_what_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "scenes.jsonl")
    (problem,) = problems_of(read_builtin, tmp_path)
    assert problem.message == "is not a regular file"


@settings(deadline=None, max_examples=40)
@given(SCENES)
def test_any_scene_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, line: bytes
) -> None:
    folder = write(tmp_path_factory.getbasetemp() / "law-scenes", line)
    with contextlib.suppress(DataError):
        for task in read_builtin(folder).tasks:
            assert max(map(abs, (x for b in task.scene.blocks for x in b.position_m))) <= 100


@settings(deadline=None, max_examples=40)
@given(CANDIDATES)
def test_any_candidate_set_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    folder = write(tmp_path_factory.getbasetemp() / "law-candidates", data, "c.json")
    with contextlib.suppress(DataError):
        assert 1 <= len(read_candidates(folder / "c.json")) <= MAX_CANDIDATES


@settings(deadline=None, max_examples=40)
@given(QUESTIONS)
def test_any_question_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, line: bytes
) -> None:
    folder = write(tmp_path_factory.getbasetemp() / "law-questions", json.dumps(SCENE))
    scenes = read_builtin(folder)
    write(folder, line, "questions.jsonl")
    with contextlib.suppress(DataError):
        questions = read_questions(folder, scenes)
        assert len(questions.sha256) == 64
        assert all(task.question.text.encode() for task in questions.tasks)
