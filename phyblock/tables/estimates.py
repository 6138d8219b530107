"""Every measure of a run in every cell, with its spread over seeds and its interval."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from phyblock.scoring.ratios import Floats
from phyblock.scoring.uncertainty import in_unit_range, jackknife
from phyblock.tables.intervals import CountCube, parents_of
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
    parts = []
    families: dict[str, list[Measure]] = {}
    for measure in measures:
        families.setdefault(measure.counted.name, []).append(measure)
    for family in families.values():
        table = counts_of(family[0].counted)
        parts += [_of_group(run, table, family, group) for group in _joined(cells)]
    known = [part for part in parts if len(part)]
    if not known:
        return pd.DataFrame(columns=list(ESTIMATE_COLUMNS))
    return pd.concat(known, ignore_index=True)[list(ESTIMATE_COLUMNS)]


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


@dataclass(frozen=True)
class _Pool:
    """The counts of a group of cells: `counts` has shape (scenes, groups, pooled, columns)."""

    groups: list[tuple[str, ...]]
    pooled: list[str]
    scenes: list[str]
    counts: Floats
    present: np.ndarray
    cube: CountCube


def _pool(run: Run, table: pd.DataFrame, counted: SampleCounts, pooled: Sequence[str]) -> _Pool:
    by = [*_GROUP, CELL]
    cube = CountCube(table, parents_of(run), by, counted.columns)
    groups = list(dict.fromkeys(cell[:-1] for cell in cube.cells))
    shape = (len(cube.scenes), len(groups), len(pooled))
    counts = np.zeros((*shape, len(counted.columns)))
    present = np.zeros(shape, dtype=bool)
    places = {group: place for place, group in enumerate(groups)}
    for column, cell in enumerate(cube.cells):
        at = (slice(None), places[cell[:-1]], pooled.index(cell[-1]))
        counts[at], present[at] = cube.counts[:, column], cube.present[:, column]
    return _Pool(groups, list(pooled), list(cube.scenes), counts, present, cube)


def value_of_cells(
    measure: Measure, cells: Sequence[Cell], pooled: Sequence[str]
) -> Callable[..., Floats]:
    """From sums of counts (..., pooled, columns) to values of the cells (..., cells).

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


def _of_group(
    run: Run, table: pd.DataFrame, measures: Sequence[Measure], cells: Sequence[Cell]
) -> pd.DataFrame:
    """Estimates of measures with the same counts, in cells that are estimated together."""
    counted = measures[0].counted
    pooled = [cell.name for cell in cells if not cell.of]
    table = table[table[CELL].isin(pooled)]
    if table.empty:
        return pd.DataFrame()
    keys = [*_GROUP, CELL]
    heard = table.groupby(["model", CELL])["replied"].any().to_dict()
    pool = _pool(run, table, counted, pooled)
    sizes = table.groupby(keys).size().to_dict()
    n = np.array([[sizes.get((*g, s), 0) for s in pooled] for g in pool.groups])
    behind, fewest = _clusters_of_cells(pool, cells)
    # A part of a single base scene leaves a mean without an interval.
    usable = np.where(fewest < 2, fewest, behind)
    silent = np.array([[not heard.get((g[0], s), False) for s in pooled] for g in pool.groups])
    # Where a model said nothing, empty plans have counts, and nothing was measured.
    counts = np.where(silent[None, :, :, None], np.nan, pool.counts)

    def all_values(sums: Floats) -> Floats:
        each = [value_of_cells(measure, cells, pooled)(sums) for measure in measures]
        return np.stack(each, axis=-1)

    found = jackknife(
        counts,
        pool.cube.clusters,
        all_values,
        n_clusters=np.repeat(usable[:, :, None], len(measures), axis=-1),
    )
    is_share = np.array([measure.is_share for measure in measures])
    within = in_unit_range(found, is_share)
    spread = _over_seeds(table, pool, counted, silent, all_values)
    members = np.array([[name in pooled_in(cell, cells) for name in pooled] for cell in cells])
    scenes = np.any(pool.present[:, :, None, :] & members, axis=-1).sum(axis=0)
    rows = []
    for g, group in enumerate(pool.groups):
        for c, cell in enumerate(cells):
            for m, measure in enumerate(measures):
                at = (g, c, m)
                rows.append(
                    (
                        measure.name,
                        *group,
                        cell.name,
                        int(n[g][members[c]].sum()),
                        found.value[at],
                        *(values[at] for values in spread),
                        within.lo[at],
                        within.hi[at],
                        found.se[at],
                        int(scenes[g, c]),
                        int(behind[g, c]),
                    )
                )
    return pd.DataFrame(rows, columns=list(ESTIMATE_COLUMNS))


def _over_seeds(
    table: pd.DataFrame,
    pool: _Pool,
    counted: SampleCounts,
    silent: np.ndarray,
    values: Callable[[Floats], Floats],
) -> tuple[np.ndarray, Floats, Floats, Floats, Floats]:
    """Number of seeds with a value; mean, sample standard deviation, least and most over them."""
    seeds = sorted(table["seed"].unique())
    sums = np.full((len(seeds), *pool.counts.shape[1:]), np.nan)
    groups = {group: place for place, group in enumerate(pool.groups)}
    totals = table.groupby(["seed", *_GROUP, CELL], sort=False)[list(counted.columns)].sum()
    for key, row in zip(totals.index, totals.to_numpy(np.float64), strict=True):
        sums[seeds.index(key[0]), groups[key[1:-1]], pool.pooled.index(key[-1])] = row
    each = values(np.where(silent[..., None], np.nan, sums))
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


def _clusters_of_cells(pool: _Pool, cells: Sequence[Cell]) -> tuple[np.ndarray, np.ndarray]:
    """Base scenes behind each group and cell, and the fewest that are behind a part of it."""
    by_cell = pool.cube.clusters.behind(pool.present.reshape(len(pool.scenes), -1)).reshape(
        pool.present.shape[1:]
    )
    behind, fewest = [], []
    for cell in cells:
        members = [name in pooled_in(cell, cells) for name in pool.pooled]
        seen = np.any(pool.present[:, :, members], axis=-1)
        behind.append(pool.cube.clusters.behind(seen))
        fewest.append(by_cell[:, members].min(axis=-1))
    return np.stack(behind, axis=-1), np.stack(fewest, axis=-1)
