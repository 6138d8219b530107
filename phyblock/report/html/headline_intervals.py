"""95 % intervals of the headline tables of questions and episodes: base scenes resampled."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pandas as pd

from phyblock.domain import CATEGORIES, SUBTASKS
from phyblock.report.cells import METRICS
from phyblock.report.intervals import CountCube, parents_of, resampler
from phyblock.report.load import Run
from phyblock.report.questions import OVERALL_CELL, showing
from phyblock.scoring.uncertainty import Floats, bootstrap, f1_of, precision_of, recall_of

__all__ = ["Bounds", "answer_bounds", "step_bounds"]

Bounds = Mapping[tuple[str, str], tuple[float, float]]
"""Both ends of an interval [%] by model and cell; none where there is no interval."""


def answer_bounds(run: Run) -> Bounds:
    """Of the accuracies by category and overall.

    Under circular evaluation there is none: what is right or wrong are then sets of answers.
    """
    records = run.records[run.records["track"] == "vqa"]
    records = records[~records["outcome"].isin(run.design.outcomes_left_out)]
    if showing(run).circular or not len(records):
        return {}
    correct = (records["given"] == records["right"]).astype("int64")
    table = records[["model", "scene", "subtask"]].assign(correct=correct, n=1)
    found: dict[tuple[str, str], tuple[float, float]] = {}
    for model, mine in table.groupby("model", sort=False):
        cube = CountCube(mine, parents_of(run), ["subtask", "model"], ["correct", "n"])
        places = [SUBTASKS.index(subtask) for subtask, _ in cube.cells]
        counts = np.zeros((len(cube.scenes), len(SUBTASKS), 2))
        counts[:, places] = cube.counts
        found |= _bounds(str(model), cube, counts, _macro, (*CATEGORIES, OVERALL_CELL))
    return found


def _macro(sums: Floats) -> Floats:
    """Means of four subtasks each, then of the four categories, of counts (..., 16, 2)."""
    shares = sums[..., 0] / sums[..., 1]
    categories = shares.reshape(*shares.shape[:-1], len(CATEGORIES), -1).mean(axis=-1)
    return np.concatenate([categories, categories.mean(axis=-1, keepdims=True)], axis=-1)


def step_bounds(run: Run) -> Bounds:
    """Of precision, recall and F1 of the blocks placed, and of all attempts."""
    scores = run.scores[
        (run.scores["track"] == "step_planning")
        & (run.scores["setting"] == run.design.setting)
        & ~run.scores["outcome"].isin(run.design.outcomes_left_out)
    ]
    found: dict[tuple[str, str], tuple[float, float]] = {}
    for (model, criterion), mine in scores.groupby(["model", "criterion"], sort=False):
        cube = CountCube(mine, parents_of(run), ["model", "criterion"], ["tp", "fp", "fn"])
        names = [f"{criterion}_{metric}" for metric in METRICS]
        found |= _bounds(str(model), cube, cube.counts[:, 0], _metrics, names)
    return found


def _metrics(sums: Floats) -> Floats:
    return np.stack([metric(sums) for metric in (precision_of, recall_of, f1_of)], axis=-1)


def _bounds(
    model: str,
    cube: CountCube,
    counts: Floats,
    metric: Callable[[Floats], Floats],
    cells: Sequence[str],
) -> dict[tuple[str, str], tuple[float, float]]:
    found = bootstrap(counts, cube.clusters, metric, resampler())
    ends = zip(cells, 100 * found.lo, 100 * found.hi, strict=True)
    return {(model, cell): (float(lo), float(hi)) for cell, lo, hi in ends if not pd.isna(lo)}
