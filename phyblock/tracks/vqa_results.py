"""Results of questions: accuracy by subtask and its means, and the letters that are given."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from phyblock.domain import CATEGORIES, LETTERS, SUBTASK_NAMES, SUBTASKS
from phyblock.errors import DataError, Problem
from phyblock.records.manifest import MANIFEST, Manifest
from phyblock.scoring.counts import chance
from phyblock.tracks.measures import (
    OVERALL,
    WHOLE,
    Cell,
    SampleCounts,
    Way,
    read_report,
)
from phyblock.tracks.questions import AskedQuestion, ChoiceRecord, VqaSpec, open_questions

if TYPE_CHECKING:
    from phyblock.config.suite import Suite
    from phyblock.data import Dataset
    from phyblock.records.record import Record

CATEGORY_NAMES = {
    "object_property": "Property",
    "object_relationship": "Relationship",
    "scene_understanding": "Scene",
    "dynamic_reasoning": "Dynamics",
}
_LETTER_COUNTS = [(kind, letter) for letter in LETTERS for kind in ("right", "given")]


def _cells(asked: Container[str]) -> tuple[Cell, ...]:
    """Return the subtasks of each category and their mean, as in Table 2, then the mean of all."""
    cells: list[Cell] = []
    for category, subtasks in CATEGORIES.items():
        heading = CATEGORY_NAMES[category]
        if names := tuple(name for name in subtasks if name in asked):
            cells += [Cell(name, name, heading) for name in names]
            cells.append(Cell(category, heading, heading, names))
    means = tuple(cell.name for cell in cells if cell.of)
    return (*cells, Cell(OVERALL, WHOLE.heading, of=means))


ALL_CELLS = _cells(SUBTASKS)
"""The cells of a run that asks everything."""


def _run_cells(suite: Suite, manifest: Manifest) -> tuple[Cell, ...]:
    """Return the cells of the subtasks that were asked."""
    asked = manifest.tracks.get("vqa", {}).get("by_subtask", {})
    return _cells(asked or suite.section(VqaSpec).subtasks)


def _answers(record: ChoiceRecord) -> Iterator[tuple[Way, tuple[int, int]]]:
    given = record.answer
    yield ("", "", ""), (given is not None and given.given == given.right, 1)


def _letters(record: ChoiceRecord) -> Iterator[tuple[Way, tuple[int, ...]]]:
    """Count answers with one right letter, which ordering has not."""
    if (answer := record.answer) is not None and len(answer.right) == 1:
        letters = (getattr(answer, kind) == letter for kind, letter in _LETTER_COUNTS)
        yield ("", "", ""), (*letters, 1)


_ALIKE = ("suite.vqa.circular", "tracks.vqa.questions")
_COLUMNS = tuple(f"{kind}_{letter.lower()}" for kind, letter in _LETTER_COUNTS)
COUNTS = (
    SampleCounts(
        "answer",
        ("correct", "n"),
        rows=_answers,
        parts=lambda suite: suite.section(VqaSpec).rotations,
        alike=_ALIKE,
    ),
    SampleCounts("rotations", ("correct", "n"), rows=_answers, alike=_ALIKE),
    SampleCounts("letters", (*_COLUMNS, "n"), rows=_letters, cells=(WHOLE,), alike=_ALIKE),
)


def _guessing(suite: Suite, cell: str) -> float:
    """Return the expected accuracy of uniform guesses in a subtask."""
    subtask = next(name for name in SUBTASKS if name == cell)
    return chance(subtask) ** suite.section(VqaSpec).rotations


def question_items(
    folder: Path, manifest: Manifest, dataset: Dataset
) -> Callable[[Record], AskedQuestion | None]:
    """Return the questions of a run; DataError where they are not what it was made on."""
    recorded = manifest.questions
    if recorded is None:
        raise DataError(Problem(str(folder / MANIFEST), "names no questions", "questions"))
    questions = open_questions(recorded.format, Path(recorded.root), dataset)
    if questions.sha256 != manifest.tracks.get("vqa", {}).get("questions"):
        message = "is not the data set that the run was made on, or it was changed since"
        raise DataError(Problem(str(questions.root), message, "sha256", questions.sha256))
    by_id = {task.question.id: task for task in questions.tasks}

    def asked(record: Record) -> AskedQuestion | None:
        if not isinstance(record, ChoiceRecord) or record.question.id not in by_id:
            return None
        return AskedQuestion(by_id[record.question.id], record.question.rotation)

    return asked


REPORT = read_report(
    "vqa",
    COUNTS,
    {"accuracy": {"chance": _guessing}},
    cells=_run_cells,
    floors=("majority", "text-only", "random"),
    part_names={str(short): name for short, name in SUBTASK_NAMES.items()},
    items=question_items,
)
