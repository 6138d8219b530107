"""What questions measure: accuracy by subtask, and its means (paper section 3.3)."""

from __future__ import annotations

from collections.abc import Container

import pandas as pd

from phyblock.domain import CATEGORIES, SUBTASKS
from phyblock.scoring.counts import chance, ratio_of
from phyblock.stable import plain_sum
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, SCORED_BY, Cell, Measure, SampleCounts
from phyblock.tables.outcomes import has_reply
from phyblock.tracks.vqa.answers import (
    OVERALL_CELL,
    expected_answers,
    questions_counted,
    scored_answers,
    showing,
)

__all__ = [
    "ACCURACY",
    "ALL_CELLS",
    "CATEGORY_NAMES",
    "EACH_ROTATION",
    "NAME",
    "VQA_MEASURES",
    "guessing",
    "in_subtasks",
    "is_asked",
    "subtask_cells",
]

NAME = "vqa"
CATEGORY_NAMES = {
    "object_property": "Property",
    "object_relationship": "Relationship",
    "scene_understanding": "Scene",
    "dynamic_reasoning": "Dynamics",
}


def is_asked(run: Run) -> bool:
    """Whether the run has questions."""
    return NAME in run.design.suite.tracks


def subtask_cells(run: Run) -> tuple[Cell, ...]:
    """Subtasks that were asked, then the mean of each category, then that of the categories."""
    return _cells(expected_answers(run) or set(run.records["subtask"].dropna()))


def in_subtasks(rows: pd.DataFrame, run: Run) -> pd.DataFrame:
    """Rows of samples with the subtask of their question."""
    subtasks = run.records.set_index("sample")["subtask"]
    return rows.assign(**{CELL: rows["sample"].map(subtasks)})


def _cells(asked: Container[str]) -> tuple[Cell, ...]:
    parts = {
        category: tuple(name for name in subtasks if name in asked)
        for category, subtasks in CATEGORIES.items()
    }
    parts = {category: names for category, names in parts.items() if names}
    single = [Cell(name, name, category) for category, names in parts.items() for name in names]
    means = [Cell(name, CATEGORY_NAMES[name], "", names) for name, names in parts.items()]
    return (*single, *means, Cell(OVERALL_CELL, "Overall", "", tuple(parts)))


ALL_CELLS = _cells(SUBTASKS)
"""The cells of a run that asks everything."""


def _answers(run: Run) -> pd.DataFrame:
    asked = questions_counted(run)
    return asked.assign(
        **dict.fromkeys(SCORED_BY, ""),
        **{CELL: asked["subtask"], "item": asked["question"]},
        replied=True,
    )


def guessing(run: Run, cell: str) -> float:
    """Expected accuracy of uniform guesses in a cell that was asked."""
    subtask = next((name for name in SUBTASKS if name == cell), None)
    if subtask is not None:
        return chance(subtask) ** showing(run).rotations
    (names,) = (other.of for other in subtask_cells(run) if other.name == cell)
    return plain_sum(guessing(run, name) for name in names) / len(names)


def _single(run: Run) -> pd.DataFrame:
    """Every shown order of options for itself."""
    parts = [scored_answers(run, model) for model in run.design.model_names]
    rows = pd.concat(parts) if parts else run.records.iloc[:0]
    return rows.assign(
        **dict.fromkeys(SCORED_BY, ""),
        **{CELL: rows["subtask"], "item": rows["question"]},
        replied=has_reply(rows),
        correct=rows["given"].eq(rows["right"]).fillna(False).astype("int64"),
        n=1,
    )


ACCURACY = Measure(
    "accuracy",
    "Accuracy",
    SampleCounts("answer", ("correct", "n"), _answers),
    ratio_of,
    "questions that were answered right; under circular evaluation in every rotation",
    over="questions",
    chance=guessing,
    floors=("majority", "text-only", "random"),
)
EACH_ROTATION = Measure(
    "each_rotation",
    "Each rotation",
    SampleCounts("rotations", ("correct", "n"), _single),
    ratio_of,
    "answers that were right, every rotation of a question counted for itself",
    over="answers",
    in_tables=False,
)
VQA_MEASURES = (ACCURACY, EACH_ROTATION)
