"""Reading what can be read of a broken data set, for an audit; runs never read this way.

A scene whose blocks make sense is kept although its dependencies, layers or candidates do not;
whatever keeps a scene or a part of it from being read comes back as a finding, named by scene.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from phyblock.datasets.builtin import SCENES_FILE, read_line, scene_lines
from phyblock.datasets.checks import SceneReader
from phyblock.datasets.official import candidates_file, goal_files, read_candidates, read_scene
from phyblock.domain import Block, CandidateSet, Scene
from phyblock.errors import DataError, Problem
from phyblock_making.checks.finding import Finding, unreadable

__all__ = ["Salvage", "SalvagedTask", "salvage"]

_MOST_FINDINGS = 10_000


@dataclass(frozen=True)
class SalvagedTask:
    """A scene with unique orders, whose dependencies may be unsound; None: no readable set."""

    scene: Scene
    candidates: CandidateSet | None


@dataclass(frozen=True)
class Salvage:
    """What could be read of a data set, in scene-id order, and what could not.

    A finding names the scene by its id, or by its line in the file where it has none.
    """

    root: Path
    tasks: tuple[SalvagedTask, ...]
    findings: tuple[Finding, ...]


def salvage(root: Path) -> Salvage:
    """Read a folder with `scenes.jsonl`, or an official checkout.

    Raises DataError when it is neither.
    """
    tasks: list[SalvagedTask] = []
    findings: list[Finding] = []
    read = _builtin if (root / SCENES_FILE).is_file() else _official
    read(root, tasks, findings)
    return Salvage(root, tuple(sorted(tasks, key=lambda task: task.scene.id)), tuple(findings))


class _TolerantReader(SceneReader):
    """Keeps apart what does not stop an audit: its complaints go to `tolerated`.

    Layers and unanswerable blocks are passed over in silence: the audit finds them itself.
    """

    def __init__(self, where: str) -> None:
        super().__init__(where)
        self.tolerated: list[Problem] = []

    def check_dependencies(self, blocks: tuple[Block, ...]) -> None:
        self._tolerate(lambda: super(_TolerantReader, self).check_dependencies(blocks))

    def check_layers(self, blocks: tuple[Block, ...]) -> None:
        del blocks

    def check_solvable(self, scene: Scene, candidates: CandidateSet) -> None:
        del scene, candidates

    def candidates(self, raw: object) -> CandidateSet:
        return self._tolerate(lambda: super(_TolerantReader, self).candidates(raw))

    def _tolerate(self, read: Callable[[], CandidateSet | None]) -> CandidateSet:
        before = len(self.problems)
        candidates = read()
        self.tolerated += self.problems[before:]
        del self.problems[before:]
        return candidates or CandidateSet(())


def _check_number(findings: list[Finding], root: Path) -> None:
    if len(findings) > _MOST_FINDINGS:
        message = f"has more than {_MOST_FINDINGS:,} faults: is this a data set?"
        raise DataError(Problem(str(root), message))


def _builtin(folder: Path, tasks: list[SalvagedTask], findings: list[Finding]) -> None:
    path = folder / SCENES_FILE
    first_line: dict[str, int] = {}
    for number, line in enumerate(scene_lines(path), 1):
        _check_number(findings, folder)
        reader = _TolerantReader(f"{path}:{number}")
        try:
            task = read_line(path, number, line, reader)
        except DataError as error:
            findings += [unreadable(f"line {number}", problem) for problem in error.problems]
            continue
        name = task.scene.id
        first = first_line.setdefault(name, number)
        if first != number:
            message = f"is used by line {first} already"
            problem = Problem(reader.where, message, "id", repr(name))
            findings.append(unreadable(name, problem))
            continue
        findings += [unreadable(name, problem) for problem in reader.tolerated]
        tasks.append(SalvagedTask(task.scene, task.candidates if len(task.candidates) else None))


def _official(root: Path, tasks: list[SalvagedTask], findings: list[Finding]) -> None:
    for path in goal_files(root):
        _check_number(findings, root)
        reader = _TolerantReader(str(path))
        try:
            scene = read_scene(path, reader)
        except DataError as error:
            findings += [unreadable(path.stem, problem) for problem in error.problems]
            continue
        findings += [unreadable(path.stem, problem) for problem in reader.tolerated]
        try:
            candidates = read_candidates(candidates_file(root, path))
        except DataError as error:
            findings += [unreadable(path.stem, problem) for problem in error.problems]
            tasks.append(SalvagedTask(scene, None))
        else:
            tasks.append(SalvagedTask(scene, candidates))
