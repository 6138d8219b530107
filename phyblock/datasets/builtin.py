"""Reader of the project's own data format: a folder with `scenes.jsonl`, one scene a line.

Each line is an object with `id`, `levels`, `parents`, `blocks` (order, type, color, layer, depend,
position [m], euler [degrees]; `depend: [0]` is the ground) and `candidates` (type, color, euler,
required), numbered from 1 in the order given. docs/data-format.md holds the schema.
"""

from __future__ import annotations

from pathlib import Path

from phyblock.datasets.base import AssemblyTask, Dataset
from phyblock.datasets.checks import SceneReader
from phyblock.datasets.raw import gather, parse_json, read_text
from phyblock.domain import Scene
from phyblock.errors import DataError, Problem

__all__ = ["SCENES_FILE", "read_builtin", "read_line", "scene_lines"]

SCENES_FILE = "scenes.jsonl"
_MOST_PARENTS = 100
_LEVELS = ("[1]", "[2]", "[3]", "[4]", "[1, 2]")


def read_builtin(folder: Path) -> Dataset:
    """All scenes of a data set folder; raises DataError with everything that is wrong in it."""
    path = folder / SCENES_FILE
    lines = scene_lines(path)
    first_line: dict[str, int] = {}
    tasks: list[AssemblyTask] = []
    problems: list[Problem] = []
    for number, line in enumerate(lines, 1):
        try:
            task = read_line(path, number, line)
        except DataError as error:
            gather(problems, error.problems, path)
            continue
        first = first_line.setdefault(task.scene.id, number)
        if first != number:
            message = f"is used by line {first} already"
            twice = Problem(f"{path}:{number}", message, "id", repr(task.scene.id))
            gather(problems, [twice], path)
        tasks.append(task)
    if not lines:
        problems.append(Problem(str(path), "holds no scenes", allowed="one scene a line"))
    if problems:
        raise DataError(problems)
    return Dataset(folder.name, folder, tuple(sorted(tasks, key=lambda task: task.scene.id)))


def scene_lines(path: Path, allowed: str = "") -> list[str]:
    """The lines of a data set file; DataError, with what is allowed, when it cannot be read."""
    allowed = allowed or f"a folder with {SCENES_FILE}, or the name of a bundled data set"
    text = read_text(path, allowed)
    # Not splitlines(): a JSON string may hold U+2028 and other line ends of Unicode.
    return text.removesuffix("\n").split("\n") if text else []


def read_line(
    path: Path, number: int, line: str, reader: SceneReader | None = None
) -> AssemblyTask:
    """The task in one line; raises DataError with everything that `reader` finds wrong."""
    reader = reader or SceneReader(f"{path}:{number}")
    raw = reader.mapping(parse_json(line, path, number))
    name = reader.name(reader.get(raw, "id"), "id")
    levels = reader.items(reader.get(raw, "levels"), "levels", 2)
    if levels and str(levels) not in _LEVELS:
        reader.complain("levels", "are not allowed", levels, "one level 1 to 4, or [1, 2]")
    parents = reader.items(reader.get(raw, "parents"), "parents", _MOST_PARENTS)
    for i, parent in enumerate(parents):
        reader.name(parent, f"parents[{i}]")
    blocks = reader.blocks(reader.get(raw, "blocks"), strict_layers=True)
    candidates = reader.candidates(reader.get(raw, "candidates"))
    reader.raise_if_broken()
    scene = Scene(name, tuple(levels), blocks, tuple(parents))
    reader.check_solvable(scene, candidates)
    reader.raise_if_broken()
    return AssemblyTask(scene, candidates)
