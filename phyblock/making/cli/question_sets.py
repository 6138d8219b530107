"""Finding the questions that a person means, and the options that say which they are."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.cli.paths import NAME_OR_PATH
from phyblock.datasets import QuestionSet, read_questions
from phyblock.datasets.named import find_questions, read_data_set
from phyblock.domain import Question

__all__ = [
    "data_option",
    "questions_argument",
    "questions_option",
    "read_question_set",
    "read_unseen",
    "size_option",
    "unseen_data_option",
    "unseen_option",
]

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
unseen_option = click.option(
    "--unseen",
    type=NAME_OR_PATH,
    metavar="PATH",
    help="Another set of questions, of another seed: a text probe learns from it alone.",
)
unseen_data_option = click.option(
    "--unseen-data",
    type=NAME_OR_PATH,
    metavar="PATH",
    help="The scenes that those are about, unless they are those of --data.",
)


def read_unseen(unseen: str | None, scenes: str, mine: Path) -> list[Question]:
    """The questions of another set than `mine`, or none; BadParameter where it is that set."""
    if unseen is None:
        return []
    other = read_question_set(unseen, scenes)
    if other.root.resolve() == mine.resolve():
        raise click.BadParameter(f"{unseen} is the set itself", param_hint="--unseen")
    return [task.question for task in other.tasks]


def read_question_set(name: str, scenes: str = _SCENES) -> QuestionSet:
    """The questions that `name` means, about the scenes of the data set that `scenes` means.

    Raises DataError with everything that is wrong in either.
    """
    return read_questions(find_questions(name), read_data_set(scenes))
