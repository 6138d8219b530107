"""Finding the data that a person means: a folder, a file in it, or the name of a bundled set."""

from __future__ import annotations

from pathlib import Path

from phyblock.data.base import Dataset
from phyblock.data.builtin import SCENES_FILE, read_builtin
from phyblock.data.official import read_official
from phyblock.data.questions import QUESTIONS_FILE
from phyblock.errors import DataError, Problem
from phyblock.resources import bundled, bundled_sets

__all__ = ["find_data_set", "find_questions", "read_data_set"]

_OFFICIAL = "data"
"""The folder of an official checkout that holds its scenes."""


def find_data_set(name: str) -> Path:
    """The folder that `name` means: a data set, a checkout, or the name of a bundled set.

    Raises DataError that lists the bundled sets when there is no such folder.
    """
    path = Path(name)
    if (path / SCENES_FILE).is_file() or (path / _OFFICIAL).is_dir():
        return path
    if (folder := _file_or_bundled(path, SCENES_FILE)) is not None:
        return folder
    names = ", ".join(bundled_sets(SCENES_FILE))
    allowed = f"a folder with {SCENES_FILE}, an official checkout, or a bundled set: {names}"
    message = "holds no data set" if path.is_dir() else "there is no such data set"
    raise DataError(Problem(name, message, allowed=allowed))


def read_data_set(name: str) -> Dataset:
    """The data set that `name` means; raises DataError with everything that is wrong in it."""
    folder = find_data_set(name)
    return read_builtin(folder) if (folder / SCENES_FILE).is_file() else read_official(folder)


def find_questions(name: str) -> Path:
    """The folder that `name` means: one with questions, or the name of a bundled set.

    Raises DataError that lists the bundled sets when there is no such folder.
    """
    path = Path(name)
    if path.is_dir():
        return path
    if (folder := _file_or_bundled(path, QUESTIONS_FILE)) is not None:
        return folder
    names = ", ".join(bundled_sets(QUESTIONS_FILE))
    allowed = f"a folder with {QUESTIONS_FILE}, or a bundled set: {names}"
    raise DataError(Problem(name, "there are no such questions", allowed=allowed))


def _file_or_bundled(path: Path, file: str) -> Path | None:
    """The folder of a data file that is named itself, or of a bundled set."""
    if path.name == file and path.is_file():
        return path.parent
    inside = bundled("benchmarks", "data", *path.parts)
    return inside if len(path.parts) == 1 and (inside / file).is_file() else None
