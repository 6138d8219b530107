"""Lines of models in a figure: the best have colors and names, the others are pale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import pandas as pd

from phyblock.tables.drawing import (
    COLORS,
    GRID,
    INK,
    MARKERS,
    PALE,
    bare_axes,
    legend_below,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["NAMED", "curves", "line_look"]

NAMED = 8
"""Models with a color and a name; there are so many colors that can be told apart."""


def line_look(place: int, name: str) -> dict[str, Any]:
    """How the line at a place from 0, the best first, looks, and what the legend calls it."""
    named = place < NAMED
    return {
        "color": COLORS[place] if named else PALE,
        "marker": MARKERS[place] if named else None,
        "linewidth": 1.3 if named else 0.7,
        "label": name if named else "_other",
        "zorder": 3 if named else 1,
    }


def curves(
    tables: Mapping[str, pd.DataFrame], models: Sequence[str], marker_pt: float
) -> tuple[Figure, Axes]:
    """A figure with a line a model, the best first, and style of line, which `tables` are by.

    A table has the places along the axis across as index, and a column a model. Lines of the first
    style have markers and stand in the legend.
    """
    figure = new_figure(3.1)
    ax = figure.subplots()
    for place, model in reversed(list(enumerate(models))):
        look = line_look(place, model)
        for style, table in tables.items():
            ax.plot(table.index, table[model], linestyle=style, markersize=marker_pt, **look)
            look |= {"marker": None, "label": "_other"}
    bare_axes([ax], "y")
    ax.spines["bottom"].set_color(GRID)
    ax.tick_params(colors=INK)
    handles, labels = ax.get_legend_handles_labels()
    legend_below(figure, handles[::-1], labels[::-1])
    return figure, ax
