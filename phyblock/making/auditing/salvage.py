"""Reading what can be read of a broken data set, for an audit; runs never read this way.

A scene whose blocks make sense is kept although its dependencies, layers or candidates do not;
whatever keeps a scene or a part of it from being read comes back as a finding, named by scene.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from phyblock.datasets.builtin import SCENES_FILE
from phyblock.datasets.official import (
    OfficialGoal,
    candidates_file,
    goal_files,
    read_candidates,
    read_goal,
)
from phyblock.datasets.raw import lines_of, parse_json, used_already
from phyblock.domain import CandidateSet, Scene
from phyblock.errors import DataError, Problem
from phyblock.making.checks.finding import Finding, unreadable
from phyblock.records.faults import validated
from phyblock.records.line import Line
from phyblock.records.scene import (
    BlockList,
    CandidateList,
    SceneBlocks,
    StoredScene,
    candidate_set,
)

__all__ = ["Salvage", "SalvagedTask", "salvage"]

_MOST_FINDINGS = 10_000
_T = TypeVar("_T")


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


class _Scene(StoredScene):
    """Layers and unanswerable blocks are passed over in silence: the audit finds them itself."""

    blocks: BlockList
    candidates: Any = None


class _Goal(OfficialGoal):
    blocks: BlockList


class _Graph(Line, extra="ignore"):
    blocks: SceneBlocks


class _Candidates(Line, extra="ignore"):
    candidates: CandidateList


def _check_number(findings: list[Finding], root: Path) -> None:
    if len(findings) > _MOST_FINDINGS:
        message = f"has more than {_MOST_FINDINGS:,} faults: is this a data set?"
        raise DataError(Problem(str(root), message))


def _tolerate(read: Callable[[], _T], name: str, findings: list[Finding]) -> _T | None:
    """What `read` gives; None after findings that name the scene or line."""
    try:
        return read()
    except DataError as error:
        findings += _unreadable(name, error)
        return None


def _unreadable(name: str, error: DataError) -> list[Finding]:
    return [unreadable(name, problem) for problem in error.problems]


def _builtin(folder: Path, tasks: list[SalvagedTask], findings: list[Finding]) -> None:
    path = folder / SCENES_FILE
    first_line: dict[str, int] = {}
    for number, text in enumerate(lines_of(path, ""), 1):
        _check_number(findings, folder)
        where = f"{path}:{number}"
        try:
            raw = parse_json(text, path, number)
            line = validated(_Scene, raw, where)
        except DataError as error:
            findings += _unreadable(f"line {number}", error)
            continue
        first = first_line.setdefault(line.id, number)
        if first != number:
            findings.append(unreadable(line.id, used_already(where, f"by line {first}", line.id)))
            continue
        _tolerate(partial(validated, _Graph, raw, where), line.id, findings)
        read = _tolerate(partial(validated, _Candidates, raw, where), line.id, findings)
        candidates = None if read is None else candidate_set(read.candidates)
        tasks.append(SalvagedTask(line.scene(), candidates))


def _official(root: Path, tasks: list[SalvagedTask], findings: list[Finding]) -> None:
    for path in goal_files(root):
        _check_number(findings, root)
        name = path.stem
        goal = _tolerate(partial(read_goal, path, _Goal), name, findings)
        if goal is None:
            continue
        _tolerate(partial(read_goal, path, _Graph), name, findings)
        read = partial(read_candidates, candidates_file(root, path))
        tasks.append(SalvagedTask(goal.scene(name), _tolerate(read, name, findings)))
