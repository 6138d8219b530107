"""The estimates of a track in a run: all its measures, in all its cells, made once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from phyblock.errors import Problem, StoreError
from phyblock.records.files import RECORDS
from phyblock.registry import added_measures
from phyblock.tables.estimates import ESTIMATE_COLUMNS, estimate_frame
from phyblock.tables.load import Run
from phyblock.tables.measures import SCORED_BY, Measure, SampleCounts
from phyblock.tables.outcomes import has_reply
from phyblock.tables.track_report import HeadlineColumn
from phyblock.tracks.kind import kind_of


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
    """What a record at `where` holds of these counts; None where they are lacking, () for none.

    Raises StoreError for another number of them than the measure has now.
    """
    numbers = (counts or {}).get(counted.name)
    if numbers and len(numbers) != len(counted.columns):
        found, allowed = f"{len(numbers)} numbers", ", ".join(counted.columns)
        message, hint = "was counted in another way", "phyblock score counts anew"
        raise StoreError(Problem(where, message, f"counts.{counted.name}", found, allowed, hint))
    return numbers


def samples_lacking(run: Run, track: str, counted: SampleCounts) -> int:
    """Samples that were judged before these counts were there."""
    if counted.sample is None:
        return 0
    rows = run.records[run.records["track"] == track]
    return sum(counted.name not in (counts or {}) for counts in rows["counts"])


def stored_counts(track: str) -> tuple[SampleCounts, ...]:
    """What measures of a track count of each sample as it is judged."""
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
        **dict.fromkeys(SCORED_BY, ""), replied=has_reply(rows)
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
