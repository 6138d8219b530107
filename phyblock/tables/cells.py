"""The scores that enter each cell of a table, and their micro averages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from phyblock.tables.design import OVERALL
from phyblock.tables.load import Run, once_per_run
from phyblock.tables.outcomes import WITHOUT_REPLY

__all__ = [
    "METRICS",
    "METRIC_NAMES",
    "SIDE_METRICS",
    "cell_scores",
    "measured",
    "micro_averages",
    "with_levels",
]

METRICS = ("precision", "recall", "f1")
METRIC_NAMES = dict(zip(METRICS, ("Prec", "Rec", "F1"), strict=True))
"""Their names as headings of columns."""
SIDE_METRICS = ("Prec", "Rec")
"""Headings that narrow tables do without."""


def with_levels(frame: pd.DataFrame, run: Run) -> pd.DataFrame:
    """Rows of a frame of samples or scores, repeated for each level of its scene and `overall`.

    Adds the column `level`; levels that the suite does not run are left out.
    """
    levels = run.records[["sample", "levels"]].explode("levels", ignore_index=True)
    levels["level"] = levels.pop("levels").map(str)
    levels = levels[levels["level"].isin(run.design.levels)]
    return pd.concat(
        [frame.merge(levels, on="sample"), frame.assign(level=OVERALL)], ignore_index=True
    )


@once_per_run
def cell_scores(run: Run) -> pd.DataFrame:
    """Scores by level, each level under its criterion alone, without those the run leaves out.

    What is left out are missing replies and API errors where the suite says `missing: skip`.
    """
    scores = run.scores[~run.scores["outcome"].isin(run.design.outcomes_left_out)]
    scores = with_levels(scores, run)
    criteria = {level: run.design.criterion(level) for level in run.design.levels}
    return scores[scores["criterion"] == scores["level"].map(criteria)]


def measured(scores: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """Scores without the groups of `keys` in which no sample has a reply.

    Where empty plans count, such a group has counts, but nothing was measured.
    """
    replied = scores.assign(replied=~scores["outcome"].isin(WITHOUT_REPLY))
    return scores[replied.groupby(list(keys))["replied"].transform("any").astype(bool)]


def micro_averages(scores: pd.DataFrame, keys: Sequence[str]) -> pd.DataFrame:
    """Counts summed over each group of `keys`, then divided: n, tp, fp, fn and the metrics.

    A metric whose denominator is 0 is NaN. The index is `keys`.
    """
    groups = scores.groupby(list(keys), sort=False)
    summed = groups[["tp", "fp", "fn"]].sum()
    summed.insert(0, "n", groups.size())
    tp, fp, fn = (summed[name].to_numpy(np.float64) for name in ("tp", "fp", "fn"))
    with np.errstate(divide="ignore", invalid="ignore"):
        summed["precision"] = tp / _nonzero(tp + fp)
        summed["recall"] = tp / _nonzero(tp + fn)
        summed["f1"] = 2 * tp / _nonzero(2 * tp + fp + fn)
    return summed


def _nonzero(whole: np.ndarray) -> np.ndarray:
    return np.where(whole == 0, np.nan, whole)
