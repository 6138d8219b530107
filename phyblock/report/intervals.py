"""95 % intervals of assembly results: base scenes resampled, micro averages recomputed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from phyblock.report.cells import METRICS, cell_scores, measured
from phyblock.report.load import Run, once_per_run
from phyblock.scoring.uncertainty import (
    Clusters,
    Estimate,
    Floats,
    bootstrap,
    f1_of,
    precision_of,
    recall_of,
)

__all__ = [
    "BOOTSTRAP_SEED",
    "INTERVALS",
    "CountCube",
    "all_metrics",
    "count_cube",
    "intervals_frame",
    "parents_of",
    "resampler",
]

BOOTSTRAP_SEED = 20_261_121
"""Seed of every resampling, so that tables made again are the same."""

INTERVALS = tuple(f"{metric}_{end}" for metric in METRICS for end in ("lo", "hi", "se"))
"""Columns of `intervals_frame` besides the numbers of scenes and clusters."""

_CELL = ["model", "track", "setting", "matcher", "criterion", "level"]
_COUNTS = ["tp", "fp", "fn"]


class CountCube:
    """Counts of scenes x cells, summed over seeds, with the base scenes of each scene.

    `counts` has shape (scenes, cells, counts); `present`, (scenes, cells), says where a cell has a
    sample of the scene; `clusters` are the scenes' base scenes. Scenes and cells are sorted.
    """

    def __init__(
        self,
        table: pd.DataFrame,
        parents: pd.Series[Any],
        by: Sequence[str],
        sums: Sequence[str],
    ) -> None:
        summed = table.groupby([*by, "scene"], sort=True)[list(sums)].sum()
        scenes, names = pd.factorize(summed.index.get_level_values("scene"), sort=True)
        cells, self.cells = pd.factorize(summed.index.droplevel("scene"), sort=True)
        self.scenes = list(names)
        self.counts: Floats = np.zeros((len(self.scenes), len(self.cells), len(sums)))
        self.counts[scenes, cells] = summed.to_numpy(np.float64)
        self.present = np.zeros(self.counts.shape[:2], dtype=bool)
        self.present[scenes, cells] = True
        self.parents = [tuple(parents[scene]) or (scene,) for scene in self.scenes]
        self.clusters = Clusters.of(self.parents)


def resampler() -> np.random.Generator:
    """The generator that every resampling begins with."""
    return np.random.default_rng(BOOTSTRAP_SEED)


def count_cube(run: Run, level: str, by: Sequence[str]) -> CountCube:
    """Scores of a level as counts tp, fp, fn of every scene in the cells that `by` names.

    Without the models that have no reply at the level.
    """
    scores = cell_scores(run)
    scores = measured(scores[scores["level"] == level], ["model", "track"])
    return CountCube(scores, parents_of(run), by, _COUNTS)


def parents_of(run: Run) -> pd.Series[Any]:
    """Base scenes by scene."""
    return run.records.drop_duplicates("scene").set_index("scene")["parents"]


@once_per_run
def intervals_frame(run: Run) -> pd.DataFrame:
    """`n_scenes`, `n_clusters` and, of each metric, `*_lo`, `*_hi`, `*_se` by cell of `assembly`.

    In [0, 1], of the micro averages over all seeds. A scene's seeds stay together, so that what
    differs from one reply to the next is part of the interval. NaN with fewer than two clusters.
    """
    parts = [_of_level(run, level) for level in run.design.levels]
    columns = ["n_scenes", "n_clusters", *INTERVALS]
    known = [part for part in parts if len(part)]
    if not known:
        return pd.DataFrame(columns=columns, index=pd.MultiIndex.from_arrays([[]] * 6, names=_CELL))
    return pd.concat(known)[columns]


def _of_level(run: Run, level: str) -> pd.DataFrame:
    cube = count_cube(run, level, _CELL)
    if not cube.scenes:
        return pd.DataFrame()
    n_clusters = cube.clusters.behind(cube.present)
    columns: dict[str, np.ndarray] = {
        "n_scenes": cube.present.sum(axis=0),
        "n_clusters": n_clusters,
    }
    found = bootstrap(
        cube.counts,
        cube.clusters,
        all_metrics,
        resampler(),
        n_clusters=np.repeat(n_clusters[:, None], len(METRICS), axis=1),
    )
    for place, metric in enumerate(METRICS):
        columns |= {f"{metric}_{end}": _end(found, end)[:, place] for end in ("lo", "hi", "se")}
    return pd.DataFrame(columns, index=pd.MultiIndex.from_tuples(cube.cells, names=_CELL))


def all_metrics(sums: Floats) -> Floats:
    """Precision, recall and F1, in the last axis, of counts (..., [tp, fp, fn])."""
    return np.stack([metric(sums) for metric in (precision_of, recall_of, f1_of)], axis=-1)


def _end(found: Estimate, name: str) -> Floats:
    return {"lo": found.lo, "hi": found.hi, "se": found.se}[name]
