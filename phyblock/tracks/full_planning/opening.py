"""Open the full-planning track of a suite."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phyblock.config.suite import Suite
from phyblock.data import AssemblyTask, Dataset, official_prompt
from phyblock.errors import DataError, Problem, SpecError
from phyblock.tracks.examples import examples_of
from phyblock.tracks.full_planning.spec import PlanningSpec
from phyblock.tracks.full_planning.track import FullPlanning, PlanningRules
from phyblock.tracks.full_planning.worked import can_be_worked
from phyblock.tracks.kind import Opening
from phyblock.tracks.opening import assembly_pictures, task_showing, template_prompt
from phyblock.tracks.prompts import OfficialPrompt, Prompt
from phyblock.tracks.selection import select_tasks
from phyblock.tracks.showing import TaskShowing

__all__ = ["open_full_planning"]


def open_full_planning(opening: Opening) -> FullPlanning:
    """The track; SpecError, DataError or PromptError with what is wrong."""
    suite = opening.suite
    tasks = select_tasks(opening.dataset.tasks, suite.levels, opening.limit)
    pool = opening.dataset.tasks
    showing = task_showing(suite, PlanningSpec, FullPlanning.name, tasks, pool)
    if not opening.with_prompts:
        return FullPlanning(_rules(suite), items=tasks, showing=showing, pool=pool)
    if suite.images.source == "dataset":
        _check_composites(opening.dataset, tasks)
    prompt, pictures = _prompt(opening.suite), assembly_pictures(suite, opening.shop)
    as_shown = TaskShowing(replace(showing.how, wrong_image=False))
    able = [
        as_shown.of(task, suite.seeds[0])
        for task in pool
        if can_be_worked(task) and (task.composite or suite.images.source == "render")
    ]
    examples = examples_of(opening.suite, able, tasks, "scene", stand_ins=showing.stand_ins)
    return FullPlanning(_rules(suite), prompt, pictures, tasks, showing, pool, examples)


def _rules(suite: Suite) -> PlanningRules:
    """How a suite reads and scores plans."""
    level1 = suite.scoring.level1
    criterion = None if level1 == "aov" else level1
    matchers, asked = suite.scoring.matchers, suite.answer_format
    return PlanningRules(suite.parser, suite.settings, matchers, criterion, asked)


def _prompt(suite: Suite) -> Prompt:
    if suite.prompt != "official":
        return template_prompt(suite, FullPlanning.name)
    if suite.dataset.format != "official":
        message = "the official prompt is read from the official data set"
        hint = "set dataset.format to official and dataset.path to its checkout"
        raise SpecError(Problem(str(suite.files.path), message, "prompt", "official", hint=hint))
    return OfficialPrompt(official_prompt(suite.files.dataset))


def _check_composites(dataset: Dataset, tasks: Sequence[AssemblyTask]) -> None:
    """Raise DataError when the data set has no picture of a scene."""
    lacking = [task.key for task in tasks if task.composite is None]
    if lacking:
        message = f"has no picture of {len(lacking)} of {len(tasks)} scenes"
        found = ", ".join(lacking[:8]) + (", ..." if len(lacking) > 8 else "")
        hint = "render them: --set images.source=render"
        raise DataError(Problem(str(dataset.root), message, "images.source", found, hint=hint))
