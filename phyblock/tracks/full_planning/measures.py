"""What full planning measures: precision, recall and F1 of steps, by level (paper section 4.1)."""

from __future__ import annotations

import pandas as pd

from phyblock.scoring.ratios import f1_of, precision_of, recall_of
from phyblock.tables.cells import cell_scores, with_levels
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, Cell, Measure, SampleCounts
from phyblock.tables.outcomes import WITHOUT_REPLY
from phyblock.tables.text_table import level_name
from phyblock.tracks.full_planning.baselines import PLAN_FLOORS
from phyblock.tracks.poses import POSE_MEASURES

__all__ = ["NAME", "PLANNING_MEASURES", "in_levels", "is_asked", "level_cells"]

NAME = "full_planning"


def is_asked(run: Run) -> bool:
    """Whether the run has plans."""
    return NAME in run.design.suite.tracks


def level_cells(run: Run) -> tuple[Cell, ...]:
    """The levels of the suite, then all scenes together."""
    return tuple(Cell(level, level_name(level)) for level in run.design.levels)


def in_levels(rows: pd.DataFrame, run: Run) -> pd.DataFrame:
    """Rows of samples, repeated for each level of their scene."""
    return with_levels(rows, run).rename(columns={"level": CELL})


def _steps(run: Run) -> pd.DataFrame:
    scores = cell_scores(run)
    scores = scores[scores["track"] == NAME].rename(columns={"level": CELL})
    replied = ~scores["outcome"].isin(WITHOUT_REPLY)
    return scores.assign(item=scores["scene"], replied=replied)


_STEPS = SampleCounts("steps", ("tp", "fp", "fn"), _steps)

PLANNING_MEASURES = (
    Measure(
        "f1", "F1", _STEPS, f1_of, "harmonic mean of precision and recall", over="steps",
        floors=PLAN_FLOORS,
    ),
    Measure("precision", "Precision", _STEPS, precision_of, "right steps of those proposed"),
    Measure("recall", "Recall", _STEPS, recall_of, "blocks of the goal that a right step placed"),
    *POSE_MEASURES,
)  # fmt: skip
