"""Questions as the page of a report shows and draws them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from phyblock.data import Dataset, QuestionTask
from phyblock.domain import Question, QuestionPicture
from phyblock.errors import DataError, Problem
from phyblock.records import MANIFEST, Record
from phyblock.sim.pictures import PictureStyle
from phyblock.tables.load import Run
from phyblock.tables.track_report import PageItems
from phyblock.tracks.drawable import block_entry, rounded
from phyblock.tracks.vqa.answers import question_digest, showing
from phyblock.tracks.vqa.opening import open_questions
from phyblock.tracks.vqa.pictures import QuestionPictures, ShownQuestion
from phyblock.tracks.vqa.record import ChoiceRecord
from phyblock.tracks.vqa.track import AskedQuestion

__all__ = ["question_items"]

_CHANGED = "is not the data set that the run was made on, or it was changed since"


def question_items(run: Run, dataset: Dataset) -> PageItems:
    """The questions of a run; DataError where they are not what it was made on."""
    recorded, shown = run.manifest.questions, showing(run)
    if recorded is None:
        raise DataError(Problem(str(run.path / MANIFEST), "names no questions", "questions"))
    questions = open_questions(recorded.format, Path(recorded.root), dataset)
    if questions.sha256 != question_digest(run):
        raise DataError(Problem(str(questions.root), _CHANGED, "sha256", questions.sha256))
    by_id = {task.question.id: task for task in questions.tasks}

    def pictures(folder: Path, style: PictureStyle) -> QuestionPictures:
        # Null is each question's own, which no style can say.
        ground = run.manifest.suite["images"]["background"] and style.background
        return QuestionPictures(folder, style, shown.options_as, 1, ground)

    return PageItems(lambda record: _shown(record, by_id), _entry, pictures)


def _shown(record: Record, questions: Mapping[str, QuestionTask]) -> ShownQuestion | None:
    if not isinstance(record, ChoiceRecord) or record.question.id not in questions:
        return None
    return AskedQuestion(questions[record.question.id], record.question.rotation).shown


def _entry(shown: ShownQuestion) -> dict[str, Any]:
    return question_entry(shown.question)


def question_entry(question: Question) -> dict[str, Any]:
    """A question with the recipes of its pictures."""
    return {
        "id": question.id,
        "subtask": question.subtask,
        "text": question.text,
        "options": list(question.options),
        "answer": question.answer_letters,
        "pictures": [_picture(picture) for picture in question.pictures],
        "evidence": dict(question.evidence),
    }


def _picture(picture: QuestionPicture) -> dict[str, Any]:
    return {
        "label": picture.label,
        "view": list(picture.view_deg),
        "blocks": [block_entry(block) for block in picture.blocks],
        "framed": [block_entry(block) for block in picture.framed],
        "marks": [
            {"letter": mark.letter, "position": rounded(mark.position_m)} for mark in picture.marks
        ],
    }
