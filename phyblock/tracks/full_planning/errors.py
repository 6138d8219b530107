"""Why steps were wrong: counts and shares of the four error types."""

from __future__ import annotations

import pandas as pd

from phyblock.scoring import ERROR_TYPES
from phyblock.tables.cells import with_levels
from phyblock.tables.load import Run
from phyblock.tracks.full_planning.measures import NAME

__all__ = ["errors_frame"]


def errors_frame(run: Run) -> pd.DataFrame:
    """One row a model and level: n, wrong_steps, and each type's count and share.

    Criterion `aov` at every level, headline matcher and setting. Shares are
    of all wrong steps, in [0, 1], NaN where no step was wrong.
    """
    design = run.design
    scores = run.scores[
        (run.scores["track"] == NAME)
        & (run.scores["criterion"] == "aov")
        & (run.scores["setting"] == design.setting)
        & (run.scores["matcher"] == design.matcher)
        & ~run.scores["outcome"].isin(design.outcomes_left_out)
    ][["sample", "model", *ERROR_TYPES]]
    groups = with_levels(scores, run).groupby(["model", "level"])
    counts = groups[list(ERROR_TYPES)].sum()
    counts.insert(0, "n", groups.size())
    cells = [(model, level) for model in design.model_names for level in design.levels]
    table = pd.DataFrame(cells, columns=["model", "level"]).join(counts, on=["model", "level"])
    columns = ["n", *ERROR_TYPES]
    table[columns] = table[columns].fillna(0).astype("int64")
    table.insert(3, "wrong_steps", table[list(ERROR_TYPES)].sum(axis=1))
    wrong = table["wrong_steps"].where(table["wrong_steps"] > 0)
    for name in ERROR_TYPES:
        table[f"{name}_share"] = table[name] / wrong
    return table
