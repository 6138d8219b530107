"""Finding the scenes that a person means."""

from __future__ import annotations

from collections.abc import Sequence

from phyblock.data import AssemblyTask, Dataset
from phyblock.errors import DataError, Problem
from phyblock.text import did_you_mean

__all__ = ["find_scenes"]


def find_scenes(data: Dataset, names: Sequence[str]) -> tuple[AssemblyTask, ...]:
    """The named scenes, in the order named; raises DataError with all that are not there."""
    tasks = {task.scene.id: task for task in data.tasks}
    problems = []
    for name in names:
        if name not in tasks:
            hint = did_you_mean(name, tasks) or f"it holds {_some(list(tasks))}"
            problems.append(Problem(str(data.root), "holds no such scene", "", name, hint=hint))
    if problems:
        raise DataError(problems)
    return tuple(tasks[name] for name in names)


def _some(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 6 else f"{', '.join(names[:3])}, ..., {names[-1]}"
