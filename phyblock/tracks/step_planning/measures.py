"""What step planning measures: precision, recall and F1 of moves, and completed goals."""

from __future__ import annotations

from typing import Any

import pandas as pd

from phyblock.scoring.counts import f1_of, precision_of, ratio_of, recall_of
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, SCORED_BY, Measure, SampleCounts
from phyblock.tables.outcomes import has_reply
from phyblock.tables.track_report import WHOLE
from phyblock.tracks.poses import POSE_MEASURES
from phyblock.tracks.step_planning.baselines import STEP_FLOORS
from phyblock.tracks.step_planning.episodes import NAME, episodes_frame

__all__ = ["COUNTED", "NAME", "STEP_MEASURES", "is_asked"]

COUNTED = ("placed", "attempted")
"""What precision is over: the blocks in the world, or every move that was attempted."""


def is_asked(run: Run) -> bool:
    """Whether the run has episodes."""
    return NAME in run.design.suite.tracks


def _moves(run: Run) -> pd.DataFrame:
    scores = run.scores
    left_out = scores["outcome"].isin(run.design.outcomes_left_out)
    kept = scores[(scores["track"] == NAME) & ~left_out]
    return kept.assign(**_about(kept))


def _episodes(run: Run) -> pd.DataFrame:
    episodes = episodes_frame(run)
    completed = (episodes["ending"] == "completed").astype("int64")
    return episodes.assign(
        **dict.fromkeys(SCORED_BY, ""),
        **_about(episodes),
        completed=completed,
        episodes=1,
    )


def _about(rows: pd.DataFrame) -> dict[str, Any]:
    return {CELL: WHOLE.name, "item": rows["scene"], "replied": has_reply(rows)}


_MOVES = SampleCounts("moves", ("tp", "fp", "fn"), _moves)
_ENDS = SampleCounts("episodes", ("completed", "episodes"), _episodes)

STEP_MEASURES = (
    Measure(
        "f1", "F1", _MOVES, f1_of, "harmonic mean of precision and recall", over="moves",
        floors=STEP_FLOORS,
    ),
    Measure(
        "precision", "Precision", _MOVES, precision_of, "right moves of those counted",
        over="moves",
    ),
    Measure(
        "recall", "Recall", _MOVES, recall_of, "blocks of the goal that were placed", over="blocks"
    ),
    Measure(
        "completion", "Completed", _ENDS, ratio_of, "episodes that placed the whole goal",
        over="episodes",
    ),
    *POSE_MEASURES,
)  # fmt: skip
