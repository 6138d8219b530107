"""Figures of the other tracks: questions by subtask, step planning by step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from phyblock.domain import CATEGORIES, SUBTASKS
from phyblock.report.episodes import progress_frame
from phyblock.report.figures.style import (
    COLORS,
    GRID,
    INK,
    MARKERS,
    MUTED,
    PALE,
    bare_axes,
    headed,
    new_figure,
)
from phyblock.report.load import Run
from phyblock.report.questions import questions_frame, showing
from phyblock.scoring import chance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["accuracy_by_subtask", "progress_by_turn", "step_progress", "vqa_heat_map"]

_NAMED = 8
_DARK = 55.0


def accuracy_by_subtask(run: Run) -> pd.DataFrame:
    """Share of right answers [%], a row a model, a column a subtask; NaN for what was not asked.

    As in `questions_frame`; models that answered nothing have no row.
    """
    frame = questions_frame(run)
    table = 100 * frame.pivot(index="model", columns="cell", values="accuracy")
    table = table.reindex(index=list(run.design.model_names), columns=list(SUBTASKS))
    return table.astype("float64").dropna(how="all").rename_axis(index=None, columns=None)


def vqa_heat_map(run: Run) -> Figure | None:
    """A row a model, a column a subtask, categories apart; None without a question."""
    if "vqa" not in run.design.suite.tracks:
        return None
    table = accuracy_by_subtask(run)
    if table.empty:
        return None
    order = table.mean(axis=1).sort_values(ascending=False, kind="stable").index
    table = table.loc[order]
    figure = new_figure(1.9 + 0.25 * len(table))
    ax = figure.subplots()
    image = ax.imshow(table.to_numpy(), cmap="cividis", vmin=0, vmax=100, aspect="auto")
    for (row, column), value in np.ndenumerate(table.to_numpy()):
        if not np.isnan(value):
            color = "white" if value < _DARK else "black"
            ax.text(column, row, f"{value:.0f}", ha="center", va="center", color=color, fontsize=7)
    start = 0.0
    for category, subtasks in CATEGORIES.items():
        middle = start + (len(subtasks) - 1) / 2
        name = category.replace("_", " ").capitalize()
        ax.text(middle, -0.75, name, ha="center", va="bottom", fontsize=7.5, color=MUTED)
        start += len(subtasks)
        ax.axvline(start - 0.5, color="white", linewidth=3)
    ax.set_xticks(range(len(table.columns)), list(table.columns))
    ax.set_yticks(range(len(table)), list(table.index))
    ax.tick_params(length=0)
    for side in ax.spines.values():
        side.set_visible(False)
    bar = figure.colorbar(image, ax=ax, pad=0.015, fraction=0.03)
    bar.set_label("Right answers (%)")
    bar.outline.set_visible(False)
    name = f"Suite {run.design.suite.name}, " if run.design.suite.name else ""
    guessed = {subtask: 100 * chance(subtask) ** showing(run).rotations for subtask in ("SH", "OR")}
    guessing = f"guessing gives {guessed['SH']:.2g}, in OR {guessed['OR']:.1g}"
    headed(figure, "Questions by subtask", f"{name}right answers (%); {guessing}")
    return figure


def step_progress(run: Run) -> pd.DataFrame:
    """Share of the goal's blocks that stand after each step [%], mean over episodes.

    A row a step from 0, a column a model. An episode that has ended keeps what it built.
    """
    frame = progress_frame(run)
    table = 100 * frame.pivot(index="step", columns="model", values="blocks")
    table = table.reindex(columns=[name for name in run.design.model_names if name in table])
    start = pd.DataFrame(0.0, index=[0], columns=table.columns)
    return pd.concat([start, table]).rename_axis(index="step", columns=None)


def progress_by_turn(run: Run) -> Figure | None:
    """How far the structure is after each step, a line a model; None without an episode."""
    if "step_planning" not in run.design.suite.tracks:
        return None
    table = step_progress(run)
    if not len(table.columns):
        return None
    last = table.iloc[-1].sort_values(ascending=False, kind="stable")
    figure = new_figure(3.6)
    ax = figure.subplots()
    for place, model in reversed(list(enumerate(last.index))):
        named = place < _NAMED
        ax.plot(
            table.index,
            table[model],
            color=COLORS[place] if named else PALE,
            marker=MARKERS[place] if named else None,
            markersize=3.2,
            linewidth=1.3 if named else 0.7,
            label=model if named else "_other",
            zorder=3 if named else 1,
        )
    ax.set(ylim=(0, 102), xlim=(0, None), xlabel="Step", ylabel="Blocks of the goal placed (%)")
    ax.locator_params(axis="x", integer=True)
    bare_axes([ax], "y")
    ax.spines["bottom"].set_color(GRID)
    ax.tick_params(colors=INK)
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles[::-1], labels[::-1], loc="outside right center")
    name = f"Suite {run.design.suite.name}, " if run.design.suite.name else ""
    headed(figure, "Progress by step", f"{name}mean over episodes; one that ended keeps its blocks")
    return figure
