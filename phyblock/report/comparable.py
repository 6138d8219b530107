"""What is compared: a measure in a cell, on the samples that two models both have."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from phyblock.errors import Problem, SpecError
from phyblock.scoring.counts import Floats, Metric
from phyblock.tables.design import Design
from phyblock.tables.estimates import pooled_in, value_of_cells
from phyblock.tables.headline import headline_rows
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, Cell, Measure
from phyblock.tracks.estimates import (
    counted_samples,
    headline_columns,
    main_measure,
    track_measures,
)
from phyblock.tracks.kind import kind_of, kinds

__all__ = ["Comparable", "Part", "comparable", "comparable_tracks"]

_KEYS = ["scene", "item", "seed", "variant"]


@dataclass(frozen=True)
class Part:
    """What one row of a pair is about: a cell, and the way of counting where there are several."""

    name: str
    cell: str
    criterion: str = ""


@dataclass(frozen=True)
class Comparable:
    """A measure of a track, as two models are compared by it.

    `parts` are the rows of one pair, of which the last stands for all; `how` says what the values
    are.
    """

    track: str
    measure: Measure
    cells: tuple[Cell, ...]
    parts: tuple[Part, ...]
    how: str

    def pooled(self, part: Part) -> tuple[str, ...]:
        """The pooled cells that a part is made of."""
        (cell,) = (cell for cell in self.cells if cell.name == part.cell)
        members = pooled_in(cell, self.cells)
        return tuple(cell.name for cell in self.cells if cell.name in members)

    def samples(self, run: Run, part: Part, design: Design) -> dict[str, pd.DataFrame]:
        """Counts of a part by model, by scene, item, seed and variant, with its pooled cell."""
        pooled = self.pooled(part)
        rows = counted_samples(replace(run, design=design), self.track, self.measure.counted)
        rows = headline_rows(rows[rows[CELL].isin(pooled)], design)
        if part.criterion:
            rows = rows[rows["criterion"] == part.criterion]
        heard = rows.groupby(["model", CELL])["replied"].transform("any")
        rows = rows[heard.astype(bool)]
        place = {name: number for number, name in enumerate(pooled)}
        indexed = rows.assign(pooled_cell=rows[CELL].map(place)).set_index(_KEYS)
        columns = ["pooled_cell", *self.measure.counted.columns]
        return {str(model): mine[columns] for model, mine in indexed.groupby("model", sort=False)}

    def values(self, run: Run, part: Part, design: Design) -> Iterator[tuple[str, pd.Series]]:
        """What each sample is worth in the measure's unit, by model; by scene, item, seed and
        variant, without samples that have no value.
        """
        each = self.each(part)
        for model, samples in self.samples(run, part, design).items():
            worth = self.measure.scale * each(self.counts_of(samples, part))
            yield model, pd.Series(worth, index=samples.index.set_names(_KEYS)).dropna()

    def counts(self, both: pd.DataFrame, part: Part) -> Floats:
        """Counts of paired samples, flat over pooled cells: (samples, 2, pooled x (columns + 1)).

        Behind the columns of each pooled cell stands how many samples it has.
        """
        return np.stack([self.counts_of(pd.DataFrame(both[name]), part) for name in "ab"], axis=1)

    def counts_of(self, samples: pd.DataFrame, part: Part) -> Floats:
        """Counts of samples of one model, in the form of `counts` without its second axis."""
        columns = list(self.measure.counted.columns)
        counts = np.zeros((len(samples), len(self.pooled(part)), len(columns) + 1))
        rows, pooled_cell = np.arange(len(samples)), samples["pooled_cell"].to_numpy(np.intp)
        counts[rows, pooled_cell, :-1] = samples[columns].to_numpy(np.float64)
        counts[rows, pooled_cell, -1] = 1
        return counts.reshape(len(samples), -1)

    def n_counts(self, part: Part) -> int:
        """Length of the last axis of `counts`."""
        return len(self.pooled(part)) * (len(self.measure.counted.columns) + 1)

    def each(self, part: Part) -> Metric:
        """What one sample is worth."""
        unflat = self._unflat(part)
        return lambda sums: self.measure.value(unflat(sums)[..., :-1].sum(axis=-2))

    def whole(self, part: Part, totals: Floats) -> Metric:
        """What sums are worth; means are over the pooled cells of which `totals` have samples."""
        unflat, pooled = self._unflat(part), self.pooled(part)
        values = value_of_cells(self.measure, self.cells_of(part), pooled)
        asked = unflat(totals)[..., -1] > 0

        def metric(sums: Floats) -> Floats:
            # Sums without a pooled cell that was asked have no value.
            return np.asarray(values(unflat(sums)[..., :-1], asked)[..., -1])

        return metric

    def cells_of(self, part: Part) -> tuple[Cell, ...]:
        """The cells below a part, and its own as the last."""
        reached = {part.cell}
        for cell in reversed(self.cells):
            reached |= set(cell.of) if cell.name in reached else set()
        return tuple(cell for cell in self.cells if cell.name in reached)

    def _unflat(self, part: Part) -> Callable[[Floats], Floats]:
        shape = (len(self.pooled(part)), len(self.measure.counted.columns) + 1)
        return lambda sums: np.asarray(sums.reshape(*sums.shape[:-1], *shape))


def comparable_tracks() -> tuple[str, ...]:
    """Tracks that have a measure, in the order in which one is chosen for runs of several."""
    return tuple(kinds())


def comparable(run: Run, track: str, measure: str = "") -> Comparable:
    """A measure of a track of a run, the main one where none is named.

    Raises SpecError for a measure that the track has not.
    """
    known = {one.name: one for one in track_measures(track)}
    if measure and measure not in known:
        message, allowed = "has no such measure", ", ".join(known)
        raise SpecError(Problem(f"track {track}", message, "--measure", measure, allowed))
    chosen = known[measure] if measure else main_measure(run, track)
    report = kind_of(track).report()
    cells = report.cells(run)
    shown = report.headline(run) if report.headline is not None else ()
    criteria = [s.criterion for s in shown if s.measure == chosen.name and s.criterion]
    parts = [Part(cell.name, cell.name) for cell in cells if not _is_single(cell, cells)]
    if criteria:
        parts = [
            Part(criterion, part.cell, criterion)
            for part in parts
            for criterion in reversed(criteria)
        ]
    is_headline = chosen.name in {column.measure for column in headline_columns(run, track)}
    notes = report.notes(run) if is_headline else ()
    how = " ".join((f"{chosen.heading}: {chosen.meaning}.", *notes, "Samples that both have."))
    return Comparable(track, chosen, cells, tuple(parts), how)


def _is_single(cell: Cell, cells: tuple[Cell, ...]) -> bool:
    """Whether a cell is a part of a mean and pooled itself: too small to be compared alone."""
    return not cell.of and any(cell.name in other.of for other in cells)
