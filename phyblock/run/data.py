"""Opening the data set that a suite or a manifest names."""

from __future__ import annotations

from pathlib import Path

from phyblock.datasets import SCENES_FILE, Dataset, read_builtin, read_official
from phyblock.errors import DataError, Problem
from phyblock.resources import bundled_sets

__all__ = ["open_dataset"]


def open_dataset(format_name: str, path: Path) -> Dataset:
    """Read a data set; DataError when it is not there or broken."""
    if format_name == "official":
        return read_official(path)
    if path.is_dir():
        return read_builtin(path)
    names = ", ".join(bundled_sets(SCENES_FILE))
    allowed = f"a folder with {SCENES_FILE}, or a bundled data set: {names}"
    raise DataError(Problem(str(path), "is no data set", "dataset.path", allowed=allowed))
