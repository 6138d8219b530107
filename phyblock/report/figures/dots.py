"""A measure of a track in its cells, with intervals: the figure that any track has."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from phyblock.tables.drawing import (
    ACCENT,
    COLORS,
    INK,
    MARKERS,
    MUTED,
    bare_axes,
    drawn_width_in,
    headed,
    legend_below,
    names_width_in,
    new_figure,
)
from phyblock.tables.headline import headline_rows, rows_of
from phyblock.tables.load import Run
from phyblock.tables.measures import Measure
from phyblock.text import counted
from phyblock.tracks.estimates import headline_columns, main_column, main_measure, track_estimates
from phyblock.tracks.kind import kind_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from phyblock.tables.track_report import HeadlineColumn

__all__ = ["measure_dots"]

_ROW_IN = 0.19
_MOST_PANELS = 6
_LEAST_PANEL_IN, _LEAST_PLOT_IN = 0.82, 1.0
_THREE_IN = 1.2
"""From here on a panel has room for three numbers on its axis."""
_STEP = 20
"""Scales of shares end at a multiple of this [%]."""
_NUMBER_IN, _BETWEEN_IN = 0.36, 0.12
"""Room for a number beside the dots, and between panels [inches]."""
_NONE = (np.nan, np.nan, np.nan)


def measure_dots(run: Run, *, track: str) -> Figure | None:
    """A panel a cell, a dot a model with its 95 % interval; None where nothing was measured.

    The cell that stands for the track comes first, and models are ranked by it. Cells that are
    parts of a mean are left out. A figure too narrow for panels shows the first one, with the
    values of the other cells in it as small marks.
    """
    measure = main_measure(run, track)
    columns = _columns(run, track, measure)
    found = headline_rows(track_estimates(run, track), run.design)
    found = found[found["measure"] == measure.name]
    drawn = [_values(found, column, measure) for column in columns]
    models = _ranked(run, drawn[0], measure)
    if not models:
        return None
    shown = [np.array([values.get(name, _NONE) for name in models]) for values in drawn]
    least, longest = _range(np.concatenate(shown))
    if measure.unit == "%":
        longest = max(_STEP, _STEP * math.ceil(longest / _STEP))
    names_in = names_width_in(models)
    room_in = drawn_width_in(names_in + _LEAST_PLOT_IN) - names_in
    n_panels = len(columns) if room_in / len(columns) >= _LEAST_PANEL_IN else 1
    figure = new_figure(1.0 + _ROW_IN * len(models), names_in + _LEAST_PLOT_IN)
    axes = figure.subplots(1, n_panels, sharey=True, squeeze=False)[0]
    for ax, column, values in zip(axes, columns, shown, strict=False):
        beside = _NUMBER_IN / (room_in / n_panels - _NUMBER_IN - _BETWEEN_IN)
        edge = longest + (longest - least) * beside
        _dots(ax, values, (least, edge), INK if column is columns[0] else ACCENT)
        ax.set(title=column.heading, xlabel=measure.heading_in_unit)
        if measure.unit == "%":
            ax.set_xticks(np.linspace(0, longest, _ticks(room_in / n_panels)))
    axes[0].set_yticks(np.arange(len(models)), models)
    axes[0].set_ylim(len(models) - 0.4, -0.6)
    bare_axes(axes)
    if n_panels < len(columns):
        others = {c.heading: v[:, 0] for c, v in zip(columns[1:], shown[1:], strict=True)}
        _marks(figure, axes[0], others)
    title = f"{kind_of(track).title}: {measure.heading}"
    headed(figure, title, _subtitle(run, track, int(found["n_clusters"].max())))
    return figure


def _range(shown: NDArray[np.float64]) -> tuple[float, float]:
    """From where to where values and ends of intervals go, 0 included; never a single place."""
    least, longest = min(0.0, float(np.nanmin(shown))), max(0.0, float(np.nanmax(shown)))
    return least, longest if longest > least else least + 1.0


def _ticks(panel_in: float) -> int:
    """How many numbers an axis has room for that is so long [inches]."""
    return 2 if panel_in < _THREE_IN else 3 if panel_in < 2 else 5


def _columns(run: Run, track: str, measure: Measure) -> list[HeadlineColumn]:
    """The headline columns of a measure, the one that models are ranked by first."""
    columns, leading = headline_columns(run, track), main_column(run, track)
    others = [c for c in columns if c.measure == measure.name and c != leading]
    return [leading, *others[1 - _MOST_PANELS :]]


def _ranked(run: Run, main: Mapping[str, tuple[float, ...]], measure: Measure) -> Sequence[str]:
    sign = -1 if measure.better == "higher" else 1
    measured = (name for name in run.design.model_names if not np.isnan(main.get(name, _NONE)[0]))
    return sorted(measured, key=lambda name: (sign * main[name][0], name))


def _values(
    rows: pd.DataFrame, column: HeadlineColumn, measure: Measure
) -> dict[str, tuple[float, ...]]:
    """By model, the value of a cell and the ends of its interval, in the measure's unit."""
    return {
        row["model"]: tuple(measure.scale * float(row[name]) for name in ("value", "lo", "hi"))
        for row in rows_of(rows, column).to_dict("records")
    }


def _dots(ax: Axes, values: NDArray[np.float64], ends: tuple[float, float], color: str) -> None:
    """Draw a dot a row of `values` (value, low, high; NaN: not measured), its number beside it;
    `ends` are those of the axis.
    """
    value, lo, hi = values.T
    places = np.arange(len(value))
    sure = ~np.isnan(value) & ~np.isnan(lo)
    ax.hlines(places[sure], lo[sure], hi[sure], color=color, linewidth=1.2)
    ax.plot(value, places, "o", color=color, markersize=3.6, clip_on=False)
    for place in np.flatnonzero(~np.isnan(value)).tolist():
        ax.text(
            ends[1],
            place,
            f"{value[place]:.1f}",
            ha="right",
            va="center",
            fontsize=6.5,
            color=MUTED,
        )
    ax.set_xlim(*ends)


def _marks(figure: Figure, ax: Axes, others: Mapping[str, NDArray[np.float64]]) -> None:
    """The values of other cells as small open marks, named in a legend."""
    handles = []
    for n, (heading, values) in enumerate(others.items()):
        handles += ax.plot(
            values,
            np.arange(len(values)),
            color=COLORS[n % len(COLORS)],
            marker=MARKERS[(n + 1) % len(MARKERS)],
            linestyle="none",
            markersize=3.0,
            markerfacecolor="none",
            markeredgewidth=0.7,
            label=heading,
            zorder=1.5,
            clip_on=False,
        )
    legend_below(figure, handles, list(others))


def _subtitle(run: Run, track: str, clusters: int) -> str:
    notes = kind_of(track).report().notes(run)[:1]
    how = "".join(note.partition(". ")[0].rstrip(".") + "; " for note in notes)
    lines = f"{how}lines: 95 % intervals over {counted(clusters, 'base scene')}"
    return run.design.after_suite(lines, "; ")
