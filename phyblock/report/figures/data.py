"""What scenes a run was about: how many and how large, by level."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from phyblock.tables.design import OVERALL
from phyblock.tables.drawing import (
    ACCENT,
    COLORS,
    INK,
    PALE,
    bare_axes,
    headed,
    legend_below,
    new_figure,
)
from phyblock.tables.load import Run
from phyblock.tables.text_table import level_name
from phyblock.text import counted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["dataset_levels"]


def dataset_levels(run: Run) -> Figure | None:
    """Scenes by level and origin, and blocks a scene by level; None for a run without records."""
    scenes = run.records.dropna(subset=["n_blocks"]).drop_duplicates("scene")
    levels = [level for level in run.design.levels if level != OVERALL]
    held = {level: scenes[[int(level) in of for of in scenes["levels"]]] for level in levels}
    levels = [level for level in levels if len(held[level])]
    if not levels:
        return None
    figure = new_figure(1.1 + 0.26 * len(levels))
    left, right = figure.subplots(1, 2, sharey=True)
    places = np.arange(len(levels))
    several = np.array([(held[n]["parents"].map(len) > 1).sum() for n in levels])
    total = np.array([len(held[level]) for level in levels])
    left.barh(places, total - several, height=0.6, color=ACCENT, label="a base scene")
    if several.any():
        left.barh(
            places,
            several,
            0.6,
            left=total - several,
            color=COLORS[4],
            edgecolor="white",
            hatch="//",
            label="made of several",
        )
        legend_below(figure, *left.get_legend_handles_labels())
    for place, count in enumerate(total):
        left.text(count + 0.02 * total.max(), place, f"{count:,}", va="center", fontsize=7)
    left.set(title="Scenes", xlabel="Number of scenes", xlim=(0, 1.14 * total.max()))
    right.boxplot(
        [held[level]["n_blocks"].to_numpy(float) for level in levels],
        positions=places,
        orientation="horizontal",
        widths=0.5,
        patch_artist=True,
        manage_ticks=False,
        boxprops={"facecolor": PALE, "edgecolor": "none"},
        medianprops={"color": INK, "linewidth": 1.6},
        whiskerprops={"color": PALE, "linewidth": 1.4},
        capprops={"color": PALE, "linewidth": 1.4},
        flierprops={
            "marker": "o",
            "markersize": 2.2,
            "markerfacecolor": PALE,
            "markeredgewidth": 0,
        },
    )
    right.set(title="Size", xlabel="Blocks a scene", xlim=(0, None))
    left.set_yticks(places, [level_name(level) for level in levels])
    left.set_ylim(len(levels) - 0.4, -0.6)
    bare_axes([left, right])
    what = run.design.after_suite(counted(len(scenes), "scene"))
    headed(figure, "Scenes by level", f"{what}; boxes: quartiles, a scene may count in several")
    return figure
