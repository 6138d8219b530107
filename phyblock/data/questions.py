"""Reader of questions: a folder with `questions.jsonl`, one question a line, about known scenes.

`phyblock.records.question` declares the line; docs/vqa.md describes it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from phyblock.data.base import Dataset, QuestionSet, QuestionTask
from phyblock.data.raw import read_lines, read_text
from phyblock.errors import DataError, Problem
from phyblock.records.faults import validated
from phyblock.records.picture import About
from phyblock.records.question import StoredQuestion

__all__ = ["QUESTIONS_FILE", "read_questions"]

QUESTIONS_FILE = "questions.jsonl"
_FEW = 20
"""So many lines with faults are told one by one."""
_ALLOWED = f"a folder with {QUESTIONS_FILE}, or a bundled set of questions"


def read_questions(folder: Path, scenes: Dataset) -> QuestionSet:
    """All questions of a folder, about these scenes; DataError with everything that is wrong.

    Where most are about scenes of another data set, that is what is wrong.
    """
    known = {task.scene.id: task.scene for task in scenes.tasks}
    is_about: list[bool] = []

    def read_task(raw: Any, where: str) -> QuestionTask:
        about = About.named_in(raw, known)
        is_about.append(about.scene is not None)
        line = validated(StoredQuestion, raw, where, about)
        return QuestionTask(line.about(known[line.scene_id]))

    path = folder / QUESTIONS_FILE
    try:
        text = read_text(path, _ALLOWED)
        tasks = read_lines(path, text, "question", read_task, lambda task: task.key)
    except DataError as error:
        if len(is_about) < _FEW or 2 * sum(is_about) > len(is_about):
            raise
        message = "asks about scenes of another data set"
        found = f"the data set {scenes.name}"
        hint = "make questions about it, or name the data set that they are about"
        problem = Problem(str(path), message, "", found, "questions about its scenes", hint)
        raise DataError(problem) from error
    return QuestionSet(folder.name, folder, tuple(tasks))
