"""Where an environment takes its scenes from."""

from __future__ import annotations

from pathlib import Path

from phyblock.data import AssemblyTask
from phyblock.data.named import read_data_set

__all__ = ["read_tasks"]


def read_tasks(data: str | Path) -> tuple[AssemblyTask, ...]:
    """The scenes of a data set: a folder with scenes.jsonl, an official checkout, a bundled name.

    Raises DataError when there is no such data set, or with everything that is wrong in it.
    """
    return read_data_set(str(data)).tasks
