"""The figure of step planning: how far structures are after each step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from phyblock.tables.drawing import headed
from phyblock.tables.load import Run
from phyblock.tracks.curves import curves
from phyblock.tracks.step_planning.episodes import progress_frame
from phyblock.tracks.step_planning.measures import is_asked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["progress_by_turn", "step_progress"]


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
    if not is_asked(run):
        return None
    table = step_progress(run)
    if not len(table.columns):
        return None
    last = table.iloc[-1].sort_values(ascending=False, kind="stable")
    figure, ax = curves({"-": table}, list(last.index), 3.2)
    ax.set(ylim=(0, 102), xlim=(0, None), xlabel="Step", ylabel="Blocks of the goal placed (%)")
    ax.locator_params(axis="x", integer=True)
    how = run.design.after_suite("mean over episodes; one that ended keeps its blocks")
    headed(figure, "Progress by step", how)
    return figure
