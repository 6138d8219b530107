"""What a report takes from outside the run folder: the scenes and what else was asked about.

Without them the page still shows every reply, plan and score; it cannot draw.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from phyblock.data import AssemblyTask, Dataset
from phyblock.errors import DataError
from phyblock.results.load import Run
from phyblock.run.plan import recorded_dataset
from phyblock.tracks.kind import kind_of
from phyblock.tracks.measures import PageItems

__all__ = ["Sources", "open_sources"]


@dataclass(frozen=True)
class Sources:
    """Tasks by scene id, and items that are more than scenes by track; where there are none,
    `lacking` says why.
    """

    tasks: Mapping[str, AssemblyTask] = field(default_factory=dict)
    items: Mapping[str, PageItems] = field(default_factory=dict)
    lacking: str = ""


def open_sources(run: Run, data: Path | None) -> Sources:
    """The scenes of a run, from `data` or from where the run found them, and what else
    its tracks asked about.

    Raises DataError when `data` is given and is not what the run was made on.
    """
    try:
        dataset = recorded_dataset(run.path, run.manifest, run.design.suite.levels, data)
        tasks = {task.scene.id: task for task in dataset.tasks}
        return Sources(tasks, _items(run, dataset))
    except DataError as error:
        if data is not None:
            raise
        said = f"{error.problems[0].where}: {error.problems[0].message}"
        how = "phyblock report RUN --data FOLDER draws it from where it is now"
        return Sources(lacking=f"Nothing can be drawn without the data set ({said}); {how}.")


def _items(run: Run, dataset: Dataset) -> dict[str, PageItems]:
    """What was asked about, by track, where it is more than scenes."""
    openers = {name: kind_of(name).report().items for name in run.design.suite.tracks}
    return {name: opener(run, dataset) for name, opener in openers.items() if opener is not None}
