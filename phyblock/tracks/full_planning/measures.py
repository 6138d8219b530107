"""What full planning measures of a plan: its steps, the whole of it, and what became of the goal's
blocks; by level (paper section 4.1).
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd

from phyblock.scoring.counts import Floats, f1_of, precision_of, ratio_of, recall_of
from phyblock.scoring.plan import BLOCK_OUTCOMES, BlockOutcome
from phyblock.tables.cells import cell_scores
from phyblock.tables.flat import BLOCK_COLUMNS
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, Measure, SampleCounts
from phyblock.tables.outcomes import has_reply
from phyblock.tracks.full_planning.baselines import PLAN_FLOORS
from phyblock.tracks.poses import POSE_MEASURES

__all__ = [
    "BLOCK_COUNTS",
    "BLOCK_NAMES",
    "NAME",
    "PLANNING_MEASURES",
    "SUPPORT_MISSING",
    "block_measure",
    "is_asked",
]

NAME = "full_planning"


def is_asked(run: Run) -> bool:
    """Whether the run has plans."""
    return NAME in run.design.suite.tracks


def _scored(run: Run) -> pd.DataFrame:
    scores = cell_scores(run)
    scores = scores[scores["track"] == NAME].rename(columns={"level": CELL})
    return scores.assign(item=scores["scene"], replied=has_reply(scores))


def _steps(run: Run) -> pd.DataFrame:
    """Under `membership` steps count over again, so that no plan has a value of its own."""
    rows = _scored(run)
    alone = rows["criterion"] != "membership"
    whole = alone & (rows["fp"] == 0) & (rows["fn"] == 0)
    f1 = np.nan_to_num(f1_of(rows[["tp", "fp", "fn"]].to_numpy(np.float64)))
    return rows.assign(whole=whole.astype("int64"), f1=alone * f1, plans=alone.astype("int64"))


def _in_order(run: Run) -> pd.DataFrame:
    """Plans whose order counts; those that an earlier version scored are left out."""
    rows = _scored(run)
    rows = rows[(rows["criterion"] == "aov") & rows["kept"].notna()]
    blocks, steps = rows["tp"] + rows["fn"], rows["tp"] + rows["fp"]
    distance = 1 - 2 * rows["kept"].astype("float64") / (blocks + steps)
    return rows.assign(blocks=blocks, distance=distance, plans=1)


_STEPS = SampleCounts("steps", ("tp", "fp", "fn", "whole", "f1", "plans"), _steps)
BLOCK_COUNTS = SampleCounts(
    "blocks", (*BLOCK_COLUMNS.values(), "blocks", "distance", "plans"), _in_order
)

BLOCK_NAMES: dict[BlockOutcome, str] = {
    "placed": "Placed",
    "left_out": "Left out",
    "wrong_kind": "Wrong kind",
    "wrong_orientation": "Wrong orientation",
    "support_not_named": "Support never named",
    "support_turned": "Support turned wrongly",
    "support_both": "Supports of both sorts",
    "order": "Order",
}
_BLOCK_MEANINGS: dict[BlockOutcome, str] = {
    "placed": "blocks placed",
    "left_out": "blocks for which a plan has no step left",
    "wrong_kind": "blocks in whose place a plan names a kind not needed, or not so often",
    "wrong_orientation": "blocks named in another pose",
    "support_not_named": "blocks named that rest on one that was never named",
    "support_turned": "blocks named that rest on one that was named in another pose",
    "support_both": "blocks named that rest on one of each sort",
    "order": "blocks that another order of a plan's steps would place",
}
_SUPPORTS: tuple[BlockOutcome, ...] = ("support_not_named", "support_turned", "support_both")


def block_measure(outcome: BlockOutcome) -> str:
    """Name of the measure of an outcome: its share of the goals' blocks."""
    return BLOCK_COLUMNS[outcome]


def _share(outcomes: tuple[BlockOutcome, ...], sums: Floats) -> Floats:
    parts = sums[..., [BLOCK_OUTCOMES.index(outcome) for outcome in outcomes]].sum(axis=-1)
    return ratio_of(np.stack([parts, sums[..., len(BLOCK_OUTCOMES)]], axis=-1))


def _mean(counted: SampleCounts, column: str, sums: Floats) -> Floats:
    """Mean over plans of what was summed in a column."""
    columns = counted.columns
    return ratio_of(sums[..., [columns.index(column), columns.index("plans")]])


SUPPORT_MISSING = Measure(
    "blocks_support", "Support missing", BLOCK_COUNTS, partial(_share, _SUPPORTS),
    "blocks named that rest on one that was not, or in another pose", better="lower",
    over="blocks", in_tables=False,
)  # fmt: skip

PLANNING_MEASURES = (
    Measure(
        "f1", "F1", _STEPS, f1_of, "harmonic mean of precision and recall", over="steps",
        floors=PLAN_FLOORS,
    ),
    Measure(
        "precision", "Precision", _STEPS, precision_of, "right steps of those proposed",
        over="steps",
    ),
    Measure(
        "recall", "Recall", _STEPS, recall_of, "blocks of the goal that a right step placed",
        over="blocks",
    ),
    Measure(
        "success", "Whole plans", _STEPS, partial(_mean, _STEPS, "whole"),
        "plans that place every block, by right steps alone", over="plans",
    ),
    Measure(
        "macro_f1", "Macro F1", _STEPS, partial(_mean, _STEPS, "f1"),
        "mean F1 of single plans, 0 for an empty one", over="plans",
    ),
    Measure(
        "distance", "Distance to a valid order", BLOCK_COUNTS,
        partial(_mean, BLOCK_COUNTS, "distance"),
        "fewest steps to leave out and blocks to put in until a plan is a valid order, of steps "
        "and blocks together", better="lower", over="plans",
    ),
    *(
        Measure(
            block_measure(outcome), BLOCK_NAMES[outcome], BLOCK_COUNTS,
            partial(_share, (outcome,)), _BLOCK_MEANINGS[outcome], over="blocks",
            better="higher" if outcome == "placed" else "lower", in_tables=False,
        )
        for outcome in BLOCK_OUTCOMES
    ),
    SUPPORT_MISSING,
    *POSE_MEASURES,
)  # fmt: skip
