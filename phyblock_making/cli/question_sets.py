"""Finding the questions that a person means, and the options that say which they are."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.cli.paths import NAME_OR_PATH
from phyblock.datasets import QUESTIONS_FILE, QuestionSet, read_questions
from phyblock.errors import DataError, Problem
from phyblock.resources import bundled, bundled_sets
from phyblock_making.cli.scene_sets import read_data_set

__all__ = [
    "data_option",
    "find_questions",
    "questions_argument",
    "questions_option",
    "read_question_set",
    "size_option",
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


def find_questions(name: str) -> Path:
    """The folder that `name` means: one with questions, or the name of a bundled set.

    Raises DataError that lists the bundled sets when there is no such folder.
    """
    path = Path(name)
    if path.is_dir():
        return path
    if path.name == QUESTIONS_FILE and path.is_file():
        return path.parent
    if len(path.parts) == 1 and bundled("benchmarks", "data", name, QUESTIONS_FILE).is_file():
        return bundled("benchmarks", "data", name)
    names = ", ".join(bundled_sets(QUESTIONS_FILE))
    allowed = f"a folder with {QUESTIONS_FILE}, or a bundled set: {names}"
    raise DataError(Problem(name, "there are no such questions", allowed=allowed))


def read_question_set(name: str, scenes: str = _SCENES) -> QuestionSet:
    """The questions that `name` means, about the scenes of the data set that `scenes` means.

    Raises DataError with everything that is wrong in either.
    """
    return read_questions(find_questions(name), read_data_set(scenes))
