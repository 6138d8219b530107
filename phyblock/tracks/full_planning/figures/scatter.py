"""F1 against what a model is and costs: its size, its price."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import pandas as pd

from phyblock.tables.cost import cost_frame
from phyblock.tables.design import OVERALL
from phyblock.tables.drawing import (
    ACCENT,
    INK,
    MUTED,
    PALE,
    bare_axes,
    headed,
    new_figure,
    text_width_in,
)
from phyblock.tables.load import Run
from phyblock.tracks.full_planning.figures.levels import how_measured
from phyblock.tracks.full_planning.measures import NAME
from phyblock.tracks.full_planning.seeds import intervals_table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["f1_by_cost", "f1_by_size", "stated_size_b"]

_LINE_POINTS = 8.5
"""Height of a label, with what it keeps free [points]."""
_LABEL_PT = 6.5
_BESIDE_IN = 0.6
"""What the axis of F1 takes beside the plot."""
_FREE_IN = 0.15
"""Between a point and its name, and behind the name."""
_MOST_OF_WIDTH = 0.7
"""A name takes at most this share of the plot: points need the rest."""
_DECADE_IN = 1.4
"""There is room for three numbers in a decade from here on."""
_STATED_SIZE = re.compile(r"(?<![A-Za-z0-9.])(\d+(?:\.\d+)?)[bB](?![A-Za-z0-9])")
_SHIFTS = sorted((sign * 9.0 * n for n in range(60) for sign in (1, -1)), key=abs)
"""How far a label may be moved, the nearest first [points]."""


def f1_by_size(run: Run) -> Figure | None:
    """F1 against billions of parameters; None where the size of no model is known.

    A size is what the models file says, else what the model's name does, as `-7B`.
    """
    sizes = {model.name: model.size_b or stated_size_b(model.name) for model in run.design.models}
    return _scatter(run, sizes, "F1 by model size", ("size", "Parameters (billions, log scale)"))


def stated_size_b(name: str) -> float | None:
    """The billions of parameters that a model's name tells, as `-7B`; None where it tells none.

    Of several numbers the first counts, which is of all experts where some alone are active.
    """
    match = _STATED_SIZE.search(name)
    return float(match[1]) if match else None


def f1_by_cost(run: Run) -> Figure | None:
    """F1 against dollars for 100 replies; None where no model's replies cost anything known."""
    table = cost_frame(run)
    table = table[table["track"] == NAME]
    prices = dict(zip(table["model"], table["cost_per_100_usd"], strict=True))
    return _scatter(run, prices, "F1 by cost", ("cost", "Cost of 100 replies (USD, log scale)"))


def _scatter(
    run: Run, x_of: dict[str, float | None], title: str, axis: tuple[str, str]
) -> Figure | None:
    from matplotlib.ticker import LogLocator, NullLocator

    table = intervals_table(run)
    table = table[table["level"] == OVERALL].dropna(subset=["f1"])
    known = {model: float(x) for model, x in x_of.items() if x is not None and x > 0}
    table = table[table["model"].isin(list(known))]
    if table.empty:
        return None
    table = table.assign(x=table["model"].map(known)).sort_values(["f1", "model"])
    names_in = max(text_width_in(name, _LABEL_PT) for name in table["model"])
    figure = new_figure(3.6, _BESIDE_IN + (names_in + _FREE_IN) / _MOST_OF_WIDTH)
    ax = figure.subplots()
    ends = table[["lo", "hi"]].to_numpy(float)
    ax.vlines(table["x"], ends[:, 0], ends[:, 1], color=PALE, linewidth=2.2)
    ax.plot(table["x"], table["f1"], "o", color=ACCENT, markersize=5)
    ax.set_xscale("log")
    start = float(table["x"].min()) / 1.7
    end = _end(table, start, figure.get_figwidth())
    ax.set(xlim=(start, end), xlabel=axis[1], ylabel="F1 overall (%)")
    ax.set_ylim(0, min(104.0, 8 + float(table["hi"].fillna(table["f1"]).max())))
    is_wide = figure.get_figwidth() / math.log10(end / start) > _DECADE_IN
    ax.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if is_wide else (1,)))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    bare_axes([ax], "both")
    subtitle = f"{how_measured(run.design)}; lines: 95 % intervals"
    if left_out := len(run.design.model_names) - len(table):
        subtitle += f"; {left_out} of unknown {axis[0]} left out"
    headed(figure, title, subtitle)
    _label(figure, ax, table)
    return figure


def _end(table: pd.DataFrame, start: float, width_in: float) -> float:
    """Where a scale from `start` ends, so that every name fits beside its point."""
    width = width_in - _BESIDE_IN
    ends = [math.log(float(table["x"].max()) * 1.3 / start)]
    for name, x in zip(table["model"], table["x"], strict=True):
        free = 1 - min((text_width_in(name, _LABEL_PT) + _FREE_IN) / width, _MOST_OF_WIDTH)
        ends.append(math.log(x / start) / free)
    return start * math.exp(max(ends))


def _label(figure: Figure, ax: Axes, table: pd.DataFrame) -> None:
    """Names to the right of their points, moved up or down where they would cover another."""
    figure.draw_without_rendering()
    points = ax.transData.transform(table[["x", "f1"]].to_numpy(float)) * 72 / figure.dpi
    taken = [(x - 4.0, x + 4.0, y) for x, y in points]
    for (x, y), name in zip(points, table["model"], strict=True):
        start, end = x + 6.5, x + 8 + 72 * text_width_in(name, _LABEL_PT)
        shift = next(
            shift
            for shift in _SHIFTS
            if not any(
                abs(y + shift - other) < _LINE_POINTS and left < end and start < right
                for left, right, other in taken
            )
        )
        taken.append((start, end, y + shift))
        ax.annotate(
            name,
            (x, y),
            xycoords="figure points",
            xytext=(start, y + shift - 2.6),
            textcoords="figure points",
            fontsize=_LABEL_PT,
            color=INK,
            annotation_clip=False,
            arrowprops={"arrowstyle": "-", "color": MUTED, "linewidth": 0.5, "relpos": (0, 0.5)}
            if shift
            else None,
            bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 0.4},
            zorder=4,
        )
