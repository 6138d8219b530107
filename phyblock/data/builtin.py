"""Reader of the project's own data format: a folder with `scenes.jsonl`, one scene a line.

`phyblock.records.scene` declares the line; docs/data-format.md describes it.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

from phyblock.data.base import AssemblyTask, Dataset
from phyblock.data.raw import read_lines, read_text
from phyblock.records.faults import refuse, validated
from phyblock.records.scene import StoredScene, candidate_set, missing_faults

__all__ = ["SCENES_FILE", "read_builtin"]

SCENES_FILE = "scenes.jsonl"
_ALLOWED = f"a folder with {SCENES_FILE}, or the name of a bundled data set"


def read_builtin(folder: Path) -> Dataset:
    """All scenes of a data set folder; raises DataError with everything that is wrong in it."""
    path = folder / SCENES_FILE
    return Dataset(folder.name, folder, _tasks(path, read_text(path, _ALLOWED)))


@functools.lru_cache(maxsize=1)
def _tasks(path: Path, text: str) -> tuple[AssemblyTask, ...]:
    """The scenes in a file's text, which a run reads again for its report."""
    tasks = read_lines(path, text, "scene", _read_task, lambda task: task.key)
    return tuple(sorted(tasks, key=lambda task: task.key))


def _read_task(raw: Any, where: str) -> AssemblyTask:
    line = validated(StoredScene, raw, where)
    scene, candidates = line.scene(), candidate_set(line.candidates)
    refuse(missing_faults(scene, candidates), where)
    return AssemblyTask(scene, candidates)
