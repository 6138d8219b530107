"""Data sets, and functions that read untrusted files.

All problems of a file are raised at once, as one DataError with their places. No file may hang the
program or exhaust its memory.
"""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import TypeVar

from phyblock.config.validation import Fault
from phyblock.config.yaml import dotted
from phyblock.domain.question import Question
from phyblock.domain.scene import AssemblyTask, Scene
from phyblock.errors import DataError, Problem, reason_of
from phyblock.files import LARGEST_PICTURE_BYTES, read_bytes
from phyblock.text import did_you_mean, hex_digest, some_of

VERSION_FILE = "VERSION"
UNNUMBERED = 1
"""Version of a set without a version file: the first bundled sets had none."""
_LARGEST_BYTES = 1024**3
_MOST_OF_ALL = 1000
"""Maximum number of reported faults of a data set."""
_T = TypeVar("_T")


@dataclass(frozen=True)
class Dataset:
    """Assembly tasks in scene-id order; `root` is the folder that they were read from."""

    name: str
    root: Path
    tasks: tuple[AssemblyTask, ...]

    @functools.cached_property
    def sha256(self) -> str:
        """Hex digest of the scenes and candidate sets, independent of their format."""
        return _digest([[task.scene, task.candidates] for task in self.tasks])

    @functools.cached_property
    def _by_scene(self) -> dict[str, AssemblyTask]:
        return {task.key: task for task in self.tasks}

    def task(self, scene: str) -> AssemblyTask:
        """Return the task of a scene. Raises DataError if there is none."""
        if scene in self._by_scene:
            return self._by_scene[scene]
        allowed, hint = some_of(list(self._by_scene)), did_you_mean(scene, self._by_scene)
        message = "holds no such scene"
        raise DataError(Problem(str(self.root), message, "scene", scene, allowed, hint))


@dataclass(frozen=True)
class QuestionTask:
    """A question; `files` are pictures of the data set by label, used instead of recipes."""

    question: Question
    files: Mapping[str, Path] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """The id of the question."""
        return self.question.id

    @property
    def scene(self) -> Scene:
        """The scene as shown in the question."""
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
    # `asdict` would also copy everything inside.
    plain = lambda one: {each.name: getattr(one, each.name) for each in fields(one)}  # noqa: E731
    return hex_digest(json.dumps(content, sort_keys=True, default=plain))


def read_version(folder: Path) -> int:
    """Return the version of the data set in a folder. Raises DataError for a bad version file."""
    path = folder / VERSION_FILE
    if not path.exists():
        return UNNUMBERED
    found = read_data(path).strip()
    if not re.fullmatch(rb"[1-9][0-9]{0,5}", found):
        allowed = "a whole number from 1"
        raise DataError(Problem(str(path), "holds no version", "", repr(found[:20]), allowed))
    return int(found)


def read_data(path: Path, allowed: str = "") -> bytes:
    """Return the bytes of a file. Raises DataError if it cannot be read or is too large."""
    try:
        return read_bytes(path, _LARGEST_BYTES)
    except (OSError, ValueError) as error:
        message = f"cannot be read: {reason_of(error)}"
        raise DataError(Problem(str(path), message, allowed=allowed)) from error


def read_set(path: Path) -> bytes:
    """Return the bytes of a data set's file of lines; raises as `read_data`."""
    return read_data(path, f"a folder with {path.name}, or the name of a bundled set")


def report(faults: Iterable[Fault], where: str) -> None:
    """Raise DataError with these faults of the value at a place, if there are any."""
    if problems := [
        Problem(where, f.message, dotted(f.at), f.found or "", f.allowed) for f in faults
    ]:
        raise DataError(problems[:100])


def read_each(
    entries: Iterable[tuple[str, Callable[[], _T]]], name: Callable[[_T], str]
) -> list[_T]:
    """Return the values read at each place. Raises DataError with all faults and duplicate names.

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
    path: Path,
    content: bytes,
    noun: str,
    read: Callable[[bytes, str], _T],
    name: Callable[[_T], str],
) -> list[_T]:
    """Return the result of `read` for every line of a file's content and its place.

    Raises DataError with all problems: errors of `read`, duplicate names, a file without any
    `noun`.
    """
    data = content.removesuffix(b"\n")
    if b"\0" in data or not data:
        raise DataError(Problem(str(path), f"holds no {noun}s", allowed=f"one {noun} a line"))
    places = ((f"{path}:{n}", line) for n, line in enumerate(data.split(b"\n"), 1))
    return read_each(((where, partial(read, line, where)) for where, line in places), name)
