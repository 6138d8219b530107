"""`phyblock validate`: suites, models files and data sets, checked without running anything."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Mapping
from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath, models_file_option
from phyblock.config.models import RECORDED, ModelConfig, load_models
from phyblock.config.suite import load_suite, suite_model
from phyblock.data import SCENES_FILE, Dataset, read_builtin, read_official
from phyblock.errors import InputError, Problem, SpecError
from phyblock.files import read_bytes
from phyblock.resources import bundled
from phyblock.run.models import model_problems
from phyblock.run.plan import make_plan
from phyblock.run.preflight import asking_remarks, find_models_file, find_suite, prompt_dirs
from phyblock.text import counted

__all__ = ["command"]

# A models file has model names at its top level, a suite has these.
_SUITE_KEY = re.compile(rf"^(?:{'|'.join(suite_model().model_fields)})[ \t]*:", re.MULTILINE)
# Keys that scenes have and neither suites nor models, in YAML and in JSON.
_SCENE_KEYS = tuple(
    re.compile(rf"""(?:^|[\s{{,"'-]){key}["']?[ \t]*:[ \t]*(?:[\[#]|$)""", re.MULTILINE)
    for key in ("blocks", "position")
)


@click.command("validate")
@click.argument("files", nargs=-1, required=True, type=UserPath())
@click.option(
    "--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a value of the suites."
)
@models_file_option
def command(files: tuple[Path, ...], sets: tuple[str, ...], models_file: str | None) -> None:
    """Check FILES: suites (or names of bundled ones) and models files, data set folders, official
    checkouts.

    Shows all problems of all files, and exits with 2 when there are any.
    """
    console = make_console()
    problems: list[Problem] = []
    for path in files:
        try:
            summary, *remarks = _check(path, sets, models_file)
        except InputError as error:
            problems += error.problems
        else:
            console.print(f"{shown_path(path)}: {summary}", markup=False, soft_wrap=True)
            for remark in remarks:
                console.print(f"  {remark}", markup=False, soft_wrap=True)
    if problems:
        raise InputError(problems)


def _check(path: Path, sets: tuple[str, ...], models_file: str | None) -> list[str]:
    """What a sound file is, and what else is to be said of it."""
    if os.path.isdir(path):
        is_builtin = os.path.lexists(path / SCENES_FILE)
        return [_about(read_builtin(path) if is_builtin else read_official(path))]
    if path.name == SCENES_FILE:
        return [_about(read_builtin(path.parent))]
    path = find_suite(str(path))
    try:
        return _check_written(path, sets, models_file)
    except SpecError as error:
        if not _holds_scenes(path):
            raise
        message, allowed = "holds scenes", "a suite, a models file, or the folder of a data set"
        hint = f"`phyblock scenes complete {shown_path(path)}` makes a data set of them"
        raise SpecError(Problem(str(path), message, allowed=allowed, hint=hint)) from error


def _check_written(path: Path, sets: tuple[str, ...], models_file: str | None) -> list[str]:
    """What a sound suite or models file is."""
    if not _has_keys(path, _SUITE_KEY):
        known = load_models(path)
        _check_models(path, known, known)
        if not known:
            allowed = "a suite, or a models file with name: provider/model lines"
            raise SpecError(Problem(str(path), "names nothing", allowed=allowed))
        return [f"models file, {counted(len(known), 'model')}"]
    data, prompts = bundled("benchmarks", "data"), prompt_dirs(path)
    suite = load_suite(path, sets, data_dir=data, prompt_dirs=prompts)
    named = find_models_file(models_file, path)
    known = load_models(named)
    if suite.models != RECORDED:
        _check_models(named, known, suite.models)
    plan = make_plan(suite, known)
    calls = plan.samples_per_model
    models = counted(len(plan.models), "model")
    summary = f"suite {plan.suite.name}, {models}, {counted(calls, 'sample')} a model"
    return [summary, *asking_remarks(suite, plan)]


def _check_models(path: Path, known: Mapping[str, ModelConfig], names: Collection[str]) -> None:
    if problems := list(model_problems(path, known, names)):
        raise SpecError(problems)


def _holds_scenes(path: Path) -> bool:
    return _has_keys(path, *_SCENE_KEYS)


def _has_keys(path: Path, *keys: re.Pattern[str]) -> bool:
    """Whether a file has such keys; False for what cannot be read, whose reader says why."""
    try:
        text = read_bytes(path).decode(errors="replace")
    except (OSError, ValueError):
        return False
    return all(key.search(text) for key in keys)


def _about(dataset: Dataset) -> str:
    by_level = ", ".join(
        f"{sum(level in task.scene.levels for task in dataset.tasks)} of level {level}"
        for level in sorted({n for task in dataset.tasks for n in task.scene.levels})
    )
    return f"data set {dataset.name}, {counted(len(dataset.tasks), 'scene')} ({by_level})"
