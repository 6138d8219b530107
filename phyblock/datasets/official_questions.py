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
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, cast

from phyblock.datasets.base import Dataset, QuestionSet, QuestionTask
from phyblock.datasets.builtin import scene_lines
from phyblock.datasets.questions import QuestionReader
from phyblock.datasets.raw import MISSING, gather, parse_json, read_text
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

__all__ = ["read_official_questions"]

_MOST_QUESTIONS = 100_000
_GOAL_VIEW = (45.0, 22.0)
_SUFFIXES = (".json", ".jsonl")
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
                task = _Reader(entry.where, folder, base).task(entry, path.stem, known)
            except DataError as error:
                gather(problems, error.problems, folder)
                continue
            if first.setdefault(task.key, entry.where) != entry.where:
                message = f"is used at {first[task.key]} already"
                gather(problems, [Problem(entry.where, message, "id", repr(task.key))], folder)
            tasks.append(task)
    if problems:
        raise DataError(problems)
    return QuestionSet(folder.name, folder, tuple(tasks))


def _entries(path: Path) -> Iterator[_Entry]:
    """The objects of a file with the line on which each begins."""
    if path.suffix == ".jsonl":
        for number, line in enumerate(scene_lines(path), 1):
            yield _Entry(f"{path}:{number}", parse_json(line, path, number), number)
        return
    text = read_text(path, "a file of questions")
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
        found = re.compile(r"[\s,]*").match(text, at)
        at = found.end() if found else at
        line += text.count("\n", counted, at)
        counted = at
        yield line
        _, at = decoder.raw_decode(text, at)


def _index_base(entries: list[Any]) -> int | None:
    """Where the indices of a file begin, or None where its answers do not tell."""
    found: set[int] = set()
    for raw in entries:
        answer = raw.get("answer") if isinstance(raw, dict) else None
        found.update(index for index in (answer if isinstance(answer, list) else [answer])
                     if type(index) is int)  # fmt: skip
    if 0 in found:
        return 0
    return 1 if len(LETTERS) in found else None


class _Reader(QuestionReader):
    """Reads one entry, and collects what is wrong with it."""

    def __init__(self, where: str, folder: Path, base: int | None) -> None:
        super().__init__(where)
        self._folder = folder
        self._base = base

    def task(self, entry: _Entry, stem: str, scenes: Mapping[str, Scene]) -> QuestionTask:
        """The question with its pictures; raises DataError with everything that is wrong."""
        raw = self.mapping(entry.raw)
        optional = {} if raw is MISSING else raw
        subtask = self._subtask(optional.get("subtask", stem))
        name = self.name(optional.get("id", f"{_code(stem)}-{entry.number:03d}"), "id")
        scene = self.scene(self._scene_id(self.get(raw, "scene_id")), scenes)
        text = self.text(self.get(raw, "question"), "question")
        options = self.options(self.get(raw, "options"))
        answer = self._answer(self.get(raw, "answer"), options, subtask == "OR")
        files = self._files(optional.get("images", {}), name, scene, options)
        self.raise_if_broken()
        assert scene is not None
        assert subtask is not None
        drawn = () if "scene" in files or subtask == "OR" else (_goal(scene),)
        question = Question(name, subtask, scene, text, options, answer, drawn)
        return QuestionTask(question, files)

    def _subtask(self, raw: object) -> Subtask | None:
        found = _NAMES.get(_NAME.sub("", raw.lower())) if isinstance(raw, str) else None
        if found is None:
            allowed = f"in the entry or as the file's name: {', '.join(SUBTASKS)}"
            self.complain("subtask", "is not known", raw, allowed)
        return found

    def _scene_id(self, raw: object) -> object:
        """Scene ids are texts of three digits in the official files; numbers are taken as such."""
        return f"{raw:03d}" if type(raw) is int else raw

    def _answer(self, raw: object, options: tuple[str, ...], is_order: bool) -> tuple[int, ...]:
        if raw is MISSING or not options:
            return ()
        parts = raw if isinstance(raw, list) else [raw]
        if is_order and isinstance(raw, str):
            parts = [letter for letter in raw.upper() if letter.isalnum()]
        found = [self._index(part, options) for part in parts]
        wanted = len(options) if is_order else 1
        if None in found or len(set(found)) < wanted or len(found) != wanted:
            allowed = "a permutation of the options" if is_order else "a letter, option or index"
            if self._base is None and any(type(part) is int for part in parts):
                allowed = "letters: the indices of this file do not tell whether they begin at 0"
            self.complain("answer", "is none of the options", raw, allowed)
            return ()
        return tuple(cast(list[int], found))

    def _index(self, raw: object, options: tuple[str, ...]) -> int | None:
        if type(raw) is int:
            index = None if self._base is None else raw - self._base
            return index if index is not None and 0 <= index < len(options) else None
        text = raw.strip() if isinstance(raw, str) else ""
        letter = text.strip("().").upper()
        if letter and letter in LETTERS[: len(options)]:
            return LETTERS.index(letter)
        return options.index(text) if text in options else None

    def _files(
        self, raw: object, name: str, scene: Scene | None, options: tuple[str, ...]
    ) -> dict[str, Path]:
        """The picture files by label; complains about those that are missing."""
        named = self.mapping(raw, "images")
        named = {} if named is MISSING else named
        files: dict[str, Path] = {}
        pictures = self._folder / "images"
        if scene is not None and (path := self._file(named, "scene", pictures / scene.id)):
            files["scene"] = path
        for letter, option in zip(LETTERS, options, strict=False):
            label = option.strip("<>")
            if not is_picture_option(option):
                continue
            path = self._file(named, label, pictures / name / label)
            if path is not None:
                files[letter] = path
            elif label not in named:
                shown = f"images/{name}/{label}.png"
                self.complain("images", f"the picture {option} is missing", shown, _ALLOWED)
        return files

    def _file(self, named: Mapping[str, Any], label: str, default: Path) -> Path | None:
        """The file that is named, or the one at its usual place."""
        if label in named:
            path = self._folder / str(named[label])
            inside = os.path.join(os.path.abspath(self._folder), "")
            if not os.path.abspath(path).startswith(inside) or not os.path.isfile(path):
                self.complain(
                    f"images.{label}", "no such file in the folder", str(named[label]), _ALLOWED
                )
                return None
            return path
        found = (default.with_name(default.name + suffix) for suffix in _PICTURES)
        return next((path for path in found if os.path.isfile(path)), None)


_ALLOWED = "a PNG or JPEG file inside the folder"


def _goal(scene: Scene) -> QuestionPicture:
    return QuestionPicture("scene", scene.blocks, _GOAL_VIEW)


def _code(stem: str) -> str:
    found = _NAMES.get(_NAME.sub("", stem.lower()))
    return found.lower() if found else re.sub(r"[^A-Za-z0-9._-]", "-", stem)
