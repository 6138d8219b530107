"""Finding the data set that a person means."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path

from phyblock.datasets import SCENES_FILE, AssemblyTask, Dataset, read_builtin, read_official
from phyblock.errors import DataError, Problem
from phyblock.resources import bundled, bundled_sets

__all__ = ["find_data_set", "find_scenes", "read_data_set"]

_OFFICIAL = "data"
"""The folder of an official checkout that holds its scenes."""


def find_data_set(name: str) -> Path:
    """The folder that `name` means: a data set, a checkout, or the name of a bundled set.

    Raises DataError that lists the bundled sets when there is no such folder.
    """
    path = Path(name)
    if (path / SCENES_FILE).is_file() or (path / _OFFICIAL).is_dir():
        return path
    if path.name == SCENES_FILE and path.is_file():
        return path.parent
    if len(path.parts) == 1 and bundled("benchmarks", "data", name, SCENES_FILE).is_file():
        return bundled("benchmarks", "data", name)
    names = ", ".join(bundled_sets(SCENES_FILE))
    allowed = f"a folder with {SCENES_FILE}, an official checkout, or a bundled set: {names}"
    message = "holds no data set" if path.is_dir() else "there is no such data set"
    raise DataError(Problem(name, message, allowed=allowed))


def read_data_set(name: str) -> Dataset:
    """The data set that `name` means; raises DataError with everything that is wrong in it."""
    folder = find_data_set(name)
    return read_builtin(folder) if (folder / SCENES_FILE).is_file() else read_official(folder)


def find_scenes(data: Dataset, names: Sequence[str]) -> tuple[AssemblyTask, ...]:
    """The named scenes, in the order named; raises DataError with all that are not there."""
    tasks = {task.scene.id: task for task in data.tasks}
    problems = []
    for name in names:
        if name not in tasks:
            near = difflib.get_close_matches(name, tasks, 1)
            hint = f"did you mean {near[0]}?" if near else f"it holds {_some(list(tasks))}"
            problems.append(Problem(str(data.root), "holds no such scene", "", name, hint=hint))
    if problems:
        raise DataError(problems)
    return tuple(tasks[name] for name in names)


def _some(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 6 else f"{', '.join(names[:3])}, ..., {names[-1]}"
