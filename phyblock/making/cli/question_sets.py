"""Finding the questions that a person means, and the options that say which they are."""

from __future__ import annotations

import click

from phyblock.cli.options import NAME_OR_PATH
from phyblock.data import QuestionSet, find_questions, read_data_set, read_questions

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
