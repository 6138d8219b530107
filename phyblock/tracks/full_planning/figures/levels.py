"""F1 by level in both settings: the radar as in the paper, and A against B."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from phyblock.tables.design import OVERALL, Design
from phyblock.tables.drawing import (
    COLORS,
    GRID,
    MUTED,
    PALE,
    bare_axes,
    drawn_width_in,
    headed,
    legend_below,
    names_width_in,
    new_figure,
)
from phyblock.tables.load import Run
from phyblock.tables.text_table import level_name
from phyblock.tracks.curves import NAMED, line_look
from phyblock.tracks.full_planning.seeds import intervals_table
from phyblock.tracks.full_planning.settings import settings_frame

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["f1_radar", "how_measured", "ranked", "settings_dots"]

_ROW_IN = 0.19
_LEAST_PANEL_IN, _LEAST_PLOT_IN = 0.7, 1.0
_RADAR_IN, _LEAST_RADAR_IN = 2.75, 2.2
_RINGS = (25, 50, 75, 100)
_CORNER_PT = 9
"""Between a corner and its name, for a marker that stands at the corner."""
_NAMES_IN = 0.2
"""Above and below a radar."""
_SETTINGS = {
    "a": (COLORS[0], "o", "A: with orientation"),
    "b": (COLORS[1], "D", "B: without orientation"),
}


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
    """A radar a setting with a corner a level and a line a model, as in the paper; of a single
    model one radar with a line a setting. None for fewer than three levels.

    Of more than eight models the best eight have colors and names, the others are pale.
    """
    levels = [level for level in run.design.levels if level != OVERALL]
    panels = _by_setting(run)
    models = ranked(intervals_table(run), "f1")
    if not models or len(levels) < 3:
        return None
    if len(models) == 1:
        lines = {f"Setting {name}": _line(cells, models[0]) for name, cells in panels.items()}
        shown = {models[0]: lines}
    else:
        shown = {
            f"Setting {name}": {model: _line(cells, model) for model in models}
            for name, cells in panels.items()
        }
    abreast = len(shown) if drawn_width_in() / len(shown) >= _LEAST_RADAR_IN else 1
    rows, side = len(shown) // abreast, min(_RADAR_IN, drawn_width_in() / abreast)
    figure = new_figure(0.5 + rows * (side + _NAMES_IN))
    axes = figure.subplots(rows, abreast, subplot_kw={"projection": "polar"}, squeeze=False)
    for ax, (title, drawn) in zip(axes.ravel(), shown.items(), strict=True):
        handles = _radar(ax, drawn, levels)
        ax.set_title(title, loc="center", pad=12 + _CORNER_PT)
    names = list(next(iter(shown.values())))[:NAMED]
    if len(names) > 1:
        legend_below(figure, handles[: len(names)], names)
    others = len(models) - NAMED
    more = f"; the {others} others in gray" if others > 0 else ""
    headed(figure, "F1 by level (%)", how_measured(run.design, setting=len(panels) == 1) + more)
    return figure


def _by_setting(run: Run) -> dict[str, pd.Series[float]]:
    """F1 [%] by model and level in each setting of the run, A first."""
    both = settings_frame(run)
    if len(both):
        cells = both.set_index(["model", "level"])
        return {name: 100 * cells[f"f1_{name.lower()}"] for name in "AB"}
    return {run.design.setting: intervals_table(run).set_index(["model", "level"])["f1"]}


def _line(cells: pd.Series[float], model: str) -> pd.Series[float]:
    return pd.Series(cells.loc[model], dtype="float64")


def _radar(ax: Axes, lines: dict[str, pd.Series[float]], levels: Sequence[str]) -> list[Artist]:
    """Draw lines of F1 by level, the first on top; their handles in that order."""
    polar: Any = ax
    angles = np.linspace(0, 2 * np.pi, len(levels), endpoint=False)
    polar.set_theta_offset(np.pi / 2)
    polar.set_theta_direction(-1)
    handles: list[Artist] = []
    for place, (name, cells) in reversed(list(enumerate(lines.items()))):
        values = cells.loc[list(levels)].to_numpy(float)
        handles += ax.plot(
            np.append(angles, angles[0]),
            np.append(values, values[0]),
            markersize=3.5,
            clip_on=False,
            **line_look(place, name),
        )
    ax.set_xticks(angles, [level_name(level) for level in levels])
    ax.tick_params(axis="x", pad=_CORNER_PT)
    ax.set(ylim=(0, 100), yticks=_RINGS, yticklabels=[])
    for share in _RINGS:
        ax.text(
            np.pi / len(levels),
            share,
            f"{share} %" if share == _RINGS[-1] else str(share),
            ha="center",
            va="center",
            fontsize=6,
            color=MUTED,
            bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.3},
            zorder=4,
        )
    polar.spines["polar"].set_color(GRID)
    return handles[::-1]


def settings_dots(run: Run) -> Figure | None:
    """F1 in A and in B with the gap between, a panel a level, Overall first; None for one setting.

    Of a single model, and where panels would be too narrow, there is one panel: with a row a level,
    or of all levels together.
    """
    table = settings_frame(run)
    models, levels = ranked(table, "f1_b"), run.design.levels
    if not models:
        return None
    cells = table.set_index(["model", "level"])
    levels = (*levels[-1:], *levels[:-1])
    if len(models) == 1:
        mine = table[table["model"] == models[0]].set_index("level")
        return _of_one(run, models[0], mine.loc[list(levels)])
    names_in = names_width_in(models)
    room_in = drawn_width_in(names_in + _LEAST_PLOT_IN) - names_in
    levels = levels if room_in / len(levels) >= _LEAST_PANEL_IN else levels[:1]
    figure = new_figure(1.0 + _ROW_IN * len(models), names_in + _LEAST_PLOT_IN)
    axes = figure.subplots(1, len(levels), sharey=True, squeeze=False)[0]
    # Membership counts a step again that is repeated: it may go beyond all there is.
    end = 3 + max(100.0, 100 * float(np.nanmax(table[["f1_a", "f1_b"]].to_numpy(float))))
    for ax, level in zip(axes, levels, strict=True):
        _gaps(ax, cells.loc[[(model, level) for model in models]])
        ax.set(title=level_name(level), xlim=(-3, end), xticks=[0, 50, 100], xlabel="F1 (%)")
    axes[0].set_yticks(np.arange(len(models)), models)
    _finish(run, figure, axes, len(models))
    return figure


def _of_one(run: Run, model: str, rows: pd.DataFrame) -> Figure:
    """One model: a row a level, with intervals."""
    figure = new_figure(1.0 + 0.3 * len(rows))
    ax = figure.subplots()
    for shift, (name, (color, *_)) in zip((-0.09, 0.09), _SETTINGS.items(), strict=True):
        ends = 100 * rows[[f"f1_{name}_lo", f"f1_{name}_hi"]].to_numpy(float)
        ax.hlines(np.arange(len(rows)) + shift, *ends.T, color=color, linewidth=1.2)
    _gaps(ax, rows, 0.09)
    ax.set(title=model, xlim=(0, 103), xlabel="F1 (%)")
    ax.set_yticks(np.arange(len(rows)), [level_name(str(level)) for level in rows.index])
    _finish(run, figure, [ax], len(rows))
    return figure


def _gaps(ax: Axes, rows: pd.DataFrame, shift: float = 0.0) -> None:
    places = np.arange(len(rows))
    a, b = 100 * rows[["f1_a", "f1_b"]].to_numpy(float).T
    if not shift:
        ax.hlines(places, a, b, color=PALE, linewidth=2.2)
    for values, apart, (color, marker, label) in zip(
        (a, b), (-shift, shift), _SETTINGS.values(), strict=True
    ):
        ax.plot(values, places + apart, marker, color=color, markersize=4, label=label)


def _finish(run: Run, figure: Figure, axes: Sequence[Axes], n_rows: int) -> None:
    axes[0].set_ylim(n_rows - 0.4, -0.6)
    bare_axes(axes)
    legend_below(figure, *axes[0].get_legend_handles_labels())
    how = how_measured(run.design, setting=False)
    headed(figure, "What orientation costs", how)
