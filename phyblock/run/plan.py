"""A suite made concrete: data read, models, prompt and pictures resolved."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from phyblock.datasets import (
    SCENES_FILE,
    Dataset,
    official_prompt,
    read_builtin,
    read_official,
)
from phyblock.errors import DataError, Problem, SpecError
from phyblock.resources import bundled, cache_dir
from phyblock.run.manifest import make_manifest
from phyblock.run.models import PlannedModel, plan_models
from phyblock.run.select import select_tasks
from phyblock.sim import PictureStyle
from phyblock.specs import LoadedSuite, ModelSpec, SuiteSpec
from phyblock.tasks import (
    FullPlanning,
    OfficialPrompt,
    PicturePolicy,
    Pictures,
    PlanningRules,
    Prompt,
    TemplatePrompt,
)

__all__ = ["RunPlan", "make_plan", "open_dataset", "planning_rules", "sample_id"]

_RENDER_WORKERS = 4


@dataclass(frozen=True)
class RunPlan:
    """Everything a run needs; `manifest` is what `run.yaml` holds."""

    suite: SuiteSpec
    models: tuple[PlannedModel, ...]
    dataset: Dataset
    track: FullPlanning
    template: str
    pictures: Pictures | None
    manifest: Mapping[str, Any]

    @property
    def samples_per_model(self) -> int:
        """Number of scenes times number of seeds."""
        return len(self.dataset.tasks) * len(self.suite.seeds)

    @property
    def folder_name(self) -> str:
        """Name of the run's folder when none is given: the same command finds it again."""
        return f"{self.suite.name}-{self.manifest['identity'][:8]}"


def sample_id(track: str, model: str, key: str, seed: int) -> str:
    """The name of a sample inside a run."""
    return f"{track}/{model}/{key}/s{seed}"


def make_plan(
    loaded: LoadedSuite,
    known: Mapping[str, ModelSpec],
    *,
    only: Sequence[str] = (),
    limit: int | None = None,
) -> RunPlan:
    """Resolve a suite against the known models.

    `only` names models to run in place of the suite's; `limit` keeps that many scenes, stratified
    by level. Raises SpecError, DataError or PromptError with all that is wrong.
    """
    suite = loaded.suite
    dataset = _select(loaded, limit)
    models = plan_models(loaded, known, only)
    prompt = pictures = None
    if any(model.config.kind != "replay" for model in models):
        prompt = _open_prompt(loaded)
        pictures = _open_pictures(suite, dataset)
    return RunPlan(
        suite,
        models,
        dataset,
        FullPlanning(planning_rules(suite), prompt, pictures),
        "" if prompt is None else prompt.name,
        pictures,
        make_manifest(suite, models, dataset, prompt, pictures, limit),
    )


def planning_rules(suite: SuiteSpec) -> PlanningRules:
    """How a suite reads and scores plans."""
    level1 = suite.scoring.level1
    criterion = None if level1 == "aov" else level1
    return PlanningRules(suite.parser, suite.settings, suite.scoring.matchers, criterion)


def open_dataset(format_name: str, path: Path) -> Dataset:
    """Read a data set; DataError when it is not there or broken."""
    if format_name == "official":
        return read_official(path)
    if path.is_dir():
        return read_builtin(path)
    names = sorted(p.parent.name for p in bundled("benchmarks", "data").glob(f"*/{SCENES_FILE}"))
    allowed = f"a folder with {SCENES_FILE}, or a bundled data set: {', '.join(names)}"
    raise DataError(Problem(str(path), "is no data set", "dataset.path", allowed=allowed))


def _select(loaded: LoadedSuite, limit: int | None) -> Dataset:
    suite = loaded.suite
    whole = open_dataset(suite.dataset.format, loaded.dataset_path)
    tasks = select_tasks(whole.tasks, suite.levels, limit)
    if tasks:
        return replace(whole, tasks=tasks)
    found = f"levels {', '.join(map(str, suite.levels))}; limit {limit or 'none'}"
    have = sorted({level for task in whole.tasks for level in task.scene.levels})
    allowed = f"the levels of {whole.name}: {', '.join(map(str, have))}"
    raise SpecError(Problem(str(loaded.path), "the suite has no samples", "", found, allowed))


def _open_prompt(loaded: LoadedSuite) -> Prompt:
    name = loaded.suite.prompt
    if name == "official":
        if loaded.suite.dataset.format != "official":
            message = "the official prompt is read from the official data set"
            hint = "set dataset.format to official and dataset.path to its checkout"
            raise SpecError(Problem(str(loaded.path), message, "prompt", name, hint=hint))
        return OfficialPrompt(official_prompt(loaded.dataset_path))
    if name == "default":
        return TemplatePrompt(bundled("prompts", "full_planning.j2"), name)
    return TemplatePrompt(loaded.prompt_path, loaded.prompt_path.stem)


def _open_pictures(suite: SuiteSpec, dataset: Dataset) -> Pictures:
    images = suite.images
    if images.source == "dataset":
        lacking = [task.scene.id for task in dataset.tasks if task.composite is None]
        if lacking:
            message = f"has no picture of {len(lacking)} of {len(dataset.tasks)} scenes"
            found = ", ".join(lacking[:8]) + (", ..." if len(lacking) > 8 else "")
            hint = "render them: --set images.source=render"
            problem = Problem(str(dataset.root), message, "images.source", found, hint=hint)
            raise DataError(problem)
    style = PictureStyle(size_px=images.size_px, background=images.background)
    policy = PicturePolicy(images.source, images.layout, images.order, style)
    workers = min(_RENDER_WORKERS, os.cpu_count() or 1)
    return Pictures(cache_dir() / "pictures", policy, workers)
