"""Every measure of a run in every cell, with its spread over seeds and its interval."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from phyblock.scoring.counts import Floats
from phyblock.scoring.statistics import Clusters, in_range, jackknife
from phyblock.tables.intervals import Grouping, base_scenes, grouped, parents_of, summed
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, SCORED_BY, Cell, Measure, SampleCounts

__all__ = ["ESTIMATE_COLUMNS", "estimate_frame", "pooled_in", "value_of_cells"]

_GROUP = ("model", *SCORED_BY)
ESTIMATE_COLUMNS = (
    "measure",
    "model",
    *SCORED_BY,
    CELL,
    "n",
    "value",
    "seeds",
    "mean",
    "sd",
    "least",
    "most",
    "lo",
    "hi",
    "se",
    "n_scenes",
    "n_clusters",
)
"""Columns of `estimate_frame`."""


def estimate_frame(
    run: Run,
    measures: Sequence[Measure],
    cells: Sequence[Cell],
    counts_of: Callable[[SampleCounts], pd.DataFrame],
) -> pd.DataFrame:
    """One row a measure, model, way of counting and cell, in `ESTIMATE_COLUMNS`.

    `counts_of` gives the counts of a family of measures, as `SampleCounts` says.

    `value` is of the counts of all `n` samples, summed over scenes and seeds, in the measure's own
    unit; `mean`, `sd` (ddof = 1), `least` and `most` are over the values of the `seeds` single
    seeds. `lo` and `hi` bound a 95 % interval and `se` is the standard error, from leaving out the
    `n_clusters` base scenes that the `n_scenes` scenes were made from; a scene's seeds stay
    together. Where a model said nothing at all in a cell, nothing was measured: NaN.
    """
    rows: list[tuple[object, ...]] = []
    families: dict[str, list[Measure]] = {}
    for measure in measures:
        families.setdefault(measure.counted.name, []).append(measure)
    parents = parents_of(run)
    for family in families.values():
        counted = family[0].counted
        pool = _Pool.of(counts_of(counted), counted.columns, cells, parents)
        for group in _joined(cells):
            rows += _rows_of(pool.only(group), family, group)
    return pd.DataFrame(rows, columns=list(ESTIMATE_COLUMNS))


def _joined(cells: Sequence[Cell]) -> Iterator[list[Cell]]:
    """Cells that means join, together: they are estimated at once; all others alone."""
    groups: list[list[Cell]] = []
    for cell in cells:
        linked = [
            group
            for group in groups
            if any(other.name in cell.of or cell.name in other.of for other in group)
        ]
        groups = [group for group in groups if group not in linked]
        groups.append([*(other for group in linked for other in group), cell])
    yield from groups


@dataclass(frozen=True, eq=False)
class _Pool:
    """Counts by model and way of counting (`groups`), and by cell (`pooled`).

    `counts` has shape (scenes, groups, pooled, columns) and is summed over seeds; `rows`, (scenes,
    groups, pooled), says of how many rows. `of_seeds`, (seeds, groups, pooled, columns), is summed
    over scenes, NaN where a seed has no row. Where a model said nothing at all, (groups, pooled),
    it is `silent`. `parents` are the base scenes of each scene.
    """

    groups: list[tuple[str, ...]]
    pooled: list[str]
    counts: Floats
    rows: NDArray[np.intp]
    of_seeds: Floats
    silent: NDArray[np.bool_]
    parents: list[tuple[str, ...]]

    @classmethod
    def of(
        cls,
        table: pd.DataFrame,
        columns: Sequence[str],
        cells: Sequence[Cell],
        parents: pd.Series[Any],
    ) -> _Pool:
        """Rows as `SampleCounts` has them, of cells that are no means of others."""
        pooled = [cell.name for cell in cells if not cell.of]
        places = pd.Index(pooled).get_indexer(pd.Index(table[CELL]))
        table, places = table[places >= 0], places[places >= 0]
        groups, cell = grouped(table, _GROUP), Grouping(places, pooled)
        scenes, seeds = grouped(table, "scene"), grouped(table, "seed")
        counts, rows = summed(table, columns, (scenes, groups, cell))
        of_seeds, seed_rows = summed(table, columns, (seeds, groups, cell))
        of_seeds[seed_rows == 0] = np.nan
        model = grouped(table, "model")
        replies = summed(table, ["replied"], (model, cell))[0][..., 0]
        silent = replies[[model.values.index(group[0]) for group in groups.values]] == 0
        origins = base_scenes(parents, scenes.values)
        return cls(groups.values, pooled, counts, rows, of_seeds, silent, origins)

    def only(self, cells: Sequence[Cell]) -> _Pool:
        """The part of these cells, with the groups, scenes and seeds that have rows in them."""
        names = [cell.name for cell in cells if not cell.of]
        kept = np.array([self.pooled.index(name) for name in names], dtype=np.intp)
        there = self.rows[:, :, kept] > 0
        scenes, groups = (np.flatnonzero(there.any(axis=axis)) for axis in ((1, 2), (0, 2)))
        return _Pool(
            [self.groups[group] for group in groups],
            names,
            self.counts[np.ix_(scenes, groups, kept)],
            self.rows[np.ix_(scenes, groups, kept)],
            self.of_seeds[:, groups][:, :, kept],
            self.silent[np.ix_(groups, kept)],
            [self.parents[scene] for scene in scenes],
        )


def value_of_cells(
    measure: Measure, cells: Sequence[Cell], pooled: Sequence[str]
) -> Callable[..., Floats]:
    """A function from sums of counts (..., pooled, columns) to values of the cells (..., cells).

    With `asked`, of shape (..., pooled), means are over the pooled cells that were asked alone.
    """

    def values(sums: Floats, asked: np.ndarray | None = None) -> Floats:
        single = measure.value(sums)
        mask = np.ones(single.shape, dtype=bool) if asked is None else asked
        mask = np.broadcast_to(mask, single.shape)
        known = {name: (single[..., n], mask[..., n]) for n, name in enumerate(pooled)}
        for cell in cells:
            if cell.of:
                parts = np.stack([known[name][0] for name in cell.of], axis=-1)
                there = np.stack([known[name][1] for name in cell.of], axis=-1)
                whole = there.sum(axis=-1)
                mean = np.where(there, parts, 0).sum(axis=-1) / np.where(whole, whole, 1)
                known[cell.name] = np.where(whole > 0, mean, np.nan), whole > 0
        return np.stack([known[cell.name][0] for cell in cells], axis=-1)

    return values


def _rows_of(
    pool: _Pool, measures: Sequence[Measure], cells: Sequence[Cell]
) -> Iterator[tuple[object, ...]]:
    """Estimates of measures with the same counts, in cells that are estimated together."""
    if not pool.groups:
        return
    clusters, present = Clusters.of(pool.parents), pool.rows > 0
    behind, fewest = _clusters_of_cells(clusters, present, pool.pooled, cells)
    # A part of a single base scene leaves a mean without an interval.
    usable = np.where(fewest < 2, fewest, behind)

    def all_values(sums: Floats) -> Floats:
        # Where a model said nothing, empty plans have counts, and nothing was measured.
        heard = np.where(pool.silent[..., None], np.nan, sums)
        each = [value_of_cells(measure, cells, pool.pooled)(heard) for measure in measures]
        return np.stack(each, axis=-1)

    estimate = jackknife(
        pool.counts,
        clusters,
        all_values,
        n_clusters=np.repeat(usable[:, :, None], len(measures), axis=-1),
    )
    within = in_range(estimate, [measure.end_of_range for measure in measures])
    spread = _over_seeds(all_values(pool.of_seeds))
    members = np.array([[n in pooled_in(cell, cells) for n in pool.pooled] for cell in cells])
    scenes = np.any(present[:, :, None, :] & members, axis=-1).sum(axis=0)
    samples = pool.rows.sum(axis=0) @ members.T
    for g, group in enumerate(pool.groups):
        for c, cell in enumerate(cells):
            for m, measure in enumerate(measures):
                at = (g, c, m)
                yield (
                    measure.name,
                    *group,
                    cell.name,
                    int(samples[g, c]),
                    estimate.value[at],
                    *(values[at] for values in spread),
                    within.lo[at],
                    within.hi[at],
                    estimate.se[at],
                    int(scenes[g, c]),
                    int(behind[g, c]),
                )


def _over_seeds(each: Floats) -> tuple[NDArray[np.intp], Floats, Floats, Floats, Floats]:
    """Number of seeds with a value; mean, sample standard deviation, least and most over them."""
    known = ~np.isnan(each)
    count = known.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.where(known, each, 0).sum(axis=0) / np.where(count, count, np.nan)
        square = np.where(known, (each - mean) ** 2, 0).sum(axis=0)
        sd = np.sqrt(square / np.where(count > 1, count - 1, np.nan))
    ends = (np.fmin.reduce(each), np.fmax.reduce(each))
    return count, mean, sd, *ends


def pooled_in(cell: Cell, cells: Sequence[Cell]) -> frozenset[str]:
    """The pooled cells that a cell is made of."""
    if not cell.of:
        return frozenset([cell.name])
    by_name: Mapping[str, Cell] = {other.name: other for other in cells}
    return frozenset().union(*(pooled_in(by_name[name], cells) for name in cell.of))


def _clusters_of_cells(
    clusters: Clusters, present: NDArray[np.bool_], pooled: Sequence[str], cells: Sequence[Cell]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Base scenes behind each group and cell, and the fewest that are behind a part of it."""
    by_cell = clusters.behind(present.reshape(len(present), -1)).reshape(present.shape[1:])
    behind, fewest = [], []
    for cell in cells:
        members = [name in pooled_in(cell, cells) for name in pooled]
        behind.append(clusters.behind(np.any(present[:, :, members], axis=-1)))
        fewest.append(by_cell[:, members].min(axis=-1))
    return np.stack(behind, axis=-1), np.stack(fewest, axis=-1)
