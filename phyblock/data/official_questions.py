"""Reader of question files in the official JSON form (paper appendix A.4), from a local folder.

    SH.json, CO.json, ...       questions: one file a subtask, a JSON array of objects (or JSON
                                Lines, .jsonl); the name is the subtask's code or its name
    images/<scene_id>.png       the picture of a scene; without it the scene is drawn
    images/<id>/img1.png ...    the pictures <img1> to <img4> of a question (.png or .jpg)

An object holds `scene_id`, `question`, `options` (four texts, or `<img1>` to `<img4>`) and
`answer`, and may hold `id` (else the file's name and the number in the file), `subtask` (which then
counts, not the file's name) and `images`: paths by `scene`, `img1` to `img4`, from the folder.

`answer` is a letter, the text of an option, or an index; for ordering four letters or four
indices. Indices count from 0 in a file in which some answer is 0, from 1 where some answer is 4;
where neither tells, they are refused.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple, cast

from pydantic import AfterValidator, BeforeValidator, Field, PlainValidator, ValidationInfo

from phyblock.data.base import Dataset, QuestionSet, QuestionTask
from phyblock.data.raw import gather, lines_of, parse_json, read_text, used_already
from phyblock.domain import (
    LETTERS,
    SUBTASK_NAMES,
    SUBTASKS,
    Question,
    QuestionPicture,
    Scene,
    Subtask,
    is_picture_option,
)
from phyblock.errors import DataError, Problem
from phyblock.records.data_values import Name, Text
from phyblock.records.decode import shown
from phyblock.records.faults import Fault, fault, validated
from phyblock.records.line import Line
from phyblock.records.picture import About
from phyblock.records.question import Options, SceneId

__all__ = ["read_official_questions"]

_MOST_QUESTIONS = 100_000
_GOAL_VIEW = (45.0, 22.0)
_SUFFIXES = (".json", ".jsonl")
_QUESTIONS = "a file of questions"
_ALLOWED = "a PNG or JPEG file inside the folder"
_PICTURES = (".png", ".jpg", ".jpeg")
_NAME = re.compile(r"[^a-z]+")
_NAMES: Mapping[str, Subtask] = {
    **{code.lower(): code for code in SUBTASKS},
    **{_NAME.sub("", name): code for code, name in SUBTASK_NAMES.items()},
    **{"colour": "CO", "prediction": "PD", "predict": "PD", "dependency": "RD"},
}


class _Entry(NamedTuple):
    where: str
    raw: Any
    number: int


def read_official_questions(folder: Path, scenes: Dataset) -> QuestionSet:
    """All questions of a folder, about these scenes; DataError with everything that is wrong."""
    files = sorted(path for path in folder.glob("*") if path.suffix in _SUFFIXES)
    if not files:
        allowed = "question files such as SH.json, one a subtask"
        raise DataError(Problem(str(folder), "holds no question files", allowed=allowed))
    known = {task.scene.id: task.scene for task in scenes.tasks}
    tasks: list[QuestionTask] = []
    problems: list[Problem] = []
    first: dict[str, str] = {}
    for path in files:
        try:
            entries = list(_entries(path))
        except DataError as error:
            gather(problems, error.problems, folder)
            continue
        base = _index_base([entry.raw for entry in entries])
        for entry in entries:
            try:
                task = _read_task(entry, path, known, base)
            except DataError as error:
                gather(problems, error.problems, folder)
                continue
            if first.setdefault(task.key, entry.where) != entry.where:
                gather(
                    problems, [used_already(entry.where, f"at {first[task.key]}", task.key)], folder
                )
            tasks.append(task)
    if problems:
        raise DataError(problems)
    return QuestionSet(folder.name, folder, tuple(tasks))


def _read_task(
    entry: _Entry, path: Path, scenes: Mapping[str, Scene], base: int | None
) -> QuestionTask:
    raw = _completed(entry.raw, path.stem, entry.number)
    scene = About.named_in(raw, scenes).scene
    around = _Around(scene, len(scenes), path.parent, base)
    line = validated(_StoredEntry, raw, entry.where, around)
    return line.task(scenes[line.scene_id])


def _entries(path: Path) -> Iterator[_Entry]:
    """The objects of a file with the line on which each begins."""
    if path.suffix == ".jsonl":
        for number, line in enumerate(lines_of(path, _QUESTIONS), 1):
            yield _Entry(f"{path}:{number}", parse_json(line, path, number), number)
        return
    text = read_text(path, _QUESTIONS)
    whole = parse_json(text, path)
    if not isinstance(whole, list):
        raise DataError(Problem(str(path), "is not an array", allowed="an array of questions"))
    if len(whole) > _MOST_QUESTIONS:
        allowed = f"{_MOST_QUESTIONS:,} questions at most"
        raise DataError(Problem(str(path), "is too long an array", "", f"{len(whole):,}", allowed))
    starts = _starts(text)
    for number, raw in enumerate(whole, 1):
        yield _Entry(f"{path}:{next(starts)}", raw, number)


def _starts(text: str) -> Iterator[int]:
    """The line on which each entry of the array that `text` holds begins."""
    decoder, at = json.JSONDecoder(), text.index("[") + 1
    line, counted = 1, 0
    while True:
        gap = re.compile(r"[\s,]*").match(text, at)
        at = gap.end() if gap else at
        line += text.count("\n", counted, at)
        counted = at
        yield line
        _, at = decoder.raw_decode(text, at)


def _index_base(entries: list[Any]) -> int | None:
    """Where the indices of a file begin, or None where its answers do not tell."""
    indices: set[int] = set()
    for raw in entries:
        answer = raw.get("answer") if isinstance(raw, dict) else None
        indices.update(index for index in (answer if isinstance(answer, list) else [answer])
                     if type(index) is int)  # fmt: skip
    if 0 in indices:
        return 0
    return 1 if len(LETTERS) in indices else None


@dataclass(frozen=True)
class _Around(About):
    """What an entry is held against: its scene, its folder, and where indices of its file begin."""

    folder: Path
    base: int | None


def _subtask_of(named: object) -> Subtask:
    subtask = _NAMES.get(_NAME.sub("", named.lower())) if isinstance(named, str) else None
    if subtask is None:
        allowed = f"in the entry or as the file's name: {', '.join(SUBTASKS)}"
        raise fault(Fault("is not known", allowed))
    return subtask


def _around(info: ValidationInfo) -> _Around:
    return cast(_Around, info.context)


def _indices(answer: object, info: ValidationInfo) -> tuple[int, ...]:
    """The indices from 0 of the right options."""
    options: tuple[str, ...] = info.data.get("options", ())
    if not options:
        return ()
    base, is_order = _around(info).base, info.data.get("subtask") == "OR"
    parts: Sequence[object] = answer if isinstance(answer, list) else [answer]
    if is_order and isinstance(answer, str):
        parts = [letter for letter in answer.upper() if letter.isalnum()]
    indices = [_index(part, options, base) for part in parts]
    wanted = len(options) if is_order else 1
    if None in indices or len(set(indices)) < wanted or len(indices) != wanted:
        allowed = "a permutation of the options" if is_order else "a letter, option or index"
        if base is None and any(type(part) is int for part in parts):
            allowed = "letters: the indices of this file do not tell whether they begin at 0"
        raise fault(Fault("is none of the options", allowed))
    return tuple(cast(list[int], indices))


def _index(part: object, options: tuple[str, ...], base: int | None) -> int | None:
    if type(part) is int:
        index = None if base is None else part - base
        return index if index is not None and 0 <= index < len(options) else None
    text = part.strip() if isinstance(part, str) else ""
    letter = text.strip("().").upper()
    if letter and letter in LETTERS[: len(options)]:
        return LETTERS.index(letter)
    return options.index(text) if text in options else None


def _files(named: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
    """The picture files by label; that of the scene may be missing, those of options may not."""
    scene, folder, name = _around(info).scene, _around(info).folder, info.data.get("id", "")
    wanted = [] if scene is None else [("scene", "scene", scene.id)]
    for letter, option in zip(LETTERS, info.data.get("options", ()), strict=False):
        if is_picture_option(option):
            wanted.append((letter, option.strip("<>"), f"{name}/{option.strip('<>')}"))
    files: dict[str, Path] = {}
    faults: list[Fault] = []
    for label, key, usual in wanted:
        path = _named(folder, named[key]) if key in named else _usual(folder / "images" / usual)
        if path is not None:
            files[label] = path
        elif key in named:
            found = shown(str(named[key]))
            faults.append(Fault("no such file in the folder", _ALLOWED, found, (key,)))
        elif label != "scene":
            found = shown(f"images/{usual}.png")
            faults.append(Fault(f"the picture <{key}> is missing", _ALLOWED, found))
    if faults:
        raise fault(*faults)
    return files


def _named(folder: Path, name: object) -> Path | None:
    path = folder / str(name)
    inside = os.path.join(os.path.abspath(folder), "")
    is_inside = os.path.abspath(path).startswith(inside)
    return path if is_inside and os.path.isfile(path) else None


def _usual(place: Path) -> Path | None:
    paths = (place.with_name(place.name + suffix) for suffix in _PICTURES)
    return next((path for path in paths if os.path.isfile(path)), None)


class _StoredEntry(Line, extra="ignore"):
    id: Name
    subtask: Annotated[Subtask, BeforeValidator(_subtask_of)]
    scene_id: SceneId
    question: Text
    options: Options
    answer: Annotated[tuple[int, ...], PlainValidator(_indices)]
    images: Annotated[dict[str, Any], AfterValidator(_files)] = Field({}, validate_default=True)

    def task(self, scene: Scene) -> QuestionTask:
        is_drawn = "scene" not in self.images and self.subtask != "OR"
        drawn = (QuestionPicture("scene", scene.blocks, _GOAL_VIEW),) if is_drawn else ()
        question = Question(
            self.id, self.subtask, scene, self.question, self.options, self.answer, drawn
        )
        return QuestionTask(question, self.images)


def _completed(raw: Any, stem: str, number: int) -> Any:
    """An entry with what the file's name says where it does not."""
    if not isinstance(raw, dict):
        return raw
    whole = {"id": f"{_code(stem)}-{number:03d}", "subtask": stem, **raw}
    if type(raw.get("scene_id")) is int:
        # Scene ids are texts of three digits in the official files.
        whole["scene_id"] = f"{raw['scene_id']:03d}"
    return whole


def _code(stem: str) -> str:
    subtask = _NAMES.get(_NAME.sub("", stem.lower()))
    return subtask.lower() if subtask else re.sub(r"[^A-Za-z0-9._-]", "-", stem)
