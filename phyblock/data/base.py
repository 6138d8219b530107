"""What every reader of a data format returns."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from phyblock.domain import CandidateSet, Question, Scene
from phyblock.errors import DataError, Problem, reason_of
from phyblock.files import LARGEST_PICTURE_BYTES, read_bytes
from phyblock.stable import hex_digest

__all__ = ["AssemblyTask", "Dataset", "QuestionSet", "QuestionTask"]


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
        """What samples call it: the scene's id."""
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
    return {label: hex_digest(_picture_bytes(path)) for label, path in sorted(files.items())}


def _picture_bytes(path: Path) -> bytes:
    try:
        return read_bytes(path, LARGEST_PICTURE_BYTES)
    except (OSError, ValueError) as error:
        raise DataError(Problem(str(path), f"cannot be read: {reason_of(error)}")) from error


def _digest(content: object) -> str:
    return hex_digest(json.dumps(content, sort_keys=True, default=_fields))


def _fields(one: Any) -> dict[str, object]:
    """A dataclass as JSON takes it; `asdict` would copy all that is in it as well."""
    return {each.name: getattr(one, each.name) for each in fields(one)}
