"""The estimates of a track in a run: all its measures, in all its cells, made once."""

from __future__ import annotations

import pandas as pd

from phyblock.registry import added_measures
from phyblock.tables.estimates import ESTIMATE_COLUMNS, estimate_frame
from phyblock.tables.load import Run
from phyblock.tables.measures import Measure
from phyblock.tracks.kind import kind_of

__all__ = ["all_estimates", "track_estimates", "track_measures"]


def track_measures(track: str) -> tuple[Measure, ...]:
    """The measures of a track, those that were added behind its own."""
    return (*kind_of(track).report().measures, *added_measures(track))


def track_estimates(run: Run, track: str) -> pd.DataFrame:
    """See `estimate_frame`; the same frame whenever it is asked for, not to be changed."""
    key = f"estimates of {track}"
    if key not in run.made:
        cells = kind_of(track).report().cells(run)
        run.made[key] = estimate_frame(run, track_measures(track), cells)
    return run.made[key]


def all_estimates(run: Run) -> pd.DataFrame:
    """One long frame: every track of the run, measure, way of counting, model and cell."""
    parts = [track_estimates(run, track).assign(track=track) for track in run.design.suite.tracks]
    known = [part for part in parts if len(part)]
    columns = ["track", *ESTIMATE_COLUMNS]
    return pd.concat(known, ignore_index=True)[columns] if known else pd.DataFrame(columns=columns)
