"""Why steps were wrong: counts and shares of the four error types."""

from __future__ import annotations

import pandas as pd

from phyblock.scoring.plan import ERROR_TYPES
from phyblock.tables.cells import level_cells, with_levels
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL
from phyblock.tables.outcomes import has_reply
from phyblock.tables.shares import joined_shares, shares_of
from phyblock.tracks.full_planning.measures import NAME

__all__ = ["errors_frame", "levels_in_order"]


def levels_in_order(run: Run) -> tuple[str, ...]:
    """Levels whose criterion goes by the order of steps: no other knows the four types.

    Level 1 by its own criterion is left out: the scenes that it shares with level 2 would only be
    counted again, by an order that it does not ask for.
    """
    return tuple(level for level in run.design.levels if run.design.criterion(level) == "aov")


@made_once_copied
def errors_frame(run: Run) -> pd.DataFrame:
    """One row a model and level of `levels_in_order`: n, wrong_steps, each type's count and share.

    Headline matcher and setting. Shares are of all wrong steps, in [0, 1], NaN where no step was
    wrong; `<type>_lo` and `<type>_hi` bound their 95 % intervals.
    """
    design, levels = run.design, levels_in_order(run)
    scores = run.scores[
        (run.scores["track"] == NAME)
        & (run.scores["criterion"] == "aov")
        & (run.scores["setting"] == design.setting)
        & (run.scores["matcher"] == design.matcher)
        & ~run.scores["outcome"].isin(design.outcomes_left_out)
    ][["sample", "model", "scene", "seed", "outcome", *ERROR_TYPES]]
    rows = with_levels(scores, run)
    n = rows.groupby(["model", "level"]).size().rename("n")
    cells = [(model, level) for model in design.model_names for level in levels]
    table = pd.DataFrame(cells, columns=["model", "level"]).join(n, on=["model", "level"])
    table["n"] = table["n"].fillna(0).astype("int64")
    rows = rows.rename(columns={"level": CELL})
    rows["replied"] = has_reply(rows)
    of_level = [cell for cell in level_cells(run) if cell.name in levels]
    shares = shares_of(run, rows, ERROR_TYPES, of_level)
    table = joined_shares(table, shares, ["model", "level"])
    return table.rename(columns={"whole": "wrong_steps"})
