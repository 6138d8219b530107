"""Estimates of every measure in every cell, with their spread over seeds and their intervals."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import jinja2
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from phyblock.errors import Problem, StoreError
from phyblock.records.files import RECORDS
from phyblock.results.load import Design, Run, track_measures
from phyblock.scoring.plan import Floats
from phyblock.scoring.statistics import Clusters, in_range, jackknife
from phyblock.tracks.base import kind_of
from phyblock.tracks.measures import OVERALL, SCORED_BY, Cell, LayoutColumn, Measure, SampleCounts
from phyblock.types import WITHOUT_REPLY

ESTIMATE_COLUMNS = (
    *("measure", "model", *SCORED_BY, "cell", "n", "value", "seeds", "mean", "sd", "least", "most"),
    *("lo", "hi", "se", "n_scenes", "n_clusters"),
)
_ABOUT = ["model", "scene", "item", "seed", "variant"]


@dataclass(frozen=True, eq=False)
class Rows:
    """Counts of samples, with a row per sample and way of scoring it.

    `about` has for each row its model, scene, item, seed, variant, the columns of `SCORED_BY`, and
    `replied`, true if the model replied at all; a refusal is a reply. `counts` has shape (rows,
    columns). `cells` has for each cell that is not a mean the mask of its rows, which may overlap.
    """

    about: pd.DataFrame
    counts: Floats
    cells: Mapping[str, NDArray[np.bool_]]


def counted_rows(
    run: Run, track: str, counted: SampleCounts, cells: Iterable[Cell], design: Design | None = None
) -> Rows:
    """Return the counts of a track's samples in these cells.

    Samples that the design's policy on missing replies excludes (by default the run's) are left out
    with their group. Raises StoreError if the number of stored counts is not the measure's.
    """
    design = design or run.design
    records = run.records[run.records["track"] == track]
    group = ["model", "group", "seed", "variant"]
    if design.outcomes_left_out:
        records = records.assign(out=records["outcome"].isin(design.outcomes_left_out))
        records = records[~records.groupby(group)["out"].transform("any").astype(bool)]
    held, width = run.counts.get((track, counted.name)), len(counted.columns)
    if held is None:
        held = pd.DataFrame(columns=["row", *SCORED_BY, *range(width)]).astype({"row": "intp"})
    held = held[held["row"].isin(records.index)]
    numbers = held.iloc[:, 1 + len(SCORED_BY) :].to_numpy(np.float64)
    if len(held) and (set(widths := (~np.isnan(numbers)).sum(axis=1)) != {width}):
        message, hint = "was counted in another way", "phyblock score counts again"
        found = f"{', '.join(map(str, sorted({*widths.tolist()} - {width})))} numbers"
        where, allowed = str(run.path / RECORDS), ", ".join(counted.columns)
        raise StoreError(Problem(where, message, f"counts.{counted.name}", found, allowed, hint))
    records = records.loc[held["row"]]
    about = records[[*_ABOUT, "group", "levels", "part"]].reset_index(drop=True)
    about["replied"] = ~records["outcome"].isin(WITHOUT_REPLY).to_numpy()
    about[[*SCORED_BY]] = held[[*SCORED_BY]].to_numpy(object)
    if counted.parts is not None:
        whole, groups = counted.parts(design.suite), about.groupby(group, sort=True)
        _, first = np.unique(code := groups.ngroup().to_numpy(), return_index=True)
        right = np.bincount(code, numbers[:, 0], len(first)) == whole
        about["replied"] = groups["replied"].transform("any").astype(bool)
        about = about.assign(item=about["group"]).iloc[first].reset_index(drop=True)
        numbers = np.stack([right, np.ones(len(first))], axis=-1)
    return Rows(about, numbers, dict(_masks(about, counted.cells or cells)))


def _masks(about: pd.DataFrame, cells: Iterable[Cell]) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Yield the cells that are not means with the masks of their rows, by level, part or all."""
    code, held = pd.factorize(about["levels"].to_numpy())
    for cell in cells:
        if cell.of:
            continue
        inside = np.array([cell.name in map(str, levels) for levels in held], dtype=bool)
        mask = np.full(len(about), cell.name == OVERALL) | (about["part"] == cell.name).to_numpy()
        mask |= inside[code]
        if cell.criterion:
            mask &= about["criterion"].isin(["", cell.criterion]).to_numpy()
        yield cell.name, mask


def base_scenes(run: Run) -> dict[str, tuple[str, ...]]:
    """Return the base scenes of each scene, which may be the scene itself."""
    first = run.records.drop_duplicates("scene")
    return {
        scene: tuple(parents) or (scene,)
        for scene, parents in zip(first["scene"], first["parents"], strict=True)
    }


def track_estimates(run: Run, track: str) -> pd.DataFrame:
    """Return one row per measure, model, way of counting and cell, in `ESTIMATE_COLUMNS`.

    `value` is from the counts of all `n` samples, summed over scenes and seeds, in the measure's
    own unit; `mean`, `sd` (ddof = 1), `least` and `most` are over the values of the `seeds` single
    seeds. `lo` and `hi` bound a 95 % interval and `se` is the standard error, from leaving out the
    `n_clusters` base scenes that the `n_scenes` scenes were made from; a scene's seeds stay
    together. Values of a model without replies in a cell are NaN. Do not change the cached frame.
    """
    if track in run.made:
        return run.made[track]
    found: list[tuple[object, ...]] = []
    families: dict[SampleCounts, list[Measure]] = {}
    for measure in track_measures(track):
        families.setdefault(measure.counted, []).append(measure)
    parents, cells = base_scenes(run), run.cells(track)
    for counted, family in families.items():
        rows, own = counted_rows(run, track, counted, cells), counted.cells or cells
        # Cells that share a mean are estimated together.
        for together in [own] if any(cell.of for cell in own) else [[cell] for cell in own]:
            found += _estimates(rows, parents, family, together)
    run.made[track] = pd.DataFrame(found, columns=list(ESTIMATE_COLUMNS))
    return run.made[track]


def _sums(
    counts: Floats,
    masks: Sequence[NDArray[np.bool_]],
    codes: Sequence[NDArray[np.intp]],
    shape: tuple[int, ...],
) -> tuple[Floats, NDArray[np.intp]]:
    """Return sums of counts by codes and masks, (*shape, masks, columns), and numbers of rows."""
    size, flat = int(np.prod(shape)), np.ravel_multi_index(tuple(codes), shape)
    sums = np.zeros((size, len(masks), counts.shape[1]))
    rows = np.zeros((size, len(masks)), dtype=np.intp)
    for place, mask in enumerate(masks):
        rows[:, place] = np.bincount(flat[mask], minlength=size)
        for n, column in enumerate(counts.T):
            sums[:, place, n] = np.bincount(flat[mask], column[mask], size)
    return sums.reshape(*shape, *sums.shape[1:]), rows.reshape(*shape, len(masks))


def cell_value(cell: Cell, cells: Mapping[str, Cell], single: Mapping[str, Floats]) -> Floats:
    """Return the values of a cell from `single`, those of cells that are not means.

    A mean is over the parts that are there, of which a cell must have at least one.
    """
    if not cell.of:
        return single[cell.name]
    there = [cells[name] for name in cell.of if single.keys() & pooled_in(cells[name], cells)]
    values = np.stack([cell_value(part, cells, single) for part in there], axis=-1)
    mean: Floats = values.sum(axis=-1) / len(there)
    return mean


def pooled_in(cell: Cell, cells: Mapping[str, Cell]) -> list[str]:
    """Return the cells that a cell is made of, without means."""
    parts = [name for part in cell.of for name in pooled_in(cells[part], cells)]
    return parts or [cell.name]


def _estimates(
    rows: Rows,
    parents: Mapping[str, tuple[str, ...]],
    measures: Sequence[Measure],
    cells: Sequence[Cell],
) -> Iterator[tuple[object, ...]]:
    """Yield estimates of measures with the same counts, in jointly estimated cells."""
    pooled = [cell.name for cell in cells if not cell.of]
    used = np.flatnonzero(np.logical_or.reduce([rows.cells[name] for name in pooled]))
    if not len(used):
        return
    about, masks = rows.about.iloc[used], [rows.cells[name][used] for name in pooled]
    ways = about.groupby(["model", *SCORED_BY], sort=True)
    group, groups = np.asarray(ways.ngroup(), dtype=np.intp), list(ways.size().index)
    (scene, scenes), (seed, seeds), (model, models) = (
        pd.factorize(about[name], sort=True) for name in ("scene", "seed", "model")
    )
    # (scenes, groups, pooled, columns), and the same summed over scenes by seed.
    given, n_rows = _sums(rows.counts[used], masks, (scene, group), (len(scenes), len(groups)))
    of_seeds, in_seed = _sums(rows.counts[used], masks, (seed, group), (len(seeds), len(groups)))
    of_seeds[in_seed == 0] = np.nan
    replied = about["replied"].to_numpy(np.float64)[:, None]
    heard = _sums(replied, masks, (model,), (len(models),))[0][..., 0]
    silent = heard[[list(models).index(one[0]) for one in groups]] == 0
    clusters, present = Clusters.of([parents[name] for name in scenes]), n_rows > 0
    by_name = {cell.name: cell for cell in cells}

    def all_values(sums: Floats) -> Floats:
        # Without any reply, empty plans have counts, but nothing was measured.
        spoken = np.where(silent[..., None], np.nan, sums)
        values = []
        for measure in measures:
            value = measure.value(spoken)
            known = {name: value[..., n] for n, name in enumerate(pooled)}
            values.append(np.stack([cell_value(c, by_name, known) for c in cells], axis=-1))
        return np.stack(values, axis=-1)

    members = np.array([[n in pooled_in(cell, by_name) for n in pooled] for cell in cells])
    by_cell = clusters.behind(present.reshape(len(present), -1)).reshape(present.shape[1:])
    each = [np.any(present[:, :, own], axis=-1) for own in members]
    behind = np.stack([clusters.behind(one) for one in each], axis=-1)
    fewest = np.stack([by_cell[:, own].min(axis=-1) for own in members], axis=-1)
    # A part with a single base scene leaves a mean without an interval.
    usable = np.repeat(np.where(fewest < 2, fewest, behind)[:, :, None], len(measures), axis=-1)
    estimate = jackknife(given, clusters, all_values, n_clusters=usable)
    within = in_range(estimate, [measure.end_of_range for measure in measures])
    each_seed = all_values(of_seeds)
    with warnings.catch_warnings():
        # Where no seed has a value, there is none.
        warnings.simplefilter("ignore", RuntimeWarning)
        mean, sd = np.nanmean(each_seed, axis=0), np.nanstd(each_seed, axis=0, ddof=1)
    ends = np.fmin.reduce(each_seed), np.fmax.reduce(each_seed)
    spread = ((~np.isnan(each_seed)).sum(axis=0), mean, sd, *ends)
    n_scenes = np.stack([one.sum(axis=0) for one in each], axis=-1)
    samples = n_rows.sum(axis=0) @ members.T
    for at in np.ndindex(estimate.value.shape):
        g, c, m = at
        yield (
            *(measures[m].name, *groups[g], cells[c].name, int(samples[g, c])),
            *(estimate.value[at], *(values[at] for values in spread)),
            *(within.lo[at], within.hi[at], estimate.se[at]),
            *(int(n_scenes[g, c]), int(behind[g, c])),
        )


def track_notes(run: Run, track: str) -> tuple[str, ...]:
    """Return sentences that explain how the values of a track are counted."""
    kind, suite = kind_of(track), run.design.suite
    spec = suite.section(kind.options) if kind.options else None
    facts = {"suite": suite, "spec": spec, "manifest": run.manifest}
    notes = (jinja2.Template(note).render(facts) for note in kind.report().notes)
    return tuple(filter(None, notes))


class HeadlineColumn(NamedTuple):
    """A measure in a cell as a column of a headline, with its `criterion` if there are several."""

    measure: str
    cell: str
    heading: str
    criterion: str = ""
    main: bool = False


class Value(NamedTuple):
    """An estimate as shown in tables, in the unit of its measure (percent for shares).

    `value` is over all samples, pooled over seeds; `lo` and `hi` are NaN without an interval.
    """

    value: float
    lo: float
    hi: float


class Floor(NamedTuple):
    """The strongest baseline that never sees the goal, and its value as shown in tables."""

    name: str
    value: float

    def is_below(self, value: Value, better: str) -> bool:
        """True if the interval of a value lies wholly on the better side."""
        return value.lo > self.value if better == "higher" else value.hi < self.value


def headline_rows(estimates: pd.DataFrame, design: Design) -> pd.DataFrame:
    """Return the rows of a frame of estimates in the headline setting and matcher."""
    return estimates[
        estimates["setting"].isin(["", design.setting])
        & estimates["matcher"].isin(["", design.matcher])
    ]


def shown_values(
    run: Run, track: str, design: Design | None = None
) -> dict[tuple[str, str, str, str], Value]:
    """Return the values of a track in the headline setting and matcher, by model, measure, cell
    and criterion. With the criterion "", a value is that of the last one.
    """
    scale = {measure.name: measure.scale for measure in track_measures(track)}
    rows = headline_rows(track_estimates(run, track), design or run.design)
    fields = ("model", "measure", "cell", "criterion", "value", "lo", "hi")
    found = {}
    for row in zip(*(rows[name].tolist() for name in fields), strict=True):
        model, measure, cell, criterion, *numbers = row
        value = Value(*(scale[measure] * float(number) for number in numbers))
        found[model, measure, cell, criterion] = found[model, measure, cell, ""] = value
    return found


@dataclass(frozen=True, eq=False)
class Headline:
    """The headline of a track of a run, which terminal, tables, figures and pages show first.

    It is in the headline setting of the run, or of another `design`.
    """

    run: Run
    track: str
    design: Design | None = None

    @cached_property
    def columns(self) -> tuple[HeadlineColumn, ...]:
        """The columns that the track declares, else its first measure in every cell."""
        report, cells = kind_of(self.track).report(), self.run.cells(self.track)
        first = LayoutColumn({report.measures[0].name: "{cell}"}, cells="each")
        return tuple(
            HeadlineColumn(name, cell.name, heading.format(cell=cell.heading), one.criterion,
                           one.main)
            for one in report.headline or (first,)
            for cell in one.places(cells)
            for name, heading in one.headings.items()
        )  # fmt: skip

    @property
    def main(self) -> HeadlineColumn:
        """The column that models are ranked by: the one marked as main, else the last."""
        return next((column for column in self.columns if column.main), self.columns[-1])

    @property
    def parts(self) -> list[HeadlineColumn]:
        """The columns with its measure in other cells, such as levels."""
        main = self.main
        return [c for c in self.columns if c.measure == main.measure and c.cell != main.cell]

    @property
    def measure(self) -> Measure:
        """The measure of the main column, used for figures, comparisons and ranks."""
        return next(one for one in track_measures(self.track) if one.name == self.main.measure)

    @cached_property
    def values(self) -> dict[tuple[str, str], Value]:
        """Its values by model and heading."""
        known = shown_values(self.run, self.track, self.design)
        return {
            (model, column.heading): known[model, column.measure, column.cell, column.criterion]
            for column in self.columns
            for model in self.run.design.model_names
            if (model, column.measure, column.cell, column.criterion) in known
        }

    @cached_property
    def ranked(self) -> dict[str, Value]:
        """The main value of each model that has one, best first."""
        main, sign = self.main.heading, -1 if self.measure.better == "higher" else 1
        values = [(model, value) for (model, heading), value in self.values.items()
                  if heading == main and not math.isnan(value.value)]  # fmt: skip
        return dict(sorted(values, key=lambda item: (sign * item[1].value, item[0])))

    @cached_property
    def floor(self) -> Floor | None:
        """The strongest blind baseline, or uniform guessing, in the main column."""
        run, measure, report = self.run, self.measure, kind_of(self.track).report()
        blind, guessed = run.design.baselines & set(report.floors), report.chance
        known = [Floor(model, one.value) for model, one in self.ranked.items() if model in blind]
        if guessed is not None and len(track_estimates(run, self.track)):
            cells = {cell.name: cell for cell in run.cells(self.track)}
            pooled = pooled_in(cell := cells[self.main.cell], cells)
            single = {name: np.asarray(guessed(run.design.suite, name)) for name in pooled}
            worth = float(cell_value(cell, cells, single))
            known.append(Floor("chance", measure.scale * worth))
        best = max if measure.better == "higher" else min
        return best(known, key=lambda floor: floor.value) if known else None
