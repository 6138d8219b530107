"""A measure of a track in its cells, with intervals: the figure that any track has."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from phyblock.report.measure_table import headline_columns
from phyblock.tables.drawing import ACCENT, INK, MUTED, bare_axes, headed, new_figure
from phyblock.tables.headline import headline_rows
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, Measure
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.kind import kind_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["main_measure", "measure_bars"]

_ROW_IN = 0.24
_MOST_PANELS = 6
_ROOM = 1.18


def main_measure(track: str) -> Measure:
    """The first measure of a track: the one that is drawn and compared."""
    return kind_of(track).report().measures[0]


def measure_bars(run: Run, *, track: str) -> Figure | None:
    """A panel a cell, a bar a model with its 95 % interval; None where nothing was measured.

    Models are ranked by the last cell. Cells that are parts of a mean are left out.
    """
    measure, report = main_measure(track), kind_of(track).report()
    columns = [c for c in headline_columns(run, track) if c.measure == measure.name]
    columns = columns[-_MOST_PANELS:]
    found = headline_rows(track_estimates(run, track), run.design)
    found = found[found["measure"] == measure.name]
    values = {
        (row[CELL], row["criterion"] if column.criterion else "", row["model"]): row
        for column in columns
        for row in found[found[CELL] == column.cell].to_dict("records")
        if column.criterion in ("", row["criterion"])
    }

    def numbers(cell: str, criterion: str, model: str) -> tuple[float, float, float]:
        row = values.get((cell, criterion, model))
        if row is None:
            return (np.nan, np.nan, np.nan)
        value, lo, hi = (measure.scale * float(row[name]) for name in ("value", "lo", "hi"))
        return value, lo, hi

    last = columns[-1]
    ranking = {m: numbers(last.cell, last.criterion, m)[0] for m in run.design.model_names}
    sign = -1 if measure.better == "higher" else 1
    models = sorted(
        (m for m in ranking if not np.isnan(ranking[m])), key=lambda m: (sign * ranking[m], m)
    )
    if not models:
        return None
    figure = new_figure(1.05 + _ROW_IN * len(models))
    axes = figure.subplots(1, len(columns), sharey=True, squeeze=False)[0]
    places = np.arange(len(models))
    shown = {c: np.array([numbers(c.cell, c.criterion, m) for m in models]) for c in columns}
    longest = 100.0 if measure.unit == "%" else np.nanmax([np.nanmax(v) for v in shown.values()])
    for ax, column in zip(axes, columns, strict=True):
        value, lo, hi = shown[column].T
        color = INK if column is last else ACCENT
        ax.barh(places, np.nan_to_num(value), height=0.62, color=color, alpha=0.85, linewidth=0)
        sure = ~np.isnan(value) & ~np.isnan(lo)
        for line, width in (("white", 2.8), (MUTED, 1.1)):
            ax.hlines(places[sure], lo[sure], hi[sure], color=line, linewidth=width)
        for place in np.flatnonzero(~np.isnan(value)):
            end = np.nanmax([value[place], hi[place]]) + 0.02 * longest
            ax.text(end, place, f"{value[place]:.1f}", va="center", fontsize=6.5, color=INK)
        unit = f" ({measure.unit})" if measure.unit else ""
        ax.set(title=column.heading, xlim=(0, _ROOM * longest), xlabel=f"{measure.heading}{unit}")
        if measure.unit == "%":
            ax.set_xticks([0, 50, 100])
    axes[0].set_yticks(places, models)
    axes[0].set_ylim(len(models) - 0.4, -0.6)
    bare_axes(axes)
    clusters = int(found["n_clusters"].max())
    suite = f"Suite {run.design.suite.name}; " if run.design.suite.name else ""
    how = "".join(note.partition(".")[0] + "; " for note in report.notes(run)[:1])
    headed(
        figure,
        f"{kind_of(track).title}: {measure.heading}",
        f"{suite}{how}lines: 95 % intervals, {clusters} base scenes resampled",
    )
    return figure
