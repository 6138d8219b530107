"""Estimates of every measure in every cell, with their spread over seeds and their intervals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from phyblock.errors import Problem, StoreError
from phyblock.records.files import RECORDS
from phyblock.registry import added_measures
from phyblock.results.load import Design, Run
from phyblock.scoring.counts import Floats
from phyblock.scoring.statistics import Clusters, in_range, jackknife
from phyblock.tracks.base import kind_of
from phyblock.tracks.measures import (
    CELL,
    SCORED_BY,
    Better,
    Cell,
    HeadlineColumn,
    Measure,
    SampleCounts,
)


@dataclass(frozen=True, eq=False)
class Grouping:
    """A column of few values: `values` are sorted, `codes` are places among them."""

    codes: NDArray[np.intp]
    values: list[Any]


def grouped(table: pd.DataFrame, by: str | Sequence[str]) -> Grouping:
    """Rows by their values in a column, or in several, whose values together are tuples."""
    if isinstance(by, str):
        codes, known = pd.factorize(table[by].to_numpy(), sort=True)
        return Grouping(codes, list(known))
    columns = [grouped(table, name) for name in by]
    shape = tuple(len(column.values) for column in columns)
    flat = np.ravel_multi_index([column.codes for column in columns], shape)
    numbers, codes = np.unique(flat, return_inverse=True)
    places = zip(*np.unravel_index(numbers, shape), strict=True)
    values = [tuple(c.values[at] for c, at in zip(columns, place, strict=True)) for place in places]
    return Grouping(codes.reshape(-1), values)


def summed(
    table: pd.DataFrame, columns: Sequence[str], groupings: Sequence[Grouping]
) -> tuple[Floats, NDArray[np.intp]]:
    """Sums of columns over rows by all groupings, shape (*groupings, columns), and the number of
    rows, (*groupings); a missing value counts as nothing.
    """
    shape = tuple(len(grouping.values) for grouping in groupings)
    size = int(np.prod(shape))
    if not size:
        return np.zeros((*shape, len(columns))), np.zeros(shape, dtype=np.intp)
    flat = np.ravel_multi_index([grouping.codes for grouping in groupings], shape)
    values = [table[name].to_numpy(np.float64, na_value=np.nan) for name in columns]
    sums = [_sums(flat, np.nan_to_num(value), size) for value in values]
    rows = np.bincount(flat, minlength=size).reshape(shape)
    return np.stack(sums, axis=-1).reshape(*shape, len(columns)), rows


def _sums(places: NDArray[np.intp], values: Floats, size: int) -> Floats:
    """Sums of values by their place, below `size`, whatever their order."""
    if (values == np.rint(values)).all():
        return np.bincount(places, values, size).astype(np.float64)
    order = np.argsort(places, kind="stable")
    ends = np.searchsorted(places[order], np.arange(size + 1))
    parts = values[order].tolist()
    sums = [math.fsum(parts[first:last]) for first, last in pairwise(ends.tolist())]
    return np.array(sums, dtype=np.float64)


def base_scenes(parents: pd.Series[Any], scenes: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the base scenes of each scene, itself where it has no others."""
    return [tuple(parents[scene]) or (scene,) for scene in scenes]


def parents_of(run: Run) -> pd.Series[Any]:
    """Base scenes by scene."""
    return run.records.drop_duplicates("scene").set_index("scene")["parents"]


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
        own = counted.cells or cells
        pool = _Pool.of(counts_of(counted), counted.columns, own, parents)
        for group in _joined(own):
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


def track_measures(track: str) -> tuple[Measure, ...]:
    """The measures of a track, those that were added behind its own.

    Raises ValueError where two measures, or two sorts of counts, have one name.
    """
    measures = (*kind_of(track).report().measures, *added_measures(track))
    counts = {measure.counted for measure in measures}
    for named in (measures, counts):
        names = [one.name for one in named]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"two measures or counts of {track} are called {', '.join(twice)}")
    return measures


def numbers_of(
    counted: SampleCounts, counts: Mapping[str, Sequence[float]] | None, where: str
) -> Sequence[float] | None:
    """Return what a record at `where` holds of these counts; None where they are lacking, () for
    none.

    Raises StoreError for another number of them than the measure has now.
    """
    numbers = (counts or {}).get(counted.name)
    if numbers and len(numbers) != len(counted.columns):
        found, allowed = f"{len(numbers)} numbers", ", ".join(counted.columns)
        message, hint = "was counted in another way", "phyblock score counts anew"
        raise StoreError(Problem(where, message, f"counts.{counted.name}", found, allowed, hint))
    return numbers


def stored_counts(track: str) -> tuple[SampleCounts, ...]:
    """Return the counts of each sample that measures of a track need as it is judged."""
    counted = {measure.counted.name: measure.counted for measure in track_measures(track)}
    return tuple(one for one in counted.values() if one.sample is not None)


def track_estimates(run: Run, track: str) -> pd.DataFrame:
    """See `estimate_frame`; the same frame whenever it is asked for, not to be changed."""
    key = f"estimates of {track}"
    if key not in run.made:
        run.made[key] = estimate_frame(
            run,
            track_measures(track),
            kind_of(track).report().cells(run),
            lambda counted: counted_samples(run, track, counted),
        )
    return run.made[key]


def all_estimates(run: Run) -> pd.DataFrame:
    """One long frame: every track of the run, measure, way of counting, model and cell."""
    parts = [track_estimates(run, track).assign(track=track) for track in run.design.suite.tracks]
    known = [part for part in parts if len(part)]
    columns = ["track", *ESTIMATE_COLUMNS]
    return pd.concat(known, ignore_index=True)[columns] if known else pd.DataFrame(columns=columns)


def counted_samples(run: Run, track: str, counted: SampleCounts) -> pd.DataFrame:
    """The counts of samples that measures of a track are made from; see `SampleCounts`."""
    if counted.frame is not None:
        return counted.frame(run)
    records = run.records
    left_out = records["outcome"].isin(run.design.outcomes_left_out)
    rows = records[(records["track"] == track) & ~left_out]
    where = str(run.path / RECORDS)
    of_rows = [numbers_of(counted, counts, where) for counts in rows["counts"]]
    rows = rows[np.array([bool(numbers) for numbers in of_rows], dtype=bool)]
    numbers = pd.DataFrame(
        [list(numbers) for numbers in of_rows if numbers],
        columns=list(counted.columns),
        index=rows.index,
        dtype="float64",
    )
    kept = rows[["sample", "model", "scene", "seed", "variant", "item"]].assign(
        **dict.fromkeys(SCORED_BY, ""), replied=run.replied(rows)
    )
    return kind_of(track).report().in_cells(pd.concat([kept, numbers], axis=1), run)


def headline_columns(run: Run, track: str) -> tuple[HeadlineColumn, ...]:
    """The columns of a track's headline: those it chooses, else its first measure in every cell."""
    report = kind_of(track).report()
    if report.headline is not None:
        return report.headline(run)
    (first, *_) = report.measures
    return tuple(HeadlineColumn(first.name, cell.name, cell.heading) for cell in report.cells(run))


def main_column(run: Run, track: str) -> HeadlineColumn:
    """The column that models are ranked by: the one headed as the track says, else the last."""
    columns = headline_columns(run, track)
    main = kind_of(track).report().main
    return next((column for column in columns if column.heading == main), columns[-1])


def main_measure(run: Run, track: str) -> Measure:
    """The measure of that column: the one that is drawn, compared and ranked by."""
    name = main_column(run, track).measure
    return next(measure for measure in track_measures(track) if measure.name == name)


@dataclass(frozen=True)
class Value:
    """An estimate as tables show it, in the unit of its measure (percent for shares).

    `value` is of all samples, pooled over seeds; `mean` and `sd` are over the values of single
    seeds, `sd` NaN where one alone has a value; `lo` and `hi` are NaN where there is no interval.
    """

    value: float
    mean: float
    sd: float
    lo: float
    hi: float


def headline_rows(estimates: pd.DataFrame, design: Design) -> pd.DataFrame:
    """The rows of a frame of estimates in the headline setting and matcher."""
    return estimates[
        estimates["setting"].isin(["", design.setting])
        & estimates["matcher"].isin(["", design.matcher])
    ]


def rows_of(rows: pd.DataFrame, column: HeadlineColumn) -> pd.DataFrame:
    """The rows of a frame of estimates that stand in a headline column."""
    mine = rows[(rows["measure"] == column.measure) & (rows[CELL] == column.cell)]
    return mine[mine["criterion"] == column.criterion] if column.criterion else mine


def headline_of(run: Run, track: str, design: Design | None = None) -> dict[tuple[str, str], Value]:
    """Return the values of a track's headline by model and heading, in the headline setting of
    the run or of another `design`.
    """
    scale = {measure.name: measure.scale for measure in track_measures(track)}
    rows = headline_rows(track_estimates(run, track), design or run.design)
    values = {}
    for column in headline_columns(run, track):
        for row in rows_of(rows, column).to_dict("records"):
            names = ("value", "mean", "sd", "lo", "hi")
            numbers = (scale[column.measure] * float(row[name]) for name in names)
            values[str(row["model"]), column.heading] = Value(*numbers)
    return values


@dataclass(frozen=True)
class Floor:
    """The strongest baseline that never sees the goal, and its value as tables show it."""

    name: str
    value: float

    def is_below(self, value: Value, better: Better) -> bool | None:
        """True if the interval of a value lies wholly on the better side; None without interval."""
        if math.isnan(value.lo) or math.isnan(value.hi):
            return None
        return value.lo > self.value if better == "higher" else value.hi < self.value


def blind_baselines(run: Run, track: str) -> set[str]:
    """Return the models of a run that are baselines of a track which never see the goal."""
    named = {floor for measure in track_measures(track) for floor in measure.floors}
    return named & {model.name for model in run.manifest.models if model.is_baseline}


def headline_floors(run: Run, track: str) -> dict[str, Floor]:
    """Return the strongest blind baseline, or uniform guessing, of each headline column that has
    one, by heading.
    """
    values, blind = headline_of(run, track), blind_baselines(run, track)
    measures = {measure.name: measure for measure in track_measures(track)}
    found: dict[str, Floor] = {}
    for column in headline_columns(run, track):
        measure = measures[column.measure]
        known = [
            Floor(model, value.value)
            for (model, heading), value in values.items()
            if heading == column.heading and model in blind and not math.isnan(value.value)
        ]
        if measure.chance is not None and any(head == column.heading for _, head in values):
            known.append(Floor("chance", measure.scale * measure.chance(run, column.cell)))
        if known:
            best = max if measure.better == "higher" else min
            found[column.heading] = best(known, key=lambda floor: floor.value)
    return found
