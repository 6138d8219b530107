"""Lines of data: the shipped ones are written again as they are, and schemas say the same."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from phyblock.data.questions import StoredQuestion
from phyblock.data.scenes import StoredScene
from phyblock.errors import DataError
from phyblock.records.record import Line, validated
from tests.data.broken import Raw, sound_scene, with_value
from tests.documents import ROOT
from tests.fuzz.strategies import sound_question
from tests.shipped import DATA, TASKS, built_in_questions

SCENES = Path("phyblock-400", "scenes.jsonl")
QUESTIONS = Path("phyblock-vqa", "questions.jsonl")


def lines_of(path: Path) -> list[str]:
    return (DATA / path).read_text(encoding="utf-8").splitlines()


def test_shipped_scenes_and_questions_are_written_byte_for_byte() -> None:
    written = [StoredScene.of(task.scene, task.candidates).as_json() for task in TASKS]
    assert written == lines_of(SCENES)
    originals = {task.key: task.scene for task in TASKS}
    asked = (task.question for task in built_in_questions().tasks)
    written = [StoredQuestion.of(one, originals[one.scene.id]).as_json() for one in asked]
    assert written == lines_of(QUESTIONS)


@pytest.mark.parametrize(
    ("kind", "raw"), [(StoredScene, sound_scene()), (StoredQuestion, sound_question())]
)
def test_a_line_may_say_its_version_and_none_is_from_the_future(kind: type[Line], raw: Raw) -> None:
    for line in (raw, {**raw, "format": 1}):
        assert json.loads(validated(kind, line, "here").as_json()) == line
    with pytest.raises(DataError) as caught:
        validated(kind, {**raw, "format": 2}, "here")
    (problem,) = caught.value.problems
    assert (problem.field, problem.found, problem.allowed) == ("format", "2", "1")


def schema(name: str) -> jsonschema.Draft202012Validator:
    text = (ROOT / "benchmarks" / "schemas" / f"{name}.schema.json").read_text(encoding="utf-8")
    jsonschema.Draft202012Validator.check_schema(json.loads(text))
    return jsonschema.Draft202012Validator(json.loads(text))


@pytest.mark.parametrize(("name", "path"), [("scene", SCENES), ("question", QUESTIONS)])
def test_the_schemas_take_what_is_shipped(name: str, path: Path) -> None:
    found = schema(name)
    for line in lines_of(path)[::25]:
        found.validate(json.loads(line))


BROKEN: dict[str, tuple[str, Raw, str, Any]] = {
    "shape": ("scene", sound_scene(), "blocks.0.type", "ball"),
    "order": ("scene", sound_scene(), "blocks.0.order", 0),
    "position": ("scene", sound_scene(), "blocks.0.position", [0, 0]),
    "levels": ("scene", sound_scene(), "levels", [1, 3]),
    "no candidates": ("scene", sound_scene(), "candidates", []),
    "name": ("scene", sound_scene(), "id", "../x"),
    "view": ("question", sound_question(), "pictures.0.view", [45, 0]),
    "label": ("question", sound_question(), "pictures.0.label", "E"),
    "framed": ("question", sound_question(), "pictures.0.framed", False),
    "color": ("question", sound_question(), "colors.1", "pink"),
    "field": ("question", sound_question(), "pictures.0.widthout", [1]),
}


@pytest.mark.parametrize(("name", "raw", "at", "value"), BROKEN.values(), ids=BROKEN)
def test_the_schemas_refuse_what_the_models_refuse(
    name: str, raw: Raw, at: str, value: object
) -> None:
    broken = with_value(raw, at, value)
    assert schema(name).is_valid(raw)
    assert not schema(name).is_valid(broken)
    with pytest.raises(DataError):
        validated(StoredScene if name == "scene" else StoredQuestion, broken, "here")
