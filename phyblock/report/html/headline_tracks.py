"""The headline tables of questions and of episodes."""

from __future__ import annotations

import math

import pandas as pd

from phyblock.domain import CATEGORIES
from phyblock.report.html.headline import (
    HUMAN_ACCURACY,
    HUMAN_NOTE,
    Cell,
    Headline,
    Row,
    kinds_of,
    plain,
)
from phyblock.report.load import Run
from phyblock.report.questions import OVERALL_CELL, questions_frame
from phyblock.report.table3 import table3_frame
from phyblock.report.text_table import NO_VALUE, number
from phyblock.report.track_intervals import step_metric_intervals, vqa_intervals
from phyblock.report.vqa import published_cells

__all__ = ["steps_headline", "vqa_headline"]

_CATEGORY_NAMES = {
    "object_property": "Property",
    "object_relationship": "Relationship",
    "scene_understanding": "Scene",
    "dynamic_reasoning": "Dynamics",
}
_BELOW = "Below values stand 95 % intervals, from resampling the base scenes."
_STEP_CELLS = {
    "placed_precision": "Precision",
    "placed_recall": "Recall",
    "placed_f1": "F1",
    "attempted_f1": "F1 of attempts",
    "completion": "Completed",
}


def vqa_headline(run: Run) -> Headline | None:
    """Accuracy by category and overall; None for a run without questions."""
    if "vqa" not in run.design.suite.tracks:
        return None
    found = {(row["model"], row["cell"]): row for row in questions_frame(run).to_dict("records")}
    cells = (*CATEGORIES, OVERALL_CELL)
    seeds = len(run.design.suite.seeds)
    measured = "accuracy_mean" if seeds > 1 else "accuracy"
    bounds = _bounds(vqa_intervals(run))
    rows = []
    for name, kind in kinds_of(run).items():
        values = [100 * found[name, cell][measured] for cell in cells]
        shown = [_cell(v, bounds.get((name, c))) for v, c in zip(values, cells, strict=True)]
        rows.append(
            Row(name, kind, tuple(shown), _strip(values[-1], bounds.get((name, cells[-1]))))
        )
    printed = published_cells("Random")
    random = tuple(plain(printed[cell]) for cell in cells)
    human = tuple(Cell("") for _ in CATEGORIES)
    rows += [
        Row("Random, published", "reference", random),
        Row("Human experts, published", "reference", (*human, plain(HUMAN_ACCURACY))),
    ]
    how = f"Accuracy in percent{f', mean of {seeds} seeds' if seeds > 1 else ''}."
    macro = "A category is the unweighted mean of its four subtasks, overall that of the categories"
    return Headline(
        "VQA",
        (*_CATEGORY_NAMES.values(), "Overall"),
        tuple(rows),
        (f"{how} {macro}. {_BELOW if bounds else ''}".strip(), HUMAN_NOTE),
        len(CATEGORIES),
        "Overall",
        {"Random": printed[OVERALL_CELL], "Human": HUMAN_ACCURACY},
    )


def steps_headline(run: Run) -> Headline | None:
    """Scores of the blocks placed, as in Table 3, with F1 over all attempts and goals completed.

    None for a run without episodes.
    """
    if "step_planning" not in run.design.suite.tracks:
        return None
    table = table3_frame(run).to_dict("records")
    ours = {row["model"]: row for row in table if row["source"] == "run"}
    printed = [row for row in table if row["source"] == "published"]
    bounds = _bounds(step_metric_intervals(run))
    rows = []
    for name, kind in kinds_of(run).items():
        shown = [_cell(ours[name][cell], bounds.get((name, cell))) for cell in _STEP_CELLS]
        strip = _strip(ours[name]["placed_f1"], bounds.get((name, "placed_f1")))
        rows.append(Row(name, kind, tuple(shown), strip))
    rows += [
        Row(
            f"{row['published_name']}, published",
            "reference",
            tuple(plain(row.get(cell, math.nan)) for cell in _STEP_CELLS),
        )
        for row in printed
    ]
    note = (
        f"Percent, setting {run.design.setting}. Precision, recall and F1 are of the blocks that "
        "were placed, as in the paper's Table 3; F1 of attempts counts every move that placed "
        f"nothing as wrong; completed are episodes that placed the whole goal. {_BELOW}"
    )
    names = tuple(_STEP_CELLS.values())
    return Headline("Step planning", names, tuple(rows), (note,), names.index("F1"), "F1", {})


def _bounds(table: pd.DataFrame) -> dict[tuple[str, str], tuple[float, float]]:
    """Both ends of an interval [%] by model and cell; none where there is no interval."""
    known = table.dropna(subset=["lo", "hi"])
    keys = zip(known["model"], known["cell"], strict=True)
    return dict(zip(keys, zip(known["lo"], known["hi"], strict=True), strict=True))


def _cell(value: float, ends: tuple[float, float] | None) -> Cell:
    if math.isnan(value):
        return Cell(NO_VALUE)
    return Cell(number(value), value, f"{number(ends[0])} to {number(ends[1])}" if ends else "")


def _strip(value: float, ends: tuple[float, float] | None) -> tuple[float, float, float] | None:
    return None if math.isnan(value) else (value, *(ends or (value, value)))
