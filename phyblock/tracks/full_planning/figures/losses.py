"""What became of the goals' blocks: stacked bars, one a model."""

from __future__ import annotations

from typing import TYPE_CHECKING

from phyblock.scoring.plan import BLOCK_OUTCOMES, BlockOutcome
from phyblock.tables.design import OVERALL
from phyblock.tables.drawing import COLORS, PALE, headed
from phyblock.tables.load import Run
from phyblock.tracks.full_planning.figures.levels import how_measured, ranked
from phyblock.tracks.full_planning.losses import losses_frame
from phyblock.tracks.full_planning.measures import BLOCK_NAMES
from phyblock.tracks.full_planning.seeds import intervals_table
from phyblock.tracks.stacked import Part, share_bars

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["loss_bars"]

_LOOKS: dict[BlockOutcome, tuple[str, str]] = {
    "placed": (COLORS[0], "white"),
    "left_out": (PALE, "black"),
    "wrong_kind": (COLORS[1], "white"),
    "wrong_orientation": (COLORS[4], "black"),
    "support_not_named": ("#005c43", "white"),
    "support_turned": (COLORS[2], "black"),
    "support_both": ("#8fd6bf", "black"),
    "order": (COLORS[3], "black"),
}
"""Color of a part and of the number in it; the three of missing supports are of one hue."""


def loss_bars(run: Run) -> Figure | None:
    """Shares of the outcomes of goal blocks in all levels; None where no plan's are known."""
    table = losses_frame(run)
    table = table[(table["level"] == OVERALL) & table["value"].notna()]
    if table.empty:
        return None
    shares = table.pivot(index="model", columns="outcome", values="value")
    models = [model for model in ranked(intervals_table(run), "f1") if model in shares.index]
    parts = (
        Part(BLOCK_NAMES[outcome], shares.loc[models, outcome].to_numpy(float), *_LOOKS[outcome])
        for outcome in BLOCK_OUTCOMES
    )
    figure, _ = share_bars(models, parts, "Share of the goals' blocks (%)")
    headed(figure, "What became of the goals' blocks", f"{how_measured(run.design)}; all levels")
    return figure
