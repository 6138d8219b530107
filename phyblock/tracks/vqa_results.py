"""Measures of questions: accuracy by subtask and its means, and the letters that are given."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from phyblock.domain import CATEGORIES, LETTERS, SUBTASK_NAMES, SUBTASKS
from phyblock.errors import DataError, Problem, SpecError
from phyblock.records.manifest import MANIFEST
from phyblock.scoring.counts import chance, ratio_of
from phyblock.stable import plain_sum
from phyblock.tracks.measures import (
    WHOLE,
    Cell,
    HeadlineColumn,
    Measure,
    SampleCounts,
    TrackReport,
    share,
)
from phyblock.tracks.questions import (
    AskedQuestion,
    ChoiceRecord,
    VqaSpec,
    open_questions,
)
from phyblock.types import WITHOUT_REPLY

if TYPE_CHECKING:
    import pandas as pd

    from phyblock.data import Dataset
    from phyblock.records.record import Record
    from phyblock.results.load import Run

NAME = "vqa"
CATEGORY_NAMES = {
    "object_property": "Property",
    "object_relationship": "Relationship",
    "scene_understanding": "Scene",
    "dynamic_reasoning": "Dynamics",
}
_LETTER_COUNTS = {
    f"{kind}_{letter.lower()}": (kind, letter) for letter in LETTERS for kind in ("right", "given")
}


def _cells(asked: Container[str]) -> tuple[Cell, ...]:
    """Return the subtasks of each category and their mean, as in Table 2, then the mean of all."""
    cells: list[Cell] = []
    for category, subtasks in CATEGORIES.items():
        heading = CATEGORY_NAMES[category]
        if names := tuple(name for name in subtasks if name in asked):
            cells += [Cell(name, name, heading) for name in names]
            cells.append(Cell(category, heading, heading, names))
    means = tuple(cell.name for cell in cells if cell.of)
    return (*cells, Cell(WHOLE.name, WHOLE.heading, "", means))


ALL_CELLS = _cells(SUBTASKS)
"""The cells of a run that asks everything."""


def _spec(run: Run) -> VqaSpec:
    return run.design.suite.section(VqaSpec)


def _run_cells(run: Run) -> tuple[Cell, ...]:
    """Return the cells of the subtasks that were asked."""
    asked = run.manifest.tracks.get(NAME, {}).get("by_subtask", {})
    return _cells(asked or set(run.records["subtask"].dropna()))


def _in_cells(rows: pd.DataFrame, run: Run) -> Mapping[str, NDArray[np.bool_]]:
    asked = run.records.loc[rows["row"], "subtask"].to_numpy()
    return {cell.name: asked == cell.name for cell in _run_cells(run) if not cell.of}


def _answers(run: Run) -> pd.DataFrame:
    """Every shown order of options for itself; a question left out goes with all its rotations."""
    rows = run.records[run.records["track"] == NAME]
    rows = rows.assign(left_out=rows["outcome"].isin(run.design.outcomes_left_out))
    left_out = rows.groupby(["model", "question", "seed", "variant"])["left_out"].transform("any")
    rows = rows[~left_out.astype(bool)]
    letters = {
        name: (rows[kind] == letter).astype("int64")
        for name, (kind, letter) in _LETTER_COUNTS.items()
    }
    correct = rows["given"].eq(rows["right"]).fillna(False).astype("int64")
    return rows.assign(**letters, row=rows.index, correct=correct, n=1)


def _questions(run: Run) -> pd.DataFrame:
    """A row a question; with rotations it is right only if each of them is."""
    asked = _answers(run)
    replied = ~asked["outcome"].isin(WITHOUT_REPLY)
    parts = [asked["model"], asked["subtask"]]
    asked = asked[replied.groupby(parts).transform("any").astype(bool)]
    # The row of a question is that of a rotation with a reply, where one has it.
    asked = asked.loc[replied[asked.index].sort_values(ascending=False, kind="stable").index]
    keys = ["model", "subtask", "scene", "question", "seed", "variant"]
    rows = asked.groupby(keys, sort=True).agg({"row": "first", "correct": "sum"}).reset_index()
    rows["item"] = rows["question"]
    return rows.assign(n=1, correct=(rows["correct"] == _spec(run).rotations).astype("int64"))


def _lettered(run: Run) -> pd.DataFrame:
    """Answers with one right letter, which ordering has not."""
    rows = _answers(run)
    return rows[rows["right"].str.len() == 1]


def guessing(run: Run, cell: str) -> float:
    """Return the expected accuracy of uniform guesses in a cell that was asked."""
    subtask = next((name for name in SUBTASKS if name == cell), None)
    if subtask is not None:
        return chance(subtask) ** _spec(run).rotations
    (names,) = (other.of for other in _run_cells(run) if other.name == cell)
    return plain_sum(guessing(run, name) for name in names) / len(names)


_LETTERS = SampleCounts("letters", (*_LETTER_COUNTS, "n"), _lettered, cells=(WHOLE,))
_ABOUT = {"right": "should be", "given": "are"}
VQA_MEASURES = (
    Measure(
        "accuracy", "Accuracy", SampleCounts("answer", ("correct", "n"), _questions), ratio_of,
        "questions that were answered right; under circular evaluation in every rotation",
        over="questions", chance=guessing, floors=("majority", "text-only", "random"),
    ),
    Measure(
        "each_rotation", "Each rotation", SampleCounts("rotations", ("correct", "n"), _answers),
        ratio_of, "answers that were right, every rotation of a question counted for itself",
        over="answers",
    ),
    *(
        share(_LETTERS, name, "n", f"{letter} {kind}", over="answers",
              meaning=f"answers that {_ABOUT[kind]} {letter}, ordering left out")
        for name, (kind, letter) in _LETTER_COUNTS.items()
    ),
)  # fmt: skip
_COLUMNS = (
    *(HeadlineColumn("accuracy", name, CATEGORY_NAMES[name]) for name in CATEGORIES),
    HeadlineColumn("accuracy", WHOLE.name, WHOLE.heading),
)


def _notes(run: Run) -> Sequence[str]:
    note = "Accuracy in percent. A category is the unweighted mean of its subtasks, overall that "
    note += "of the categories, as far as they were asked."
    if _spec(run).circular:
        note += " A question counts as right only if every rotation of its options was answered "
        note += "right."
    return (note,)


def _showing(run: Run) -> tuple[str, ...]:
    shown = _spec(run)
    circular = ("circular",) if shown.circular else ()
    letters = ("options on one sheet",) if shown.options_as == "letters" else ()
    return (*circular, *run.controls(NAME), *letters)


def _check_alike(run: Run, first: Run, _: Sequence[str], __: Measure) -> None:
    """Raise SpecError where two runs rotate options otherwise, or ask of other question sets."""
    rotates, like = (str(_spec(one).circular).lower() for one in (run, first))
    asked, of = (str(_question_digest(one)) for one in (run, first))
    for message, field, found, allowed in (
        ("counts right answers in another way than", "vqa.circular", rotates, like),
        ("asked questions of another set than", "questions", asked, of),
    ):
        if found != allowed:
            raise SpecError(
                Problem(str(run.path), f"{message} {first.path}", field, found, allowed)
            )


def _question_digest(run: Run) -> str | None:
    """Return the digest of the set that the questions were chosen from; None: it is not told."""
    return run.manifest.tracks.get(NAME, {}).get("questions")


def question_items(run: Run, dataset: Dataset) -> Callable[[Record], AskedQuestion | None]:
    """Return the questions of a run; DataError where they are not what it was made on."""
    recorded = run.manifest.questions
    if recorded is None:
        raise DataError(Problem(str(run.path / MANIFEST), "names no questions", "questions"))
    questions = open_questions(recorded.format, Path(recorded.root), dataset)
    if questions.sha256 != _question_digest(run):
        message = "is not the data set that the run was made on, or it was changed since"
        raise DataError(Problem(str(questions.root), message, "sha256", questions.sha256))
    by_id = {task.question.id: task for task in questions.tasks}

    def asked(record: Record) -> AskedQuestion | None:
        if not isinstance(record, ChoiceRecord) or record.question.id not in by_id:
            return None
        return AskedQuestion(by_id[record.question.id], record.question.rotation)

    return asked


REPORT = TrackReport(
    measures=VQA_MEASURES,
    cells=_run_cells,
    in_cells=_in_cells,
    headline=lambda _: _COLUMNS,
    notes=_notes,
    check_alike=_check_alike,
    showing=_showing,
    part_names={str(short): name for short, name in SUBTASK_NAMES.items()},
    items=question_items,
)
