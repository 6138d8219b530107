"""Options that verbs share, the sets that a person means, and progress."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeVar, cast

import click
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from phyblock.cli.console import make_console
from phyblock.cli.options import NAME_OR_PATH
from phyblock.data import (
    AssemblyTask,
    Dataset,
    QuestionSet,
    find_questions,
    read_data_set,
    read_questions,
)
from phyblock.domain import SUBTASKS, Subtask
from phyblock.errors import DataError, Problem
from phyblock.sim.engine import other_engine
from phyblock.text import did_you_mean

T = TypeVar("T")
Command = TypeVar("Command", bound=Callable[..., Any])
_LINE_EVERY = 25

jobs_option = click.option(
    *("--jobs", "-j"),
    type=click.IntRange(1, 256),
    default=os.cpu_count() or 1,
    show_default="all processors",
    metavar="N",
    help="Processes.",
)
ray_option = click.option(
    *("--ray", "ray_address"),
    metavar="ADDRESS",
    help="Work on this Ray cluster; local: on one of N workers here.",
)


def seed_option(about: str) -> Callable[[Command], Command]:
    """The option of a seed; `about` says what another one gives."""
    return click.option(
        "--seed", type=click.IntRange(0), default=0, show_default=True, metavar="S", help=about
    )


def tracked(items: Iterable[T], total: int, doing: str, noun: str = "scenes") -> Iterator[T]:
    """The items; a progress bar on a terminal, a line now and then elsewhere, on standard error."""
    console = make_console(stderr=True)
    columns = (TextColumn(doing), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    hidden = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as progress:
        bar = progress.add_task("", total=total)
        for count, item in enumerate(items, 1):
            progress.advance(bar)
            if hidden and count % _LINE_EVERY == 0:
                console.print(f"{count} of {total} {noun}")
            yield item


def tell_simulators() -> None:
    """Say on standard error where a set is not what the default simulators make of its seed."""
    if other := other_engine():
        click.echo(
            f"made with {other}: the default one may make another set of the same seed", err=True
        )


def _subtasks(ctx: click.Context, param: click.Parameter, value: str) -> tuple[Subtask, ...]:
    words = SUBTASKS if value == "all" else tuple(value.upper().split(","))
    unknown = [word for word in words if word not in SUBTASKS]
    if unknown or len(set(words)) < len(words):
        known = ",".join(SUBTASKS)
        raise click.BadParameter(f"{value!r}: give all, or some of {known}", ctx, param)
    return cast(tuple[Subtask, ...], words)


subtasks_option = click.option(
    "--subtasks",
    default="all",
    show_default=True,
    callback=_subtasks,
    metavar="NAMES",
    help="Subtasks like SH,CO,VP.",
)


_QUESTIONS = "phyblock-vqa"
_SCENES = "phyblock-400"

questions_argument = click.argument(
    "questions", metavar="[PATH]", default=_QUESTIONS, type=NAME_OR_PATH
)
questions_option = click.option(
    "--questions",
    default=_QUESTIONS,
    type=NAME_OR_PATH,
    show_default=True,
    metavar="PATH",
    help="A folder with questions, or a bundled set.",
)
data_option = click.option(
    "--data",
    default=_SCENES,
    type=NAME_OR_PATH,
    show_default=True,
    metavar="PATH",
    help="The scenes that the questions are about: a folder or a bundled set.",
)
size_option = click.option(
    "--size",
    type=click.IntRange(128, 2048),
    default=512,
    show_default=True,
    metavar="PX",
    help="Side of each picture.",
)


def read_question_set(name: str, scenes: str = _SCENES) -> QuestionSet:
    """The questions that `name` means, about the scenes of the data set that `scenes` means.

    Raises DataError with everything that is wrong in either.
    """
    return read_questions(find_questions(name), read_data_set(scenes))


def find_scenes(data: Dataset, names: Sequence[str]) -> tuple[AssemblyTask, ...]:
    """The named scenes, in the order named; raises DataError with all that are not there."""
    tasks = {task.scene.id: task for task in data.tasks}
    problems = []
    for name in names:
        if name not in tasks:
            known = list(tasks)
            few = known if len(known) <= 6 else [*known[:3], "...", known[-1]]
            hint = did_you_mean(name, tasks) or f"it holds {', '.join(few)}"
            problems.append(Problem(str(data.root), "holds no such scene", "", name, hint=hint))
    if problems:
        raise DataError(problems)
    return tuple(tasks[name] for name in names)
