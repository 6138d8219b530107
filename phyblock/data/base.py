"""Data sets, and functions that read untrusted files.

All problems of a file are one DataError with their places. No file hangs or exhausts memory.
"""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import TypeVar

from phyblock.config.validation import Fault
from phyblock.config.yaml import dotted, shown
from phyblock.domain.question import Question
from phyblock.domain.scene import AssemblyTask, Scene
from phyblock.errors import DataError, Problem, reason_of
from phyblock.files import read_bytes
from phyblock.text import did_you_mean, hex_digest, some_of

VERSION_FILE = "VERSION"
UNNUMBERED = 1
"""Version of a set without a version file: the first bundled sets had none."""
_LARGEST_BYTES = 1024**3
_MOST_OF_ALL = 1000
"""Maximum number of reported faults of a data set."""
_ItemT = TypeVar("_ItemT")
_TaskT = TypeVar("_TaskT", AssemblyTask, "QuestionTask")


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

    def task(self, scene: str, where: str = "", field: str = "scene") -> AssemblyTask:
        """Return a scene's task. Raises DataError, at this place and field, if there is none."""
        if scene in self._by_scene:
            return self._by_scene[scene]
        allowed, hint = some_of(list(self._by_scene)), did_you_mean(scene, self._by_scene)
        place, message = where or str(self.root), "is not in the data set"
        raise DataError(Problem(place, message, field, shown(scene), allowed, hint))


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
        files = [{n: hex_digest(read_data(p)) for n, p in t.files.items()} for t in self.tasks]
        return _digest([[t.question, own] for t, own in zip(self.tasks, files, strict=True)])


def _digest(content: object) -> str:
    # `asdict` would also copy everything inside.
    plain = lambda one: {each.name: getattr(one, each.name) for each in fields(one)}  # noqa: E731
    return hex_digest(json.dumps(content, sort_keys=True, default=plain))


def read_version(folder: Path) -> int:
    """Return the version of the data set in a folder. Raises DataError for a bad version file."""
    path = folder / VERSION_FILE
    found = read_data(path).strip() if path.exists() else b"%d" % UNNUMBERED
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
    some = [Problem(where, f.message, dotted(f.at), f.found or "", f.allowed) for f in faults]
    if some:
        raise DataError(some[:100])


def read_each(
    items: Iterable[tuple[str, _ItemT]], read: Callable[[_ItemT, str], _TaskT]
) -> tuple[_TaskT, ...]:
    """Return what `read` makes of each item and its place.

    Raises DataError with all faults and duplicate keys. Reading stops after a thousand faults.
    """
    first_use: dict[str, str] = {}
    tasks: list[_TaskT] = []
    problems: list[Problem] = []
    for where, item in items:
        if len(problems) > _MOST_OF_ALL:
            message = f"more than {_MOST_OF_ALL:,} faults; only the first were looked for"
            raise DataError([Problem(where, message), *problems])
        try:
            task = read(item, where)
        except DataError as error:
            problems += error.problems
            continue
        first = first_use.setdefault(task.key, where)
        if first != where:
            problems.append(Problem(where, f"is used at {first} already", "id", repr(task.key)))
        tasks.append(task)
    if problems:
        raise DataError(problems)
    return tuple(tasks)


def lines_of(path: Path, content: bytes, noun: str) -> list[tuple[str, bytes]]:
    """Return the lines of a file with their places. Raises DataError if there are none."""
    data = content.removesuffix(b"\n")
    if b"\0" in data or not data:
        raise DataError(Problem(str(path), f"holds no {noun}s", allowed=f"one {noun} a line"))
    return [(f"{path}:{n}", line) for n, line in enumerate(data.split(b"\n"), 1)]
