"""A measure of a track in its cells, with intervals: the figure that any track has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from phyblock.plain_text import counted
from phyblock.report.measure_table import main_heading
from phyblock.tables.drawing import ACCENT, INK, MUTED, bare_axes, headed, new_figure
from phyblock.tables.headline import headline_rows
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, Measure
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.headline import headline_columns
from phyblock.tracks.kind import kind_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from phyblock.tables.track_report import HeadlineColumn

__all__ = ["main_measure", "measure_bars"]

_ROW_IN = 0.24
_MOST_PANELS = 6
_ROOM = 1.18
_NONE = (np.nan, np.nan, np.nan)


def main_measure(track: str) -> Measure:
    """The first measure of a track: the one that is drawn and compared."""
    return kind_of(track).report().measures[0]


def measure_bars(run: Run, *, track: str) -> Figure | None:
    """A panel a cell, a bar a model with its 95 % interval; None where nothing was measured.

    Models are ranked by the cell that stands for the track, else by the last. Cells that are parts
    of a mean are left out.
    """
    measure = main_measure(track)
    columns = [c for c in headline_columns(run, track) if c.measure == measure.name]
    columns = columns[-_MOST_PANELS:]
    found = headline_rows(track_estimates(run, track), run.design)
    found = found[found["measure"] == measure.name]
    drawn = [_values(found, column, measure) for column in columns]
    sign = -1 if measure.better == "higher" else 1
    heading = main_heading(run, track)
    leading = next((n for n, c in enumerate(columns) if c.heading == heading), len(columns) - 1)
    main = drawn[leading]
    measured = (name for name in run.design.model_names if not np.isnan(main.get(name, _NONE)[0]))
    models = sorted(measured, key=lambda name: (sign * main[name][0], name))
    if not models:
        return None
    figure = new_figure(1.05 + _ROW_IN * len(models))
    axes = figure.subplots(1, len(columns), sharey=True, squeeze=False)[0]
    shown = [np.array([values.get(name, _NONE) for name in models]) for values in drawn]
    longest = 100.0 if measure.unit == "%" else np.nanmax([np.nanmax(v) for v in shown])
    unit = f" ({measure.unit})" if measure.unit else ""
    for ax, column, values in zip(axes, columns, shown, strict=True):
        _bars(ax, values, longest, INK if column is columns[leading] else ACCENT)
        ax.set(title=column.heading, xlabel=f"{measure.heading}{unit}")
        if measure.unit == "%":
            ax.set_xticks([0, 50, 100])
    axes[0].set_yticks(np.arange(len(models)), models)
    axes[0].set_ylim(len(models) - 0.4, -0.6)
    bare_axes(axes)
    title = f"{kind_of(track).title}: {measure.heading}"
    headed(figure, title, _subtitle(run, track, int(found["n_clusters"].max())))
    return figure


def _values(
    rows: pd.DataFrame, column: HeadlineColumn, measure: Measure
) -> dict[str, tuple[float, ...]]:
    """By model, the value of a cell and the ends of its interval, in the measure's unit."""
    rows = rows[rows[CELL] == column.cell]
    if column.criterion:
        rows = rows[rows["criterion"] == column.criterion]
    return {
        row["model"]: tuple(measure.scale * float(row[name]) for name in ("value", "lo", "hi"))
        for row in rows.to_dict("records")
    }


def _bars(ax: Axes, values: NDArray[np.float64], longest: float, color: str) -> None:
    """Draw a bar a row of `values` (value, low, high; NaN: not measured), its number behind it."""
    value, lo, hi = values.T
    places = np.arange(len(value))
    ax.barh(places, np.nan_to_num(value), height=0.62, color=color, alpha=0.85, linewidth=0)
    sure = ~np.isnan(value) & ~np.isnan(lo)
    for line, width in (("white", 2.8), (MUTED, 1.1)):
        ax.hlines(places[sure], lo[sure], hi[sure], color=line, linewidth=width)
    for place in np.flatnonzero(~np.isnan(value)).tolist():
        end = np.nanmax([value[place], hi[place]]) + 0.02 * longest
        ax.text(end, place, f"{value[place]:.1f}", va="center", fontsize=6.5, color=INK)
    ax.set_xlim(0, _ROOM * longest)


def _subtitle(run: Run, track: str, clusters: int) -> str:
    suite = f"Suite {run.design.suite.name}; " if run.design.suite.name else ""
    notes = kind_of(track).report().notes(run)[:1]
    how = "".join(note.partition(". ")[0].rstrip(".") + "; " for note in notes)
    return f"{suite}{how}lines: 95 % intervals over {counted(clusters, 'base scene')}"
