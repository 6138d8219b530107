"""F1 by level: the bar chart with intervals, the radar as in the paper, and A against B."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from phyblock.tables.design import OVERALL, Design
from phyblock.tables.drawing import (
    COLORS,
    GRID,
    MARKERS,
    MUTED,
    PALE,
    bare_axes,
    headed,
    new_figure,
)
from phyblock.tables.load import Run
from phyblock.tables.text_table import level_name
from phyblock.tracks.full_planning.seeds import intervals_table
from phyblock.tracks.full_planning.settings import settings_frame

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["f1_radar", "how_measured", "ranked", "settings_dots"]

_ROW_IN = 0.24
_RADAR_MODELS = 8


def how_measured(design: Design, *, setting: bool = True) -> str:
    """Suite, setting and matcher in a line."""
    parts = [f"Suite {design.suite.name}"] if design.suite.name else []
    parts += [f"setting {design.setting}"] if setting else []
    return ", ".join([*parts, f"{design.matcher} matcher"])


def ranked(table: pd.DataFrame, column: str) -> list[str]:
    """Models of a table of levels, the highest overall first; those without a value are left out.

    A run without an overall number ranks by name.
    """
    overall = table[table["level"] == OVERALL].dropna(subset=[column])
    return list(overall.sort_values([column, "model"], ascending=[False, True])["model"])


def f1_radar(run: Run) -> Figure | None:
    """A corner a level, a line a model, as in the paper; None for fewer than three corners.

    Of more than eight models the best eight have colors and names, the others are pale.
    """
    table = intervals_table(run)
    models, levels = ranked(table, "f1"), run.design.levels
    if not models or len(levels) < 3:
        return None
    cells = table.set_index(["model", "level"])["f1"]
    angles = np.linspace(0, 2 * np.pi, len(levels), endpoint=False)
    figure = new_figure(4.6, 6.0)
    ax = figure.subplots(subplot_kw={"projection": "polar"})
    ax.set_theta_offset(np.pi / 2)  # type: ignore[attr-defined]
    ax.set_theta_direction(-1)  # type: ignore[attr-defined]
    for place, model in reversed(list(enumerate(models))):
        values = cells.loc[[(model, level) for level in levels]].to_numpy(float)
        named = place < _RADAR_MODELS
        ax.plot(
            np.append(angles, angles[0]),
            np.append(values, values[0]),
            color=COLORS[place] if named else PALE,
            marker=MARKERS[place] if named else None,
            linewidth=1.3 if named else 0.7,
            markersize=3.5,
            label=model if named else "_other",
            zorder=3 if named else 1,
        )
    ax.set_xticks(angles, [level_name(level) for level in levels])
    ax.tick_params(axis="x", pad=8)
    ax.set(ylim=(0, 100), yticks=[25, 50, 75, 100])
    ax.set_yticklabels(["25", "50", "75", "100 %"], fontsize=6.5, color=MUTED)
    ax.set_rlabel_position(180 / len(levels))  # type: ignore[attr-defined]
    ax.spines["polar"].set_color(GRID)
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="outside right center", handlelength=2.2)
    others = len(models) - _RADAR_MODELS
    more = f"; the {others} others in gray" if others > 0 else ""
    headed(figure, "F1 by level (%)", how_measured(run.design) + more)
    return figure


def settings_dots(run: Run) -> Figure | None:
    """A panel a level; a model's F1 in A and in B with the gap between; None for one setting."""
    table = settings_frame(run)
    models, levels = ranked(table, "f1_b"), run.design.levels
    if not models:
        return None
    cells = table.set_index(["model", "level"])
    figure = new_figure(1.3 + _ROW_IN * len(models))
    axes = figure.subplots(1, len(levels), sharey=True, squeeze=False)[0]
    places = np.arange(len(models))
    for ax, level in zip(axes, levels, strict=True):
        rows = cells.loc[[(model, level) for model in models]]
        a, b = 100 * rows[["f1_a", "f1_b"]].to_numpy(float).T
        ax.hlines(places, a, b, color=PALE, linewidth=2.2)
        ax.plot(a, places, "o", color=COLORS[0], markersize=4.6, label="A: with orientation")
        ax.plot(b, places, "D", color=COLORS[1], markersize=4.0, label="B: without orientation")
        ax.set(title=level_name(level), xlim=(-3, 103), xticks=[0, 50, 100], xlabel="F1 (%)")
    axes[0].set_yticks(places, models)
    axes[0].set_ylim(len(models) - 0.4, -0.6)
    bare_axes(axes)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=2)
    headed(figure, "What orientation costs", how_measured(run.design, setting=False))
    return figure
