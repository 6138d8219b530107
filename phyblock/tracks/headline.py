"""The columns that stand for a track, and the one of them that models are ranked by."""

from __future__ import annotations

from phyblock.tables.load import Run
from phyblock.tables.measures import Measure
from phyblock.tables.track_report import HeadlineColumn
from phyblock.tracks.estimates import track_measures
from phyblock.tracks.kind import kind_of

__all__ = ["headline_columns", "main_column", "main_measure"]


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
