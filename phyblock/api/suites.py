"""A suite and its scenes."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from phyblock.api.given import expect
from phyblock.api.pictures import render
from phyblock.config.suite import Suite as ConfigSuite
from phyblock.config.suite import load_suite as read_suite
from phyblock.data import AssemblyTask
from phyblock.errors import Problem, SpecError
from phyblock.resources import bundled
from phyblock.run.plan import open_dataset
from phyblock.run.preflight import find_suite, prompt_dirs
from phyblock.text import counted, did_you_mean
from phyblock.tracks.items import select_tasks

__all__ = ["SceneTask", "Scenes", "Suite", "load_suite"]


@dataclass(frozen=True, repr=False)
class SceneTask(AssemblyTask):
    """A goal (`scene`) with its numbered `candidates`; a notebook shows both as a picture."""

    def __repr__(self) -> str:
        n_blocks = counted(len(self.scene.blocks), "block")
        n_candidates = counted(len(self.candidates), "candidate")
        return f"<scene {self.key}: level {self.scene.level}, {n_blocks}, {n_candidates}>"

    def _repr_png_(self) -> bytes:
        return render(self).png


class Scenes(Mapping[str, SceneTask]):
    """Scenes by id, in the order of the data set."""

    def __init__(self, tasks: Sequence[AssemblyTask]) -> None:
        self._tasks = {
            one.key: SceneTask(one.scene, one.candidates, one.composite) for one in tasks
        }

    def __getitem__(self, key: str) -> SceneTask:
        if key not in self._tasks:
            hint = did_you_mean(str(key), list(self._tasks))
            raise SpecError(Problem("suite.scenes", "has no such scene", "", str(key), hint=hint))
        return self._tasks[key]

    def __contains__(self, key: object) -> bool:
        return key in self._tasks

    def __iter__(self) -> Iterator[str]:
        return iter(self._tasks)

    def __len__(self) -> int:
        return len(self._tasks)

    def __repr__(self) -> str:
        first = ", ".join(list(self._tasks)[:3])
        return f"<{counted(len(self), 'scene')}: {first}{', ...' if len(self) > 3 else ''}>"


@dataclass(frozen=True, repr=False)
class Suite:
    """A suite as it was read: what `run_suite` takes."""

    loaded: ConfigSuite = field(compare=False)

    @property
    def name(self) -> str:
        """Its name."""
        return self.loaded.name

    @property
    def models(self) -> tuple[str, ...]:
        """The models that it names; groups, and the word `recorded`, stand for themselves."""
        named = self.loaded.models
        return (named,) if isinstance(named, str) else tuple(named)

    @functools.cached_property
    def scenes(self) -> Scenes:
        """The scenes of its levels, as many as its limit keeps.

        Raises DataError where the data set cannot be read.
        """
        suite = self.loaded
        dataset = open_dataset(suite.dataset.format, self.loaded.files.dataset)
        return Scenes(select_tasks(dataset.tasks, suite.levels, suite.limit))

    def __repr__(self) -> str:
        return f"<suite {self.name}: {self._about()}>"

    def _about(self) -> str:
        suite = self.loaded
        levels = ", ".join(map(str, suite.levels))
        return (
            f"{', '.join(suite.tracks)}; levels {levels}; {counted(len(suite.seeds), 'seed')}; "
            f"models {', '.join(self.models)}"
        )

    def _repr_html_(self) -> str:
        """Return what a notebook shows: name, description, what it asks of whom."""
        described = self.loaded.description
        return (
            f"<p><b>{escape(self.name)}</b> {escape(described)}</p><p>{escape(self._about())}</p>"
        )


def load_suite(suite: str | Path, *overrides: str) -> Suite:
    """Read a suite: a YAML file, or the name of a bundled one; `overrides` are `KEY=VALUE` texts,
    as of `--set`.

    Raises SpecError with all that is wrong, each with its file, line and field.
    """
    texts = {f"overrides[{n}]": (text, str, "KEY=VALUE") for n, text in enumerate(overrides)}
    expect("load_suite", {"suite": (suite, (str, Path), "a name or a path"), **texts})
    path = find_suite(str(suite))
    data, prompts = bundled("benchmarks", "data"), prompt_dirs(path)
    return Suite(read_suite(path, overrides, data_dir=data, prompt_dirs=prompts))
