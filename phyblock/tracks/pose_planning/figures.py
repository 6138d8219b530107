"""Figures of pose planning: F1 by tolerance, and what was wrong with steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from phyblock.scoring import POSE_ERRORS, POSE_FRAMES, TOLERANCES_CM, PoseError
from phyblock.tables.design import OVERALL
from phyblock.tables.drawing import (
    COLORS,
    GRID,
    INK,
    MARKERS,
    PALE,
    bare_axes,
    headed,
    legend_below,
    name_across,
    names_width_in,
    new_figure,
)
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.pose_planning.measures import (
    ERROR_NAMES,
    NAME,
    is_asked,
    tolerance_measure,
)
from phyblock.tracks.pose_planning.tables import pose_errors_frame, table_c_frame
from phyblock.tracks.stacked import Part, stack

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["f1_by_tolerance", "pose_error_bars", "tolerance_curve"]

_NAMED = 8
_LEAST_LABEL = 4.0
_LOOKS: dict[PoseError, tuple[str, str]] = {
    "wrong_kind": (COLORS[1], "white"),
    "wrong_rotation": (COLORS[4], "black"),
    "too_early": (COLORS[3], "black"),
    "off_sideways": (COLORS[0], "white"),
    "off_height": (COLORS[5], "black"),
    "interpenetrating": (COLORS[6], "white"),
    "floating": (COLORS[2], "black"),
    "toppling": ("#8fd6bf", "black"),
}


def tolerance_curve(run: Run) -> pd.DataFrame:
    """F1 in C [%] over all scenes: a row a tolerance [cm], columns by frame and model."""
    found = track_estimates(run, NAME)
    mine = found[found[CELL] == OVERALL].set_index(["measure", "model"])["value"].to_dict()
    columns = {
        (frame, model): [
            100 * float(mine.get((tolerance_measure(frame, cm), model), float("nan")))
            for cm in TOLERANCES_CM
        ]
        for frame in POSE_FRAMES
        for model in run.design.model_names
    }
    table = pd.DataFrame(columns, index=pd.Index(TOLERANCES_CM, name="cm"))
    return table.dropna(axis="columns", how="all")


def f1_by_tolerance(run: Run) -> Figure | None:
    """F1 in C at each tolerance, a line a model, dashed where plans are aligned; None without a
    plan.
    """
    if not is_asked(run):
        return None
    table = tolerance_curve(run)
    if not len(table.columns):
        return None
    ranks = table_c_frame(run).set_index("model")["f1_c"].dropna()
    models = ranks.sort_values(ascending=False, kind="stable").index
    figure = new_figure(3.1)
    ax = figure.subplots()
    for place, model in reversed(list(enumerate(models))):
        named = place < _NAMED
        for frame, style in zip(POSE_FRAMES, ("-", ":"), strict=True):
            ax.plot(
                table.index,
                table[frame, model],
                linestyle=style,
                color=COLORS[place] if named else PALE,
                marker=MARKERS[place] if named and frame == "absolute" else None,
                markersize=3.4,
                linewidth=1.3 if named else 0.7,
                label=model if named and frame == "absolute" else "_other",
                zorder=3 if named else 1,
            )
    ax.set(ylim=(0, 102), xlabel="Tolerance (cm)", ylabel="F1 in setting C (%)", xscale="log")
    ax.set_xticks(list(TOLERANCES_CM), [f"{cm:g}" for cm in TOLERANCES_CM])
    ax.minorticks_off()
    bare_axes([ax], "y")
    ax.spines["bottom"].set_color(GRID)
    ax.tick_params(colors=INK)
    handles, labels = ax.get_legend_handles_labels()
    legend_below(figure, handles[::-1], labels[::-1])
    name = f"Suite {run.design.suite.name}, " if run.design.suite.name else ""
    headed(figure, "F1 by tolerance", f"{name}15 degrees; dotted: the whole plan aligned first")
    return figure


def pose_error_bars(run: Run) -> Figure | None:
    """Shares of the errors in all steps of each model, of which one may have none; None without a
    wrong step.
    """
    table = pose_errors_frame(run)
    if not len(table) or not (table["value"] > 0).any():
        return None
    shares = table.pivot(index="model", columns="error", values="value")
    ranks = table_c_frame(run).set_index("model")["f1_c"]
    models = list(ranks.sort_values(ascending=False, kind="stable").index)
    names_in = names_width_in(models)
    figure = new_figure(1.05 + 0.2 * len(models), names_in + 1.0)
    ax = figure.subplots()
    parts = (
        Part(
            ERROR_NAMES[error], shares.loc[models, error].fillna(0).to_numpy(float), *_LOOKS[error]
        )
        for error in POSE_ERRORS
    )
    stack(ax, models, parts, 0.7, _LEAST_LABEL)
    for place, model in enumerate(models):
        if shares.loc[model].isna().all():
            ax.text(1, place, "no steps", va="center", fontsize=7, color=INK)
    ax.set(xlim=(0, 100), ylim=(len(models) - 0.4, -0.6))
    name_across(ax, "Share of steps (%)", figure.get_figwidth() - names_in)
    bare_axes([ax])
    legend_below(figure, *ax.get_legend_handles_labels())
    headed(figure, "What was wrong with steps", "by the first error that each meets; all levels")
    return figure
