"""Finding the data set that a person means."""

from __future__ import annotations

from pathlib import Path

from phyblock.datasets import SCENES_FILE, Dataset, read_builtin, read_official
from phyblock.errors import DataError, Problem
from phyblock.resources import bundled

__all__ = ["find_data_set", "read_data_set"]


def find_data_set(name: str) -> Path:
    """The folder that `name` means: a data set, a checkout, or the name of a bundled set.

    Raises DataError that lists the bundled sets when there is no such folder.
    """
    path = Path(name)
    if path.is_dir():
        return path
    if path.name == SCENES_FILE and path.is_file():
        return path.parent
    if len(path.parts) == 1 and bundled("benchmarks", "data", name, SCENES_FILE).is_file():
        return bundled("benchmarks", "data", name)
    names = sorted(p.parent.name for p in bundled("benchmarks", "data").glob(f"*/{SCENES_FILE}"))
    allowed = (
        f"a folder with {SCENES_FILE}, an official checkout, or a bundled set: {', '.join(names)}"
    )
    raise DataError(Problem(name, "there is no such data set", allowed=allowed))


def read_data_set(name: str) -> Dataset:
    """The data set that `name` means; raises DataError with everything that is wrong in it."""
    folder = find_data_set(name)
    return read_builtin(folder) if (folder / SCENES_FILE).is_file() else read_official(folder)
