"""Where an environment takes its scenes from."""

from __future__ import annotations

from pathlib import Path

from phyblock.datasets import SCENES_FILE, AssemblyTask, read_builtin, read_official
from phyblock.errors import DataError, Problem
from phyblock.resources import bundled, bundled_sets

__all__ = ["read_tasks"]


def read_tasks(data: str | Path) -> tuple[AssemblyTask, ...]:
    """The scenes of a data set: a folder with scenes.jsonl, an official checkout, a bundled name.

    Raises DataError when there is no such data set, or with everything that is wrong in it.
    """
    path = Path(data)
    if not path.is_dir() and len(path.parts) == 1:
        path = bundled("benchmarks", "data", str(data))
    if (path / SCENES_FILE).is_file():
        return read_builtin(path).tasks
    if path.is_dir():
        return read_official(path).tasks
    names = ", ".join(bundled_sets(SCENES_FILE))
    allowed = f"a folder with {SCENES_FILE}, an official checkout, or: {names}"
    raise DataError(Problem(str(data), "there is no such data set", allowed=allowed))
