"""Finding the questions that a person means."""

from __future__ import annotations

from pathlib import Path

from phyblock.cli.scenes_data import read_data_set
from phyblock.datasets import QUESTIONS_FILE, QuestionSet, read_questions
from phyblock.errors import DataError, Problem
from phyblock.resources import bundled

__all__ = ["DEFAULT_QUESTIONS", "DEFAULT_SCENES", "find_questions", "read_question_set"]

DEFAULT_QUESTIONS = "phyblock-vqa"
DEFAULT_SCENES = "phyblock-400"


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
    found = bundled("benchmarks", "data").glob(f"*/{QUESTIONS_FILE}")
    names = ", ".join(sorted(one.parent.name for one in found))
    allowed = f"a folder with {QUESTIONS_FILE}, or a bundled set: {names}"
    raise DataError(Problem(name, "there are no such questions", allowed=allowed))


def read_question_set(name: str, scenes: str = DEFAULT_SCENES) -> QuestionSet:
    """The questions that `name` means, about the scenes of the data set that `scenes` means.

    Raises DataError with everything that is wrong in either.
    """
    return read_questions(find_questions(name), read_data_set(scenes))
