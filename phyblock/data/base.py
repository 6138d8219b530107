"""Data sets as every reader returns them, and their files read without trust.

What is wrong in a file is raised as DataError with its place, and all of it at once. No file may
hang the program or exhaust its memory.
"""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, TypeVar

from phyblock.domain import CandidateSet, Question, Scene
from phyblock.errors import DataError, Problem, reason_of
from phyblock.files import LARGEST_PICTURE_BYTES, RepeatedFieldError, load_json, read_bytes
from phyblock.stable import hex_digest

VERSION_FILE = "VERSION"
UNNUMBERED = 1
"""Version of a set without such a file: ours had none in their first version."""
_MOST_DIGITS = 6
_LARGEST_BYTES = 1024**3
_LONGEST_LINE = 2**20
_MOST_OF_ALL = 1000
"""Faults of a data set that are reported."""
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")
_T = TypeVar("_T")


@dataclass(frozen=True)
class AssemblyTask:
    """A goal structure with its candidate set; `composite` is the data set's own picture of
    both, where it has one.
    """

    scene: Scene
    candidates: CandidateSet
    composite: Path | None = None

    @property
    def key(self) -> str:
        """The scene's id, by which samples name the task."""
        return self.scene.id


@dataclass(frozen=True)
class Dataset:
    """Assembly tasks in scene-id order; `root` is where they were read from."""

    name: str
    root: Path
    tasks: tuple[AssemblyTask, ...]

    @functools.cached_property
    def sha256(self) -> str:
        """Hex digest of the scenes and candidate sets, whatever the format they came in."""
        return _digest([[task.scene, task.candidates] for task in self.tasks])


@dataclass(frozen=True)
class QuestionTask:
    """A question; `files` are pictures by label that the data set brings, instead of recipes."""

    question: Question
    files: Mapping[str, Path] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """The id of the question."""
        return self.question.id

    @property
    def scene(self) -> Scene:
        """The scene as the question shows it."""
        return self.question.scene


@dataclass(frozen=True)
class QuestionSet:
    """Questions in the order of the file; `root` is the folder they were read from."""

    name: str
    root: Path
    tasks: tuple[QuestionTask, ...]

    @functools.cached_property
    def sha256(self) -> str:
        """Hex digest of the questions with their scenes and of the picture files' bytes."""
        return _digest([[task.question, _digests(task.files)] for task in self.tasks])


def _digests(files: Mapping[str, Path]) -> dict[str, str]:
    digests: dict[str, str] = {}
    for label, path in sorted(files.items()):
        try:
            digests[label] = hex_digest(read_bytes(path, LARGEST_PICTURE_BYTES))
        except (OSError, ValueError) as error:
            raise DataError(Problem(str(path), f"cannot be read: {reason_of(error)}")) from error
    return digests


def _digest(content: object) -> str:
    # `asdict` would copy all that is in a dataclass as well.
    def plain(one: Any) -> dict[str, object]:
        return {each.name: getattr(one, each.name) for each in fields(one)}

    return hex_digest(json.dumps(content, sort_keys=True, default=plain))


def read_version(folder: Path) -> int:
    """Return the version of the data set in a folder; DataError where its file holds none."""
    path = folder / VERSION_FILE
    if not path.exists():
        return UNNUMBERED
    text = read_text(path).strip()
    if not (text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS and int(text)):
        allowed = "a whole number from 1"
        raise DataError(Problem(str(path), "holds no version", "", repr(text[:20]), allowed))
    return int(text)


def read_text(path: Path, allowed: str = "") -> str:
    """Return the text of a file; DataError when it cannot be read, is too large or not UTF-8."""
    try:
        return read_bytes(path, _LARGEST_BYTES).decode("utf-8")
    except OSError as error:
        problem = Problem(str(path), f"cannot be read: {reason_of(error)}", allowed=allowed)
        raise DataError(problem) from error
    except UnicodeDecodeError as error:
        raise DataError(Problem(str(path), f"is not UTF-8 text: {error.reason}")) from error
    except ValueError as error:
        raise DataError(Problem(str(path), str(error), allowed=allowed)) from error


def read_json(path: Path) -> Any:
    """Return the JSON value in a file; DataError, with line and column, when there is none."""
    return parse_json(read_text(path), path)


def parse_json(text: str, path: Path, line: int | None = None) -> Any:
    """Return the JSON value in `text`: all of the file, or its line number `line`.

    Raises DataError for bad syntax, an object that holds a field twice, a number of hundreds of
    digits, nesting that is too deep, half of a character, or a line of more than a million
    characters. Numbers that are not finite pass: the field they stand in is checked.
    """
    where = str(path) if line is None else f"{path}:{line}"
    if line is not None and len(text) > _LONGEST_LINE:
        found = f"{len(text):,} characters"
        problem = Problem(where, "is too long a line", "", found, f"{_LONGEST_LINE:,} at most")
        raise DataError(problem)
    try:
        value = load_json(text, finite=False, unique=True)
        if _SURROGATE.search(text):
            json.dumps(value, ensure_ascii=False).encode()
    except json.JSONDecodeError as error:
        where += f":{error.colno}" if line is not None else f":{error.lineno}:{error.colno}"
        raise DataError(Problem(where, f"is not valid JSON: {error.msg}")) from error
    except RepeatedFieldError as error:
        raise DataError(Problem(where, "stands twice in one object", error.field)) from error
    except UnicodeEncodeError as error:
        message = "holds half of a character (a lone surrogate)"
        raise DataError(Problem(where, message)) from error
    except ValueError as error:
        raise DataError(Problem(where, str(error))) from error
    return value


def lines_of(text: str) -> list[str]:
    """Return the lines of a text of JSON lines."""
    # Not splitlines(): a JSON string may hold U+2028 and other line ends of Unicode.
    return text.removesuffix("\n").split("\n") if text else []


def read_lines(
    path: Path, text: str, noun: str, read: Callable[[Any, str], _T], name: Callable[[_T], str]
) -> list[_T]:
    """Return every line of a file's `text` as `read` makes it of its JSON value and its place.

    Raises DataError with everything that is wrong: what `read` raises, a name that stands twice, a
    file of no `noun`.
    """
    lines = lines_of(text)
    first_line: dict[str, int] = {}
    values: list[_T] = []
    problems: list[Problem] = []
    for number, line in enumerate(lines, 1):
        where = f"{path}:{number}"
        try:
            one = read(parse_json(line, path, number), where)
        except DataError as error:
            gather(problems, error.problems, path)
            continue
        first = first_line.setdefault(name(one), number)
        if first != number:
            gather(problems, [used_already(where, f"by line {first}", name(one))], path)
        values.append(one)
    if not lines:
        problems.append(Problem(str(path), f"holds no {noun}s", allowed=f"one {noun} a line"))
    if problems:
        raise DataError(problems)
    return values


def used_already(where: str, first: str, name: str) -> Problem:
    """Return the problem of an id whose `first` use was before: by a line, or at a place."""
    return Problem(where, f"is used {first} already", "id", repr(name))


def gather(problems: list[Problem], more: Iterable[Problem], where: object) -> None:
    """Add problems to those of a whole data set; DataError when they become too many to go on."""
    problems += more
    if len(problems) > _MOST_OF_ALL:
        note = f"has more than {_MOST_OF_ALL:,} faults; only the first were looked for"
        raise DataError([Problem(str(where), note), *problems])
