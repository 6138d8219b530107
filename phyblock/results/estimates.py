"""Estimates of every measure in every cell, with their spread over seeds and their intervals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
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
from phyblock.types import WITHOUT_REPLY

ESTIMATE_COLUMNS = (
    *("measure", "model", *SCORED_BY, CELL, "n", "value", "seeds", "mean", "sd", "least", "most"),
    *("lo", "hi", "se", "n_scenes", "n_clusters"),
)


@dataclass(frozen=True, eq=False)
class Rows:
    """Counts of samples, a row a sample and way of counting it.

    `counts` has the columns of the counts. `about` has, by row, the place of its record
    among the records of the run, its item, and the columns of `SCORED_BY`. `cells` says by pooled
    cell which rows are in it; a row may be in several.
    """

    run: Run
    about: pd.DataFrame
    counts: pd.DataFrame
    cells: Mapping[str, NDArray[np.bool_]]

    def codes(
        self, of: NDArray[np.intp], *names: str
    ) -> tuple[NDArray[np.intp], list[tuple[str, ...]]]:
        """Return numbers of the values of these rows in some columns, and the values, sorted."""
        codes = np.zeros(len(of), dtype=np.intp)
        values: list[tuple[str, ...]] = [()]
        for name in names:
            is_own = name in SCORED_BY
            column = (self.about if is_own else self.run.records)[name].astype("category")
            own = column.cat.codes.to_numpy(np.intp)
            own = own[of if is_own else self.about["place"].to_numpy()[of]]
            known = list(column.cat.categories)
            numbers, codes = np.unique(codes * len(known) + own, return_inverse=True)
            codes = codes.reshape(-1)
            values = [(*values[n // len(known)], known[n % len(known)]) for n in numbers]
        return codes, values

    @property
    def replied(self) -> NDArray[np.bool_]:
        """True for rows of samples on which the model said anything; a refusal does."""
        outcomes = self.run.records["outcome"].isin(WITHOUT_REPLY).to_numpy()
        return np.asarray(~outcomes[self.about["place"].to_numpy()])


def counted_rows(run: Run, track: str, counted: SampleCounts) -> Rows:
    """Return the counts of a track's samples that measures are made from; see `SampleCounts`.

    Raises StoreError for stored counts of another number than the measure has now.
    """
    table = counted.frame(run) if counted.frame is not None else _stored(run, track, counted)
    places = run.records.index.get_indexer(pd.Index(table["row"]))
    items = table["item"] if "item" in table else run.records["item"].to_numpy()[places]
    ways = {name: np.asarray(table[name]) if name in table else "" for name in SCORED_BY}
    about = pd.DataFrame({"place": places, "item": np.asarray(items), **ways})
    counts = table[list(counted.columns)]
    everything = np.ones(len(table), dtype=bool)
    cells = {cell.name: everything for cell in counted.cells}
    return Rows(run, about, counts, cells or kind_of(track).report().in_cells(table, run))


def _stored(run: Run, track: str, counted: SampleCounts) -> pd.DataFrame:
    """Counts that records hold."""
    none: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
    rows, lengths, numbers = run.counts.get(counted.name, (none, none, np.zeros(0)))
    starts, width = np.cumsum(lengths) - lengths, len(counted.columns)
    kept = np.isin(rows, run.counted_rows(track)) & (lengths > 0)
    rows, starts, lengths = rows[kept], starts[kept], lengths[kept]
    for length in np.unique(lengths):
        check_numbers(counted, int(length), str(run.path / RECORDS))
    counts = numbers[starts[:, None] + np.arange(width)]
    table = pd.DataFrame(counts, columns=list(counted.columns)).assign(row=rows)
    return table.sort_values("row", kind="stable", ignore_index=True)


def check_numbers(counted: SampleCounts, found: int, where: str) -> None:
    """Raise StoreError where a record has not as many numbers as the counts have columns."""
    if found != len(counted.columns):
        message, hint = "was counted in another way", "phyblock score counts anew"
        numbers, allowed = f"{found} numbers", ", ".join(counted.columns)
        raise StoreError(Problem(where, message, f"counts.{counted.name}", numbers, allowed, hint))


def base_scenes(run: Run) -> dict[str, tuple[str, ...]]:
    """Return the base scenes of each scene, itself where it has no others."""
    first = run.records.drop_duplicates("scene")
    return {
        scene: tuple(parents) or (scene,)
        for scene, parents in zip(first["scene"], first["parents"], strict=True)
    }


def estimate_frame(
    run: Run,
    measures: Sequence[Measure],
    cells: Sequence[Cell],
    rows_of: Callable[[SampleCounts], Rows],
) -> pd.DataFrame:
    """One row a measure, model, way of counting and cell, in `ESTIMATE_COLUMNS`.

    `value` is of the counts of all `n` samples, summed over scenes and seeds, in the measure's own
    unit; `mean`, `sd` (ddof = 1), `least` and `most` are over the values of the `seeds` single
    seeds. `lo` and `hi` bound a 95 % interval and `se` is the standard error, from leaving out the
    `n_clusters` base scenes that the `n_scenes` scenes were made from; a scene's seeds stay
    together. Where a model said nothing at all in a cell, nothing was measured: NaN.
    """
    found: list[tuple[object, ...]] = []
    families: dict[str, list[Measure]] = {}
    for measure in measures:
        families.setdefault(measure.counted.name, []).append(measure)
    parents = base_scenes(run)
    for family in families.values():
        rows, own = rows_of(family[0].counted), family[0].counted.cells or cells
        # Cells that means join are estimated together.
        joined = [own] if any(cell.of for cell in own) else [[cell] for cell in own]
        for together in joined:
            found += _estimates(_Pool.of(rows, together, parents), family, together)
    return pd.DataFrame(found, columns=list(ESTIMATE_COLUMNS))


@dataclass(frozen=True, eq=False)
class _Pool:
    """Sums of counts by model and way of counting (`groups`), and by cell (`pooled`).

    `counts` has shape (scenes, groups, pooled, columns) and is summed over seeds; `rows`, (scenes,
    groups, pooled), says of how many rows. `of_seeds`, (seeds, groups, pooled, columns), is summed
    over scenes, NaN where a seed has no row. Where a model said nothing at all, (groups, pooled),
    it is `silent`.
    """

    groups: list[tuple[str, ...]]
    pooled: list[str]
    counts: Floats
    rows: NDArray[np.intp]
    of_seeds: Floats
    silent: NDArray[np.bool_]
    clusters: Clusters

    @classmethod
    def of(cls, rows: Rows, cells: Sequence[Cell], parents: Mapping[str, tuple[str, ...]]) -> _Pool:
        """Pool rows in those of the cells that are no means of others."""
        pooled = [cell.name for cell in cells if not cell.of]
        used = np.flatnonzero(np.logical_or.reduce([rows.cells[name] for name in pooled]))
        masks = [rows.cells[name][used] for name in pooled]
        # Numbers of four bytes stay so: sums are of eight.
        columns = [np.nan_to_num(column.to_numpy()[used]) for _, column in rows.counts.items()]
        group, groups = rows.codes(used, "model", *SCORED_BY)
        model, models = rows.codes(used, "model")
        scene, scenes = rows.codes(used, "scene")
        seed, seeds = rows.codes(used, "seed")
        counts, n_rows = _summed(columns, masks, (scene, group), (len(scenes), len(groups)))
        of_seeds, in_seed = _summed(columns, masks, (seed, group), (len(seeds), len(groups)))
        of_seeds[in_seed == 0] = np.nan
        heard = _summed([rows.replied[used]], masks, (model,), (len(models),))[0][..., 0]
        silent = heard[[models.index(one[:1]) for one in groups]] == 0
        clusters = Clusters.of([parents[name] for (name,) in scenes])
        return cls(groups, pooled, counts, n_rows, of_seeds, silent, clusters)


def _summed(
    columns: Sequence[NDArray[Any]],
    masks: Sequence[NDArray[np.bool_]],
    codes: Sequence[NDArray[np.intp]],
    shape: tuple[int, ...],
) -> tuple[Floats, NDArray[np.intp]]:
    """Sums of columns by codes and masks, (*shape, masks, columns), and of how many rows."""
    size = int(np.prod(shape))
    sums = np.zeros((size, len(masks), len(columns)))
    rows = np.zeros((size, len(masks)), dtype=np.intp)
    flat = np.ravel_multi_index(tuple(codes), shape) if size else np.zeros(0, dtype=np.intp)
    for place, mask in enumerate(masks):
        rows[:, place] = np.bincount(flat[mask], minlength=size)
        for n, column in enumerate(columns):
            sums[:, place, n] = np.bincount(flat[mask], column[mask], size)
    return sums.reshape(*shape, *sums.shape[1:]), rows.reshape(*shape, len(masks))


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


def _estimates(
    pool: _Pool, measures: Sequence[Measure], cells: Sequence[Cell]
) -> Iterator[tuple[object, ...]]:
    """Estimates of measures with the same counts, in cells that are estimated together."""
    if not pool.groups:
        return
    present, clusters = pool.rows > 0, pool.clusters
    members = np.array([[n in pooled_in(cell, cells) for n in pool.pooled] for cell in cells])
    by_cell = clusters.behind(present.reshape(len(present), -1)).reshape(present.shape[1:])
    each = [np.any(present[:, :, own], axis=-1) for own in members]
    behind = np.stack([clusters.behind(one) for one in each], axis=-1)
    fewest = np.stack([by_cell[:, own].min(axis=-1) for own in members], axis=-1)

    def all_values(sums: Floats) -> Floats:
        # Where a model said nothing, empty plans have counts, and nothing was measured.
        heard = np.where(pool.silent[..., None], np.nan, sums)
        values = [value_of_cells(measure, cells, pool.pooled)(heard) for measure in measures]
        return np.stack(values, axis=-1)

    # A part of a single base scene leaves a mean without an interval.
    usable = np.where(fewest < 2, fewest, behind)[:, :, None]
    usable = np.repeat(usable, len(measures), axis=-1)
    estimate = jackknife(pool.counts, clusters, all_values, n_clusters=usable)
    within = in_range(estimate, [measure.end_of_range for measure in measures])
    spread = _over_seeds(all_values(pool.of_seeds))
    scenes = np.stack([one.sum(axis=0) for one in each], axis=-1)
    samples = pool.rows.sum(axis=0) @ members.T
    for at in np.ndindex(estimate.value.shape):
        g, c, m = at
        yield (
            *(measures[m].name, *pool.groups[g], cells[c].name, int(samples[g, c])),
            *(estimate.value[at], *(values[at] for values in spread)),
            *(within.lo[at], within.hi[at], estimate.se[at]),
            *(int(scenes[g, c]), int(behind[g, c])),
        )


def _over_seeds(each: Floats) -> tuple[NDArray[np.intp], Floats, Floats, Floats, Floats]:
    """Number of seeds with a value; mean, sample standard deviation, least and most over them."""
    known = ~np.isnan(each)
    count = known.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = np.where(known, each, 0).sum(axis=0) / np.where(count, count, np.nan)
        square = np.where(known, (each - mean) ** 2, 0).sum(axis=0)
        sd = np.sqrt(square / np.where(count > 1, count - 1, np.nan))
    return count, mean, sd, np.fmin.reduce(each), np.fmax.reduce(each)


def pooled_in(cell: Cell, cells: Sequence[Cell]) -> frozenset[str]:
    """The pooled cells that a cell is made of."""
    if not cell.of:
        return frozenset([cell.name])
    by_name = {other.name: other for other in cells}
    return frozenset().union(*(pooled_in(by_name[name], cells) for name in cell.of))


def track_measures(track: str) -> tuple[Measure, ...]:
    """The measures of a track, those that were added behind its own.

    Raises ValueError where two measures, or two sorts of counts, have one name.
    """
    measures = (*kind_of(track).report().measures, *added_measures(track))
    for named in (measures, {measure.counted for measure in measures}):
        names = [one.name for one in named]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"two measures or counts of {track} are called {', '.join(twice)}")
    return measures


def track_estimates(run: Run, track: str) -> pd.DataFrame:
    """See `estimate_frame`; the same frame whenever it is asked for, not to be changed."""
    if track not in run.made:
        measures, cells = track_measures(track), kind_of(track).report().cells(run)
        run.made[track] = estimate_frame(
            run, measures, cells, lambda counted: counted_rows(run, track, counted)
        )
    return run.made[track]


def all_estimates(run: Run) -> pd.DataFrame:
    """One long frame: every track of the run, measure, way of counting, model and cell."""
    parts = [track_estimates(run, track).assign(track=track) for track in run.design.suite.tracks]
    known = [part for part in parts if len(part)]
    columns = ["track", *ESTIMATE_COLUMNS]
    return pd.concat(known, ignore_index=True)[columns] if known else pd.DataFrame(columns=columns)


def headline_columns(run: Run, track: str) -> tuple[HeadlineColumn, ...]:
    """The columns of a track's headline: those it chooses, else its first measure in every cell."""
    report = kind_of(track).report()
    if report.headline is not None:
        return report.headline(run)
    first = report.measures[0]
    return tuple(HeadlineColumn(first.name, cell.name, cell.heading) for cell in report.cells(run))


def main_column(run: Run, track: str) -> HeadlineColumn:
    """The column that models are ranked by: the one headed as the track says, else the last."""
    columns, main = headline_columns(run, track), kind_of(track).report().main
    return next((column for column in columns if column.heading == main), columns[-1])


def main_measure(run: Run, track: str) -> Measure:
    """The measure of that column: the one that is drawn, compared and ranked by."""
    name = main_column(run, track).measure
    return next(measure for measure in track_measures(track) if measure.name == name)


@dataclass(frozen=True)
class Value:
    """An estimate as tables show it, in the unit of its measure (percent for shares).

    `value` is of all samples, pooled over seeds; `lo` and `hi` are NaN where there is no interval.
    """

    value: float
    lo: float
    hi: float


def headline_rows(estimates: pd.DataFrame, design: Design) -> pd.DataFrame:
    """The rows of a frame of estimates in the headline setting and matcher."""
    return estimates[
        estimates["setting"].isin(["", design.setting])
        & estimates["matcher"].isin(["", design.matcher])
    ]


def headline_of(run: Run, track: str, design: Design | None = None) -> dict[tuple[str, str], Value]:
    """Return the values of a track's headline by model and heading, in the headline setting of
    the run or of another `design`.
    """
    scale = {measure.name: measure.scale for measure in track_measures(track)}
    rows = headline_rows(track_estimates(run, track), design or run.design)
    values = {}
    for column in headline_columns(run, track):
        mine = rows[(rows["measure"] == column.measure) & (rows[CELL] == column.cell)]
        for row in mine.to_dict("records"):
            if column.criterion in ("", row["criterion"]):
                numbers = (scale[column.measure] * float(row[n]) for n in ("value", "lo", "hi"))
                values[str(row["model"]), column.heading] = Value(*numbers)
    return values


def main_values(run: Run, track: str, *, ranked: bool = False) -> dict[str, Value]:
    """Return the main value of each model that has one; with `ranked`, the best first."""
    main = main_column(run, track).heading
    values = {
        model: value
        for (model, heading), value in headline_of(run, track).items()
        if heading == main and not math.isnan(value.value)
    }
    if not ranked:
        return values
    sign = -1 if main_measure(run, track).better == "higher" else 1
    return dict(sorted(values.items(), key=lambda item: (sign * item[1].value, item[0])))


@dataclass(frozen=True)
class Floor:
    """The strongest baseline that never sees the goal, and its value as tables show it."""

    name: str
    value: float

    def is_below(self, value: Value, better: Better) -> bool:
        """True if the interval of a value lies wholly on the better side."""
        return value.lo > self.value if better == "higher" else value.hi < self.value


def headline_floors(run: Run, track: str) -> dict[str, Floor]:
    """Return the strongest blind baseline, or uniform guessing, of each headline column that has
    one, by heading.
    """
    values, measures = headline_of(run, track), {one.name: one for one in track_measures(track)}
    blind = run.design.baselines & {name for one in measures.values() for name in one.floors}
    found: dict[str, Floor] = {}
    for column in headline_columns(run, track):
        measure = measures[column.measure]
        mine = {model: value for (model, of), value in values.items() if of == column.heading}
        known = [
            Floor(model, value.value)
            for model, value in mine.items()
            if model in blind and not math.isnan(value.value)
        ]
        if measure.chance is not None and mine:
            known.append(Floor("chance", measure.scale * measure.chance(run, column.cell)))
        if known:
            best = max if measure.better == "higher" else min
            found[column.heading] = best(known, key=lambda floor: floor.value)
    return found
