"""What a report takes from outside the run folder: the scenes that were asked about.

Without them the page still shows every reply, plan and score; it cannot draw.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from phyblock.datasets import AssemblyTask, Dataset
from phyblock.errors import DataError, Problem
from phyblock.report.design import Design
from phyblock.run.data import open_dataset
from phyblock.run.select import select_tasks

__all__ = ["Sources", "open_sources"]

_HINT = "name the folder where it is now with --data"


@dataclass(frozen=True)
class Sources:
    """Tasks by scene id; where there are none, `lacking` says why in a sentence."""

    tasks: Mapping[str, AssemblyTask] = field(default_factory=dict)
    lacking: str = ""


def open_sources(manifest: Mapping[str, Any], design: Design, data: Path | None) -> Sources:
    """The scenes of a run, from `data` or from where the run found them.

    Raises DataError when `data` is given and is not what the run was made on.
    """
    recorded = manifest.get("dataset") or {}
    try:
        dataset = _dataset(manifest, design, data or Path(recorded.get("root", "")))
    except DataError as error:
        if data is not None:
            raise
        said = "; ".join(f"{problem.where}: {problem.message}" for problem in error.problems[:1])
        how = "phyblock report RUN --data FOLDER draws it from where it is now"
        return Sources(lacking=f"Nothing can be drawn without the data set ({said}); {how}.")
    return Sources({task.scene.id: task for task in dataset.tasks})


def _dataset(manifest: Mapping[str, Any], design: Design, root: Path) -> Dataset:
    recorded = manifest.get("dataset") or {}
    if not root.is_dir():
        raise DataError(Problem(str(root), "the data set of the run is not there", hint=_HINT))
    dataset = open_dataset(recorded.get("format", "builtin"), root)
    tasks = select_tasks(dataset.tasks, design.suite.levels, manifest.get("limit"))
    chosen = replace(dataset, tasks=tasks)
    if chosen.sha256 != recorded.get("sha256"):
        message = "is not the data set that the run was made on, or it was changed since"
        wanted = str(recorded.get("sha256"))
        raise DataError(Problem(str(root), message, "sha256", chosen.sha256, wanted, _HINT))
    return chosen
