"""Shares that make up a whole, as bars in one line a model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.tables.drawing import (
    WIDTH_IN,
    bare_axes,
    drawn_width_in,
    legend_below,
    name_across,
    names_width_in,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["HATCHES", "Part", "share_bars", "stack"]

HATCHES = ("", "", "//", "..", "\\\\", "xx", "----", "++")
"""Hatches of parts by their place: they tell colors apart that look alike to some, or in print."""


class Part(NamedTuple):
    """A part of the whole: its name, its share of each model [%], and how it looks."""

    name: str
    shares: NDArray[np.float64]
    color: str
    ink: str


_LEAST_LABEL = 4.0


def share_bars(models: Sequence[str], parts: Iterable[Part], name: str) -> tuple[Figure, Axes]:
    """A figure with the parts as one line a model, `name` under them and a legend."""
    names_in = names_width_in(models)
    figure = new_figure(1.05 + 0.2 * len(models), names_in + 1.0)
    ax = figure.subplots()
    stack(ax, models, parts, 0.7, _LEAST_LABEL)
    ax.set(xlim=(0, 100), ylim=(len(models) - 0.4, -0.6))
    name_across(ax, name, figure.get_figwidth() - names_in)
    bare_axes([ax])
    legend_below(figure, *ax.get_legend_handles_labels())
    return figure, ax


def stack(
    ax: Axes, models: Sequence[str], parts: Iterable[Part], height: float, least_label: float
) -> None:
    """Draw the parts one after another, each of its own color and hatch.

    Numbers stand in parts of `least_label` [%] and more where the figure is as wide as the text;
    in a narrower one in larger parts.
    """
    least_label *= WIDTH_IN / drawn_width_in()
    places, start = np.arange(len(models)), np.zeros(len(models))
    for part, hatch in zip(parts, cycle(HATCHES), strict=False):
        ax.barh(
            places,
            part.shares,
            left=start,
            height=height,
            color=part.color,
            edgecolor="white",
            linewidth=0.8,
            hatch=hatch,
            label=part.name,
        )
        for place, share in enumerate(part.shares):
            if share >= least_label:
                middle, text = start[place] + share / 2, f"{share:.0f}"
                ax.text(
                    middle,
                    place,
                    text,
                    ha="center",
                    va="center",
                    color=part.ink,
                    fontsize=7,
                    bbox={"facecolor": part.color, "edgecolor": "none", "pad": 0.6},
                )
        start = start + part.shares
    ax.set_yticks(places, models)
