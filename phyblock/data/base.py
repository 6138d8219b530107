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
    plain = lambda one: {each.name: getattr(one, each.name) for each in fields(one)}  # noqa: E731
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
        message = f"cannot be read: {reason_of(error)}"
    except UnicodeDecodeError as error:
        message = f"is not UTF-8 text: {error.reason}"
    except ValueError as error:
        message = str(error)
    raise DataError(Problem(str(path), message, allowed=allowed))


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
    field = found = allowed = ""
    try:
        if line is not None and len(text) > _LONGEST_LINE:
            found, allowed = f"{len(text):,} characters", f"{_LONGEST_LINE:,} at most"
            raise ValueError("is too long a line")
        value = load_json(text, finite=False, unique=True)
        if _SURROGATE.search(text):
            json.dumps(value, ensure_ascii=False).encode()
        return value
    except json.JSONDecodeError as error:
        where += f":{error.colno}" if line is not None else f":{error.lineno}:{error.colno}"
        message = f"is not valid JSON: {error.msg}"
    except RepeatedFieldError as error:
        message, field = "stands twice in one object", error.field
    except UnicodeEncodeError:
        message = "holds half of a character (a lone surrogate)"
    except ValueError as error:
        message = str(error)
    raise DataError(Problem(where, message, field, found, allowed))


def lines_of(text: str) -> list[str]:
    """Return the lines of a text of JSON lines."""
    # Not splitlines(): a JSON string may hold U+2028 and other line ends of Unicode.
    return text.removesuffix("\n").split("\n") if text else []


def read_each(
    entries: Iterable[tuple[str, Callable[[], _T]]], name: Callable[[_T], str]
) -> list[_T]:
    """Return what is read at each place; DataError with all that cannot, and names used twice.

    Reading stops after a thousand faults.
    """
    first_use: dict[str, str] = {}
    values: list[_T] = []
    problems: list[Problem] = []
    for where, read in entries:
        if len(problems) > _MOST_OF_ALL:
            message = f"more than {_MOST_OF_ALL:,} faults; only the first were looked for"
            raise DataError([Problem(where, message), *problems])
        try:
            one = read()
        except DataError as error:
            problems += error.problems
            continue
        first = first_use.setdefault(name(one), where)
        if first != where:
            problems.append(Problem(where, f"is used at {first} already", "id", repr(name(one))))
        values.append(one)
    if problems:
        raise DataError(problems)
    return values


def read_lines(
    path: Path, text: str, noun: str, read: Callable[[Any, str], _T], name: Callable[[_T], str]
) -> list[_T]:
    """Return what `read` makes of the JSON value of every line of a file's `text` and its place.

    Raises DataError with everything that is wrong: what `read` raises, a name that stands twice, a
    file of no `noun`.
    """
    if not text:
        raise DataError(Problem(str(path), f"holds no {noun}s", allowed=f"one {noun} a line"))

    def entry(number: int, line: str) -> tuple[str, Callable[[], _T]]:
        where = f"{path}:{number}"
        return where, lambda: read(parse_json(line, path, number), where)

    return read_each((entry(number, line) for number, line in enumerate(lines_of(text), 1)), name)
