"""The scores that enter each cell of a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from phyblock.records.record import Score
from phyblock.tables.design import OVERALL
from phyblock.tables.flat import BLOCK_COLUMNS, MATCHED
from phyblock.tables.load import Run, made_once
from phyblock.tables.measures import CELL, Cell
from phyblock.tables.outcomes import has_reply
from phyblock.tables.text_table import level_name

__all__ = [
    "METRICS",
    "METRIC_NAMES",
    "SIDE_METRICS",
    "cell_scores",
    "in_levels",
    "level_cells",
    "measured",
    "with_levels",
]

METRICS = ("precision", "recall", "f1")
METRIC_NAMES = dict(zip(METRICS, ("Prec", "Rec", "F1"), strict=True))
"""Their names as headings of columns."""
SIDE_METRICS = ("Prec", "Rec")
"""Headings that narrow tables do without."""
_COLUMNS = (
    *("track", "model", "scene", "seed", "variant", "outcome", "criterion", "matcher", "setting"),
    *(*MATCHED, *BLOCK_COLUMNS.values(), *Score.FURTHER),
)
"""Those of scores that cells need."""


def level_cells(run: Run) -> tuple[Cell, ...]:
    """The levels of the suite, then all scenes together."""
    return tuple(Cell(level, level_name(level)) for level in run.design.levels)


def in_levels(rows: pd.DataFrame, run: Run) -> pd.DataFrame:
    """Rows of samples, repeated for each of `level_cells` that their scene is in."""
    return with_levels(rows, run).rename(columns={"level": CELL})


def with_levels(frame: pd.DataFrame, run: Run) -> pd.DataFrame:
    """Rows of a frame of samples or scores, repeated for each level of its scene and `overall`.

    Adds the column `level`; levels that the suite does not run are left out.
    """
    rows, levels = _rows_by_level(frame["sample"], run)
    columns = {str(name): _taken(frame[name], rows) for name in frame}
    return pd.DataFrame({**columns, "level": levels}, copy=False)


def _rows_by_level(
    samples: pd.Series[str], run: Run
) -> tuple[np.ndarray[Any, np.dtype[np.intp]], pd.Series[str]]:
    """Numbers of rows of these samples as `with_levels` repeats them, and the level of each."""
    kinds: dict[tuple[int, ...], int] = {}
    codes = np.array([kinds.setdefault(held, len(kinds)) for held in run.records["levels"]], int)
    wanted = run.design.levels
    named = [[str(level) for level in held if str(level) in wanted] for held in kinds]
    n_named = np.array([len(levels) for levels in named], dtype=np.intp)
    kind = (
        codes[pd.Index(run.records["sample"]).get_indexer(samples)] if len(samples) else codes[:0]
    )
    kind = kind.astype(np.intp)
    lengths = n_named[kind]
    first = (np.cumsum(n_named) - n_named)[kind] - (np.cumsum(lengths) - lengths)
    labels = np.array([level for levels in named for level in levels], dtype=object)
    everything = np.arange(len(samples))
    repeated = labels[np.repeat(first, lengths) + np.arange(lengths.sum())]
    levels = np.concatenate([repeated, np.full(len(samples), OVERALL, dtype=object)])
    rows = np.concatenate([np.repeat(everything, lengths), everything])
    return rows, pd.Series(levels, dtype="object", copy=False)


def _taken(column: pd.Series[Any], rows: np.ndarray[Any, np.dtype[np.intp]]) -> pd.Series[Any]:
    """Rows of a column, in a frame's order, of the same type."""
    return pd.Series(column.array.take(rows), dtype=column.dtype, copy=False)


@made_once
def cell_scores(run: Run) -> pd.DataFrame:
    """Scores by level, each level under its criterion alone, without those the run leaves out.

    What is left out are missing replies and API errors where the suite says `missing: skip`. The
    frame is shared: do not change it.
    """
    scores = run.scores
    rows, levels = _rows_by_level(scores["sample"], run)
    criteria = {level: run.design.criterion(level) for level in run.design.levels}
    left_out = scores["outcome"].isin(run.design.outcomes_left_out).to_numpy()
    is_counted = scores["criterion"].to_numpy()[rows] == levels.map(criteria).to_numpy()
    is_counted &= ~left_out[rows]
    rows = rows[is_counted]
    columns = {name: _taken(scores[name], rows) for name in _COLUMNS}
    named = pd.Series(levels.to_numpy()[is_counted], dtype="object", copy=False)
    return pd.DataFrame({**columns, "level": named}, copy=False)


def measured(scores: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """Scores without the groups of `keys` in which no sample has a reply.

    Where empty plans count, such a group has counts, but nothing was measured.
    """
    replied = scores[list(keys)].assign(replied=has_reply(scores))
    kept = replied.groupby(list(keys))["replied"].transform("any").astype(bool)
    return scores if kept.all() else scores[kept]
