"""Why steps were wrong: stacked bars, one a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from phyblock.scoring.plan import ERROR_TYPES
from phyblock.tables.design import OVERALL
from phyblock.tables.drawing import (
    COLORS,
    MUTED,
    bare_axes,
    headed,
    legend_below,
    name_across,
    names_width_in,
    new_figure,
)
from phyblock.tables.load import Run
from phyblock.tracks.full_planning.errors import errors_frame
from phyblock.tracks.full_planning.figures.levels import how_measured, ranked
from phyblock.tracks.full_planning.seeds import intervals_table
from phyblock.tracks.full_planning.views import ERROR_NAMES
from phyblock.tracks.stacked import Part, stack

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["error_bars"]

_COLORS = (COLORS[0], COLORS[5], COLORS[4], COLORS[1])
_INKS = ("white", "black", "black", "white")
_LEAST_LABEL = 6.0
_COUNTS_IN = 0.55
"""What the numbers of wrong steps take beside the bars."""


def error_bars(run: Run) -> Figure | None:
    """Shares of the four error types in each model's wrong steps; None without a wrong step."""
    table = errors_frame(run)
    table = table[(table["level"] == OVERALL) & (table["wrong_steps"] > 0)]
    if table.empty:
        return None
    order = {model: place for place, model in enumerate(ranked(intervals_table(run), "f1"))}
    table = table.sort_values("model", key=lambda names: names.map(order), kind="stable")
    names_in = names_width_in(table["model"])
    figure = new_figure(1.1 + 0.2 * len(table), names_in + 1.2)
    ax = figure.subplots()
    parts = (
        Part(ERROR_NAMES[name], 100 * table[f"{name}_share"].to_numpy(float), color, ink)
        for name, color, ink in zip(ERROR_TYPES, _COLORS, _INKS, strict=True)
    )
    stack(ax, list(table["model"]), parts, 0.66, _LEAST_LABEL)
    for place, wrong in enumerate(table["wrong_steps"]):
        ax.text(101.5, place, f"{wrong:,}", va="center", color=MUTED, fontsize=7)
    ax.text(101.5, -0.72, "wrong steps", va="bottom", color=MUTED, fontsize=7)
    ax.set(xlim=(0, 100), ylim=(len(table) - 0.4, -0.7))
    name_across(ax, "Share of wrong steps (%)", figure.get_figwidth() - names_in - _COUNTS_IN)
    bare_axes([ax])
    legend_below(figure, *ax.get_legend_handles_labels())
    headed(figure, "Why steps were wrong", f"{how_measured(run.design)}; all levels")
    return figure
