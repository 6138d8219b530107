"""Reader of the project's own data format: a folder with `scenes.jsonl`, one scene a line.

Each line is an object with `id`, `levels`, `parents`, `blocks` (order, type, color, layer, depend,
position [m], euler [degrees]; `depend: [0]` is the ground) and `candidates` (type, color, euler,
required), numbered from 1 in the order given. docs/data-format.md holds the schema.
"""

from __future__ import annotations

import json
from pathlib import Path

from phyblock.datasets.base import AssemblyTask, Dataset
from phyblock.datasets.checks import RawReader, check_solvable
from phyblock.domain import Scene
from phyblock.errors import DataError, Problem

__all__ = ["SCENES_FILE", "read_builtin"]

SCENES_FILE = "scenes.jsonl"


def read_builtin(folder: Path) -> Dataset:
    """All scenes of a data set folder; raises DataError with everything that is wrong in it."""
    path = folder / SCENES_FILE
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        allowed = f"a folder with {SCENES_FILE}, or the name of a bundled data set"
        problem = Problem(str(path), f"cannot be read: {error.strerror}", allowed=allowed)
        raise DataError(problem) from error
    except UnicodeDecodeError as error:
        raise DataError(Problem(str(path), f"is not UTF-8 text: {error.reason}")) from error
    tasks: dict[str, AssemblyTask] = {}
    problems: list[Problem] = []
    for number, line in enumerate(lines, 1):
        try:
            task = _read_line(f"{path}:{number}", line)
        except DataError as error:
            problems += error.problems
            continue
        if task.scene.id in tasks:
            message = "is used by an earlier line"
            problems.append(Problem(f"{path}:{number}", message, "id", repr(task.scene.id)))
        tasks[task.scene.id] = task
    if not lines:
        problems.append(Problem(str(path), "holds no scenes", allowed="one scene a line"))
    if problems:
        raise DataError(problems)
    return Dataset(folder.name, folder, tuple(tasks[key] for key in sorted(tasks)))


def _read_line(where: str, line: str) -> AssemblyTask:
    try:
        raw = json.loads(line)
    except json.JSONDecodeError as error:
        raise DataError(Problem(f"{where}:{error.colno}", f"is not valid JSON: {error.msg}")) from (
            error
        )
    reader = RawReader(where)
    name = reader.get(raw, "id")
    if not isinstance(name, str) or not name or "/" in name:
        reader.complain("id", "is not a name", name, "a non-empty string without '/'")
    levels = reader.items(reader.get(raw, "levels"), "levels")
    for i, level in enumerate(levels):
        reader.integer(level, f"levels[{i}]", 1, 4)
    parents = reader.items(reader.get(raw, "parents"), "parents")
    if any(not isinstance(parent, str) for parent in parents):
        reader.complain("parents", "are not scene ids", parents, "a list of strings")
    blocks = reader.blocks(reader.get(raw, "blocks"), strict_layers=True)
    candidates = reader.candidates(reader.get(raw, "candidates"))
    reader.raise_if_broken()
    scene = Scene(name, tuple(sorted(levels)), blocks, tuple(parents))
    check_solvable(reader, scene, candidates)
    reader.raise_if_broken()
    return AssemblyTask(scene, candidates)
