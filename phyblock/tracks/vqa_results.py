"""Measures of questions: accuracy by subtask and its means, and the letters that are given."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from phyblock.domain import CATEGORIES, LETTERS, SUBTASK_NAMES, SUBTASKS, Question, QuestionPicture
from phyblock.errors import DataError, Problem, SpecError
from phyblock.records.manifest import MANIFEST
from phyblock.scoring.counts import chance, ratio_of
from phyblock.stable import plain_sum
from phyblock.tracks.measures import (
    CELL,
    SCORED_BY,
    WHOLE,
    Cell,
    HeadlineColumn,
    Measure,
    PageItems,
    SampleCounts,
    TrackReport,
    share,
)
from phyblock.tracks.pictures import Workshop, block_entry, rounded
from phyblock.tracks.questions import (
    QUESTION_EXPORT,
    AskedQuestion,
    ChoiceRecord,
    QuestionPictures,
    VqaSpec,
    open_questions,
)

if TYPE_CHECKING:
    import pandas as pd

    from phyblock.data import Dataset, QuestionTask
    from phyblock.records.record import Record
    from phyblock.results.load import Run
    from phyblock.sim.pictures import PictureStyle

NAME = "vqa"
CATEGORY_NAMES = {
    "object_property": "Property",
    "object_relationship": "Relationship",
    "scene_understanding": "Scene",
    "dynamic_reasoning": "Dynamics",
}
_QUESTION = ["question", "seed", "variant"]


def _cells(asked: Container[str]) -> tuple[Cell, ...]:
    """Return the subtasks of each category and their mean, as in Table 2, then the mean of all."""
    parts = {
        category: tuple(name for name in subtasks if name in asked)
        for category, subtasks in CATEGORIES.items()
    }
    parts = {category: names for category, names in parts.items() if names}
    cells: list[Cell] = []
    for category, names in parts.items():
        heading = CATEGORY_NAMES[category]
        cells += [Cell(name, name, heading) for name in names]
        cells.append(Cell(category, heading, heading, names))
    return (*cells, Cell(WHOLE.name, WHOLE.heading, "", tuple(parts)))


ALL_CELLS = _cells(SUBTASKS)
"""The cells of a run that asks everything."""


def _run_cells(run: Run) -> tuple[Cell, ...]:
    """Cells of the subtasks that were asked."""
    asked = run.manifest.tracks.get(NAME, {}).get("by_subtask", {})
    return _cells(asked or set(run.records["subtask"].dropna()))


def _in_cells(rows: pd.DataFrame, run: Run) -> pd.DataFrame:
    subtasks = run.records.set_index("sample")["subtask"]
    return rows.assign(**{CELL: rows["sample"].map(subtasks)})


def _answers(run: Run) -> pd.DataFrame:
    """Every shown order of options for itself; a question left out goes with all its rotations."""
    rows = run.records[run.records["track"] == NAME]
    rows = rows.assign(left_out=rows["outcome"].isin(run.design.outcomes_left_out))
    if rows["left_out"].any():
        left_out = rows.groupby(["model", *_QUESTION])["left_out"].transform("any")
        rows = rows[~left_out.astype(bool)]
    letters = {f"{kind}_{letter.lower()}": (kind, letter)
               for letter in LETTERS for kind in ("right", "given")}  # fmt: skip
    return rows.assign(
        **dict.fromkeys(SCORED_BY, ""),
        **{CELL: rows["subtask"], "item": rows["question"]},
        **{
            name: (rows[kind] == letter).astype("int64") for name, (kind, letter) in letters.items()
        },
        replied=run.replied(rows),
        correct=rows["given"].eq(rows["right"]).fillna(False).astype("int64"),
        n=1,
    )


def _questions(run: Run) -> pd.DataFrame:
    """A row a question; with rotations it is right only if each of them is."""
    answers = _answers(run)
    keys = ["model", CELL, "scene", *_QUESTION]
    asked = answers.groupby(keys, sort=True).agg({"correct": "sum", "replied": "any"}).reset_index()
    replied = asked.groupby(["model", CELL])["replied"].transform("any").astype(bool)
    asked = asked[replied]
    correct = (asked["correct"] == run.design.suite.section(VqaSpec).rotations).astype("int64")
    about: dict[str, Any] = {
        **dict.fromkeys(SCORED_BY, ""),
        "item": asked["question"],
        "replied": True,
        "n": 1,
    }
    return asked.assign(**about, correct=correct)


def _lettered(run: Run) -> pd.DataFrame:
    """Answers with one right letter, which ordering has not."""
    rows = _answers(run)
    return rows[rows["right"].str.len() == 1].assign(**{CELL: WHOLE.name})


def guessing(run: Run, cell: str) -> float:
    """Return the expected accuracy of uniform guesses in a cell that was asked."""
    subtask = next((name for name in SUBTASKS if name == cell), None)
    if subtask is not None:
        return chance(subtask) ** run.design.suite.section(VqaSpec).rotations
    (names,) = (other.of for other in _run_cells(run) if other.name == cell)
    return plain_sum(guessing(run, name) for name in names) / len(names)


_LETTERS = SampleCounts(
    "letters",
    (*(f"{kind}_{letter.lower()}" for letter in LETTERS for kind in ("right", "given")), "n"),
    _lettered,
    cells=(WHOLE,),
)
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
        share(_LETTERS, f"{kind}_{letter.lower()}", "n", f"{letter} {kind}", over="answers",
              meaning=f"answers that {about} {letter}, ordering left out")
        for letter in LETTERS for kind, about in (("right", "should be"), ("given", "are"))
    ),
)  # fmt: skip

_COLUMNS = (
    *(HeadlineColumn("accuracy", name, CATEGORY_NAMES[name]) for name in CATEGORIES),
    HeadlineColumn("accuracy", WHOLE.name, WHOLE.heading),
)


def _notes(run: Run) -> Sequence[str]:
    circular = (
        " A question counts as right only if every rotation of its options was answered right."
        if run.design.suite.section(VqaSpec).circular
        else ""
    )
    return (
        "Accuracy in percent. A category is the unweighted mean of its subtasks, overall that of "
        f"the categories, as far as they were asked.{circular}",
    )


def _showing(run: Run) -> tuple[str, ...]:
    shown = run.design.suite.section(VqaSpec)
    circular = ("circular",) if shown.circular else ()
    letters = ("options on one sheet",) if shown.options_as == "letters" else ()
    return (*circular, *run.controls(NAME), *letters)


def _question_digest(run: Run) -> str | None:
    """Digest of the set that the run's questions were chosen from; None where it is not told."""
    return run.manifest.tracks.get(NAME, {}).get("questions")


def _check_alike(run: Run, first: Run, _: Sequence[str], __: Measure) -> None:
    circular = [one.design.suite.section(VqaSpec).circular for one in (run, first)]
    if circular[0] != circular[1]:
        found, allowed = (str(one).lower() for one in circular)
        message = f"counts right answers in another way than {first.path}"
        raise SpecError(Problem(str(run.path), message, "vqa.circular", found, allowed))
    sets = [_question_digest(one) for one in (run, first)]
    if sets[0] != sets[1]:
        message = f"asked questions of another set than {first.path}"
        raise SpecError(Problem(str(run.path), message, "questions", str(sets[0]), str(sets[1])))


def question_items(run: Run, dataset: Dataset) -> PageItems:
    """Return the questions of a run; DataError where they are not what it was made on."""
    recorded, shown = run.manifest.questions, run.design.suite.section(VqaSpec)
    if recorded is None:
        raise DataError(Problem(str(run.path / MANIFEST), "names no questions", "questions"))
    questions = open_questions(recorded.format, Path(recorded.root), dataset)
    if questions.sha256 != _question_digest(run):
        message = "is not the data set that the run was made on, or it was changed since"
        raise DataError(Problem(str(questions.root), message, "sha256", questions.sha256))
    by_id = {task.question.id: task for task in questions.tasks}

    def pictures(folder: Path, style: PictureStyle) -> QuestionPictures:
        # Null is each question's own, which no style can say.
        ground = run.manifest.suite["images"]["background"] and style.background
        return QuestionPictures(Workshop(1, folder), style, shown.options_as, ground)

    return PageItems(lambda record: _shown(record, by_id), _entry, pictures)


def _shown(record: Record, questions: Mapping[str, QuestionTask]) -> AskedQuestion | None:
    if not isinstance(record, ChoiceRecord) or record.question.id not in questions:
        return None
    return AskedQuestion(questions[record.question.id], record.question.rotation)


def _entry(shown: AskedQuestion) -> dict[str, Any]:
    return question_entry(shown.question)


def question_entry(question: Question) -> dict[str, Any]:
    """Return a question with the recipes of its pictures, as pages take it."""
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
    export=QUESTION_EXPORT,
)
