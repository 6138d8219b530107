"""Reader of questions: a folder with `questions.jsonl`, one question a line, about known scenes.

`phyblock.records.question` declares the line; docs/vqa.md describes it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from phyblock.datasets.base import Dataset, QuestionSet, QuestionTask
from phyblock.datasets.raw import read_lines
from phyblock.records.faults import validated
from phyblock.records.picture import About
from phyblock.records.question import StoredQuestion

__all__ = ["QUESTIONS_FILE", "read_questions"]

QUESTIONS_FILE = "questions.jsonl"
_ALLOWED = f"a folder with {QUESTIONS_FILE}, or a bundled set of questions"


def read_questions(folder: Path, scenes: Dataset) -> QuestionSet:
    """All questions of a folder, about these scenes; DataError with everything that is wrong."""
    known = {task.scene.id: task.scene for task in scenes.tasks}

    def read_task(raw: Any, where: str) -> QuestionTask:
        line = validated(StoredQuestion, raw, where, About.named_in(raw, known))
        return QuestionTask(line.about(known[line.scene_id]))

    path = folder / QUESTIONS_FILE
    tasks = read_lines(path, "question", _ALLOWED, read_task, lambda task: task.key)
    return QuestionSet(folder.name, folder, tuple(tasks))
