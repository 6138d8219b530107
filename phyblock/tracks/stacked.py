"""Shares that make up a whole, as bars in one line a model."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.tables.drawing import WIDTH_IN, drawn_width_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["HATCHES", "Part", "stack"]

HATCHES = ("", "", "//", "..", "\\\\", "xx", "----", "++")
"""Hatches of parts by their place: they tell colors apart that look alike to some, or in print."""


class Part(NamedTuple):
    """A part of the whole: its name, its share of each model [%], and how it looks."""

    name: str
    shares: NDArray[np.float64]
    color: str
    ink: str


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
