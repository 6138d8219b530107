"""Figures of pose planning: F1 by tolerance, and what was wrong with steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from phyblock.scoring.pose import POSE_ERRORS, POSE_FRAMES, PoseError, PoseFrame
from phyblock.scoring.pose_matching import TOLERANCES_CM
from phyblock.tables.design import OVERALL
from phyblock.tables.drawing import COLORS, INK, headed
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL
from phyblock.tracks.curves import curves
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.pose_planning.measures import (
    ERROR_NAMES,
    NAME,
    is_asked,
    tolerance_measure,
)
from phyblock.tracks.pose_planning.tables import pose_errors_frame, table_c_frame
from phyblock.tracks.stacked import Part, share_bars

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["f1_by_tolerance", "pose_error_bars", "tolerance_curve"]

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
    estimates = track_estimates(run, NAME)
    mine = estimates[estimates[CELL] == OVERALL].set_index(["measure", "model"])["value"].to_dict()
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
    styles: dict[str, PoseFrame] = {"-": "absolute", ":": "aligned"}
    by_style = {style: pd.DataFrame(table[frame]) for style, frame in styles.items()}
    figure, ax = curves(by_style, list(models), 3.4)
    ax.set(ylim=(0, 102), xlabel="Tolerance (cm)", ylabel="F1 in setting C (%)", xscale="log")
    ax.set_xticks(list(TOLERANCES_CM), [f"{cm:g}" for cm in TOLERANCES_CM])
    ax.minorticks_off()
    how = run.design.after_suite("15 degrees; dotted: the whole plan aligned first")
    headed(figure, "F1 by tolerance", how)
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
    parts = (
        Part(
            ERROR_NAMES[error], shares.loc[models, error].fillna(0).to_numpy(float), *_LOOKS[error]
        )
        for error in POSE_ERRORS
    )
    figure, ax = share_bars(models, parts, "Share of steps (%)")
    for place, model in enumerate(models):
        if shares.loc[model].isna().all():
            ax.text(1, place, "no steps", va="center", fontsize=7, color=INK)
    headed(figure, "What was wrong with steps", "by the first error that each meets; all levels")
    return figure
