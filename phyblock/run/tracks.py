"""The tracks of a suite: prompt, pictures and rules of each put together."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from phyblock.datasets import AssemblyTask, Dataset, official_prompt
from phyblock.errors import DataError, Problem, SpecError
from phyblock.resources import bundled, cache_dir
from phyblock.run.select import select_tasks
from phyblock.run.vqa import open_vqa
from phyblock.sim import PictureStyle
from phyblock.specs import LoadedSuite, SuiteSpec
from phyblock.tasks import (
    AnyTrack,
    FullPlanning,
    OfficialPrompt,
    PicturePolicy,
    Pictures,
    PlanningRules,
    Prompt,
    StepLimits,
    StepPlanning,
    StepPrompt,
    StepRules,
    TemplatePrompt,
    Vqa,
)

__all__ = ["open_tracks", "planning_rules"]

_RENDER_WORKERS = 4


@dataclass(frozen=True)
class _Context:
    """What a track is made from; without `with_prompts` nothing is asked of anyone."""

    loaded: LoadedSuite
    dataset: Dataset
    limit: int | None
    with_prompts: bool


def open_tracks(
    loaded: LoadedSuite, dataset: Dataset, limit: int | None, *, with_prompts: bool
) -> tuple[AnyTrack, ...]:
    """The tracks in the suite's order.

    Raises SpecError, DataError or PromptError with what is wrong.
    """
    context = _Context(loaded, dataset, limit, with_prompts)
    return tuple(_TRACKS[name](context) for name in loaded.suite.tracks)


def planning_rules(suite: SuiteSpec) -> PlanningRules:
    """How a suite reads and scores plans."""
    level1 = suite.scoring.level1
    criterion = None if level1 == "aov" else level1
    return PlanningRules(suite.parser, suite.settings, suite.scoring.matchers, criterion)


def _full_planning(context: _Context) -> FullPlanning:
    suite = context.loaded.suite
    tasks = select_tasks(context.dataset.tasks, suite.levels, context.limit)
    if not context.with_prompts:
        return FullPlanning(planning_rules(suite), items=tasks)
    if suite.images.source == "dataset":
        _check_composites(context.dataset, tasks)
    pictures = Pictures(cache_dir() / "pictures", _policy(suite), _render_workers())
    return FullPlanning(planning_rules(suite), _planning_prompt(context.loaded), pictures, tasks)


def _planning_prompt(loaded: LoadedSuite) -> Prompt:
    name = loaded.suite.prompt
    if name == "official":
        if loaded.suite.dataset.format != "official":
            message = "the official prompt is read from the official data set"
            hint = "set dataset.format to official and dataset.path to its checkout"
            raise SpecError(Problem(str(loaded.path), message, "prompt", name, hint=hint))
        return OfficialPrompt(official_prompt(loaded.dataset_path))
    if name == "default":
        return TemplatePrompt(bundled("prompts", "full_planning.j2"), name)
    path = loaded.templates["full_planning"]
    return TemplatePrompt(path, path.stem)


def _step_planning(context: _Context) -> StepPlanning:
    suite = context.loaded.suite
    tasks = select_tasks(context.dataset.tasks, suite.levels, context.limit)
    rules = _step_rules(suite)
    if not context.with_prompts:
        return StepPlanning(rules, items=tasks)
    if suite.images.source == "dataset":
        where = context.loaded.where("images", "source")
        message = "step planning draws every state, so the goal must be drawn as well"
        hint = "render the pictures: --set images.source=render"
        raise SpecError(Problem(where, message, "images.source", "dataset", hint=hint))
    steps = suite.steps
    path = context.loaded.templates.get("step_planning")
    template = (
        TemplatePrompt(bundled("prompts", "step_planning.j2"), "default")
        if path is None
        else TemplatePrompt(path, path.stem)
    )
    shown = (steps.feedback, steps.history, steps.memory, steps.cot)
    prompt = StepPrompt(template, *shown, gating=rules.gating, accepts=rules.accepts)
    pictures = Pictures(cache_dir() / "pictures", _policy(suite), _render_workers())
    return StepPlanning(rules, prompt, pictures, tasks)


def _vqa(context: _Context) -> Vqa:
    asks = context.with_prompts
    workers = _render_workers()
    return open_vqa(
        context.loaded, context.dataset, context.limit, with_prompts=asks, workers=workers
    )


def _step_rules(suite: SuiteSpec) -> StepRules:
    """How a suite plays episodes."""
    steps = suite.steps
    limits = StepLimits(
        steps.max_steps,
        steps.max_failures,
        steps.max_repeats,
        steps.max_episode_tokens,
        steps.max_episode_usd,
    )
    accepts = steps.setting or suite.settings[0]
    return StepRules(accepts, suite.settings, steps.gating, steps.physics, steps.samples, limits)


def _check_composites(dataset: Dataset, tasks: Sequence[AssemblyTask]) -> None:
    """Raise DataError when the data set has no picture of a scene."""
    lacking = [task.key for task in tasks if task.composite is None]
    if lacking:
        message = f"has no picture of {len(lacking)} of {len(tasks)} scenes"
        found = ", ".join(lacking[:8]) + (", ..." if len(lacking) > 8 else "")
        hint = "render them: --set images.source=render"
        raise DataError(Problem(str(dataset.root), message, "images.source", found, hint=hint))


def _policy(suite: SuiteSpec) -> PicturePolicy:
    images = suite.images
    style = PictureStyle(size_px=images.size_px, background=images.background)
    return PicturePolicy(images.source, images.layout, images.order, style)


def _render_workers() -> int:
    return min(_RENDER_WORKERS, os.cpu_count() or 1)


_TRACKS: Mapping[str, Callable[[_Context], AnyTrack]] = {
    "full_planning": _full_planning,
    "step_planning": _step_planning,
    "vqa": _vqa,
}
