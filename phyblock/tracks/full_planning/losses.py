"""What became of the goals' blocks, as a table: shares with intervals, by model and level."""

from __future__ import annotations

import pandas as pd

from phyblock.scoring.plan import BLOCK_OUTCOMES
from phyblock.tables.cells import cell_scores
from phyblock.tables.headline import headline_rows
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL
from phyblock.tables.text_table import NO_VALUE, Column, TextTable, level_name, with_interval
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.full_planning.measures import (
    BLOCK_COUNTS,
    BLOCK_NAMES,
    NAME,
    SUPPORT_MISSING,
    block_measure,
)

__all__ = ["losses_frame", "losses_view"]

_ROWS = {block_measure(outcome): BLOCK_NAMES[outcome] for outcome in BLOCK_OUTCOMES}
_NUMBERS = ("value", "lo", "hi", "se")
_COLUMNS = ("model", "level", "outcome", *_NUMBERS, "n", "n_scenes", "n_clusters")


@made_once_copied
def losses_frame(run: Run) -> pd.DataFrame:
    """One row a model, level and outcome: its share of the goals' blocks, with a 95 % interval [%].

    Headline setting and matcher, levels whose criterion is `aov`; `n` plans. The outcomes sum to
    100; `support`, beside them, is the sum of the three of missing supports. Plans that an earlier
    version scored are left out.
    """
    estimates = headline_rows(track_estimates(run, NAME), run.design)
    names = [*_ROWS, SUPPORT_MISSING.name]
    rows = estimates[estimates["measure"].isin(names)].rename(columns={CELL: "level"})
    models = list(run.design.model_names)
    places = [
        rows["model"].map(models.index),
        rows["level"].map(run.design.levels.index),
        rows["measure"].map(names.index),
    ]
    order = pd.concat(places, axis=1, keys=["model", "level", "measure"])
    rows = rows.loc[order.sort_values(["model", "level", "measure"]).index]
    numbers = 100 * rows[list(_NUMBERS)].astype("float64")
    outcomes = rows["measure"].str.removeprefix(f"{BLOCK_COUNTS.name}_")
    return rows.assign(**numbers, outcome=outcomes)[list(_COLUMNS)].reset_index(drop=True)


def losses_view(table: pd.DataFrame, run: Run) -> TextTable:
    """A row a model and outcome out of `losses_frame`, a share and its interval a level."""
    design = run.design
    cells = {
        (row["model"], row["outcome"], row["level"]): with_interval(row)
        for row in table.to_dict("records")
    }
    levels = [level for level in design.levels if level in set(table["level"])]
    rows = []
    for model in dict.fromkeys(table["model"]):
        for place, outcome in enumerate(BLOCK_OUTCOMES):
            values = [cells.get((model, outcome, level), (NO_VALUE,) * 2) for level in levels]
            label = "" if place else model
            rows.append((label, BLOCK_NAMES[outcome], *(text for both in values for text in both)))
    pairs = [Column(name, level_name(level)) for level in levels for name in ("%", "95 % CI")]
    return TextTable(
        f"What became of the goals' blocks{design.of_suite}",
        (Column("Model", is_text=True), Column("Outcome", is_text=True), *pairs),
        tuple(rows),
        (
            f"Setting {design.setting}, matcher {design.matcher}; shares of all blocks of the "
            "goals, which sum to 100. docs/scoring.md says what each outcome is.",
            *_lacking(run),
        ),
    )


def _lacking(run: Run) -> list[str]:
    """How many plans were scored before blocks were counted."""
    scores = cell_scores(run)
    mine = scores[
        (scores["track"] == NAME)
        & (scores["criterion"] == "aov")
        & (scores["setting"] == run.design.setting)
        & (scores["matcher"] == run.design.matcher)
        & (scores["level"] == run.design.levels[-1])
    ]
    if not (lacking := int(mine["kept"].isna().sum())):
        return []
    return [f"{lacking} plans were scored before this was counted; phyblock score counts them."]
