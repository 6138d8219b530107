"""Lookup of data sets by name: a folder, or a bundled set."""

import os
from pathlib import Path

from phyblock.data.base import Dataset
from phyblock.data.official import read_official
from phyblock.data.questions import QUESTIONS_FILE
from phyblock.data.scenes import SCENES_FILE, read_builtin
from phyblock.errors import DataError, Problem
from phyblock.files import bundled, bundled_sets


def find_data_set(name: str) -> Path:
    """Return the folder of a data set, an official checkout or a bundled set. Raises DataError."""
    path = Path(name)
    if os.path.lexists(path / SCENES_FILE) or (path / "data").is_dir():
        return path
    return _bundled(path, SCENES_FILE, "data set", ", an official checkout")


def read_data_set(name: str) -> Dataset:
    """Return the data set of `name`. Raises DataError with all its problems."""
    folder = find_data_set(name)
    return open_dataset("builtin" if os.path.lexists(folder / SCENES_FILE) else "official", folder)


def open_dataset(layout: str, folder: Path) -> Dataset:
    """Return the "builtin" or "official" data set in a folder. Raises DataError if it is broken."""
    return read_official(folder) if layout == "official" else read_builtin(folder)


def find_questions(name: str) -> Path:
    """Return the folder of questions of this name or path, bundled or not. Raises DataError."""
    path = Path(name)
    return path if path.is_dir() else _bundled(path, QUESTIONS_FILE, "set of questions")


def _bundled(path: Path, file: str, noun: str, more: str = "") -> Path:
    """Return the folder of a bundled set with this data file."""
    inside = bundled("benchmarks", "data", *path.parts)
    if len(path.parts) == 1 and (inside / file).is_file():
        return inside
    message = f"holds no {noun}" if path.is_dir() else f"there is no such {noun}"
    allowed = f"a folder with {file}{more}, or a bundled set: {', '.join(bundled_sets(file))}"
    raise DataError(Problem(str(path), message, allowed=allowed))
