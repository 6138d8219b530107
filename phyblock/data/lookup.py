"""Data sets by the name that a person gives: a folder, a file in it, or a set of phyblock's own."""

import os
from pathlib import Path

from phyblock.data.base import Dataset
from phyblock.data.official import read_official
from phyblock.data.questions import QUESTIONS_FILE
from phyblock.data.scenes import SCENES_FILE, read_builtin
from phyblock.errors import DataError, Problem
from phyblock.files import bundled, bundled_sets


def find_data_set(name: str) -> Path:
    """Return the folder that `name` means: a data set, an official checkout, or a bundled set.

    Raises DataError that lists the bundled sets when there is no such folder.
    """
    path = Path(name)
    if os.path.lexists(path / SCENES_FILE) or (path / "data").is_dir():
        return path
    return _file_or_bundled(path, SCENES_FILE, "data set", ", an official checkout")


def read_data_set(name: str) -> Dataset:
    """Return the data set that `name` means; DataError with everything that is wrong in it."""
    folder = find_data_set(name)
    return open_dataset("builtin" if os.path.lexists(folder / SCENES_FILE) else "official", folder)


def open_dataset(layout: str, folder: Path) -> Dataset:
    """Return the data set in a folder, "builtin" or "official"; DataError where it is broken."""
    return read_official(folder) if layout == "official" else read_builtin(folder)


def find_questions(name: str) -> Path:
    """Return the folder that `name` means: one with questions, or a bundled set.

    Raises DataError that lists the bundled sets when there is no such folder.
    """
    path = Path(name)
    return path if path.is_dir() else _file_or_bundled(path, QUESTIONS_FILE, "set of questions")


def _file_or_bundled(path: Path, file: str, noun: str, more: str = "") -> Path:
    """Return the folder of a data file that is named itself, or of a bundled set."""
    if path.name == file and os.path.lexists(path):
        return path.parent
    inside = bundled("benchmarks", "data", *path.parts)
    if len(path.parts) == 1 and (inside / file).is_file():
        return inside
    message = f"holds no {noun}" if path.is_dir() else f"there is no such {noun}"
    allowed = f"a folder with {file}{more}, or a bundled set: {', '.join(bundled_sets(file))}"
    raise DataError(Problem(str(path), message, allowed=allowed))
