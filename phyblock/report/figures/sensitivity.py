"""How far each factor of the way of asking moves each model, with intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from phyblock.report.sensitivity import ITEMS, components_frame
from phyblock.report.sensitivity_view import factor_name, sizes_text
from phyblock.tables.drawing import (
    ACCENT,
    COLORS,
    MARKERS,
    PANEL_PT,
    bare_axes,
    headed,
    legend_below,
    names_width_in,
    new_figure,
    text_width_in,
)
from phyblock.tables.load import Run
from phyblock.tracks.estimates import main_measure
from phyblock.tracks.kind import kind_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["moved_dots"]

_ROW_IN = 0.3
_APART_IN = 0.12
"""Between the names of panels."""
_APART = 0.16
_PARTS = {"shift": ("shift of all items", ACCENT), "single": ("single items", COLORS[1])}


def moved_dots(run: Run, *, track: str) -> Figure | None:
    """A panel a factor, a row a model, dots for shift and single items; None where nothing varies.

    What differs between items is left out: it is an order larger, and no way of asking.
    """
    table = components_frame(run)
    if not len(table) or track not in set(table["track"]):
        return None
    table = table[(table["track"] == track) & (table["factor"] != ITEMS)]
    factors, models = list(table["factor"].unique()), list(table["model"].unique())
    titles = [factor_name(factor).replace(" ", "\n") for factor in factors]
    words = [word for title in titles for word in title.split()]
    panel_in = _APART_IN + max(text_width_in(word, PANEL_PT, "bold") for word in words)
    least_in = names_width_in(models) + panel_in * len(factors)
    figure = new_figure(1.2 + _ROW_IN * len(models), least_in)
    axes = figure.subplots(1, len(factors), sharey=True, sharex=True, squeeze=False)[0]
    for ax, factor, title in zip(axes, factors, titles, strict=True):
        rows = table[table["factor"] == factor].set_index("model").loc[models]
        for n, (name, (label, color)) in enumerate(_PARTS.items()):
            places = np.arange(len(models)) + (n - 0.5) * _APART * 2
            values = rows[[name, f"{name}_lo", f"{name}_hi"]].to_numpy(np.float64)
            ax.hlines(places, values[:, 1], values[:, 2], color=color, linewidth=1.3)
            ax.plot(
                values[:, 0],
                places,
                MARKERS[n],
                color=color,
                markersize=4,
                label=label,
                clip_on=False,
            )
        ax.set(title=title, xlabel="SD")
    axes[0].set_yticks(np.arange(len(models)), models)
    axes[0].set_ylim(len(models) - 0.4, -0.6)
    axes[0].set_xlim(left=0)
    bare_axes(axes)
    legend_below(figure, *axes[0].get_legend_handles_labels())
    headed(
        figure,
        f"{kind_of(track).title}: what the way of asking changes",
        f"Standard deviation of {main_measure(run, track).heading_in_unit}; "
        "lines: 95 % intervals, " + sizes_text(table),
    )
    return figure
