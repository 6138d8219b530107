"""The figure of questions: a heat map of models and subtasks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from phyblock.domain import CATEGORIES, SUBTASKS
from phyblock.tables.drawing import (
    MUTED,
    headed,
    new_figure,
)
from phyblock.tables.load import Run
from phyblock.tracks.vqa.accuracy import questions_frame
from phyblock.tracks.vqa.measures import guessing, is_asked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["accuracy_by_subtask", "vqa_heat_map"]

_DARK = 55.0
_LEAST_IN = 5.5
_SCALE_ROWS = 6


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
    if not is_asked(run):
        return None
    table = accuracy_by_subtask(run)
    if table.empty:
        return None
    order = table.mean(axis=1).sort_values(ascending=False, kind="stable").index
    table = table.loc[order]
    figure = new_figure(1.3 + 0.19 * len(table), _LEAST_IN)
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
    # Every number is said; beside a few rows there is no room for the scale's name.
    if len(table) >= _SCALE_ROWS:
        bar = figure.colorbar(image, ax=ax, pad=0.015, fraction=0.03)
        bar.set_label("Right answers (%)")
        bar.outline.set_visible(False)
    chance = (
        f"guessing gives {100 * guessing(run, 'SH'):.2g}, in OR {100 * guessing(run, 'OR'):.1g}"
    )
    headed(figure, "Questions by subtask", run.design.after_suite(f"right answers (%); {chance}"))
    return figure
