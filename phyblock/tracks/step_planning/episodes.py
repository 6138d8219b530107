"""Step-planning episodes of a run as frames: one row an episode, and what is summed over them."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import pandas as pd

from phyblock.scoring import ERROR_TYPES
from phyblock.tables.load import Run, made_once_copied
from phyblock.tracks.step_planning.rules import ENDINGS

__all__ = [
    "NAME",
    "STEP_OUTCOMES",
    "endings_frame",
    "episodes_frame",
    "moves_frame",
    "progress_frame",
]

NAME = "step_planning"
STEP_OUTCOMES = ("placed", *ERROR_TYPES, "invalid", "unread", "done")
"""What becomes of a step; `unread` are replies in which no single operation could be read."""

_EPISODE_TYPES = {
    "model": "object",
    "scene": "object",
    "seed": "int64",
    "n_blocks": "int64",
    "outcome": "object",
    "ending": "object",
    "steps": "int64",
    "max_steps": "int64",
    "progress": "object",
    "outcomes": "object",
}


@made_once_copied
def episodes_frame(run: Run) -> pd.DataFrame:
    """One row an episode that tables count, in the order of the suite's models.

    `steps` were taken of at most `max_steps`; `outcomes` and `progress` are tuples with an entry
    a step: what became of it, and the blocks that were placed by then. Episodes that got no reply
    are left out where the suite says `missing: skip`.
    """
    records = run.records
    left_out = records["outcome"].isin(run.design.outcomes_left_out)
    kept = records[(records["track"] == NAME) & ~left_out]
    kept = kept.assign(steps=kept["outcomes"].map(len))
    return kept[list(_EPISODE_TYPES)].astype(_EPISODE_TYPES).reset_index(drop=True)


def endings_frame(run: Run) -> pd.DataFrame:
    """One row a model: episodes by how they ended, and how long they took.

    `n` episodes of `expected`; a count for each of `ENDINGS`; `completion` the share that
    completed its goal; `steps` the mean number of steps; `steps_to_finish` the mean of those that
    completed, and `detour` their steps over the fewest possible, which is the number of blocks:
    sums first, NaN where none completed.
    """
    episodes = episodes_frame(run)
    rows = []
    for model in run.design.model_names:
        mine = episodes[episodes["model"] == model]
        whole = mine[mine["ending"] == "completed"]
        counts: Counter[str] = Counter(mine["ending"].tolist())
        row: dict[str, Any] = {"model": model, "n": len(mine)}
        row["expected"] = run.design.samples(NAME)
        row |= {name: counts[name] for name in ENDINGS}
        row["completion"] = len(whole) / len(mine) if len(mine) else np.nan
        row["steps"] = mine["steps"].mean()
        row["steps_to_finish"] = whole["steps"].mean()
        fewest = whole["n_blocks"].sum()
        row["detour"] = whole["steps"].sum() / fewest if fewest else np.nan
        rows.append(row)
    return pd.DataFrame(rows)


def moves_frame(run: Run) -> pd.DataFrame:
    """One row a model: `steps` in all, and a count and a share in [0, 1] of `STEP_OUTCOMES`."""
    episodes = episodes_frame(run)
    rows = []
    for model in run.design.model_names:
        mine = episodes.loc[episodes["model"] == model, "outcomes"]
        counts = Counter(_named(outcome) for outcomes in mine for outcome in outcomes)
        steps = counts.total()
        row: dict[str, Any] = {"model": model, "episodes": len(mine), "steps": steps}
        for name in STEP_OUTCOMES:
            row[name] = counts[name]
            row[f"{name}_share"] = counts[name] / steps if steps else np.nan
        rows.append(row)
    return pd.DataFrame(rows)


def progress_frame(run: Run) -> pd.DataFrame:
    """One row a model and step: the curve of how a goal grows.

    `blocks` is the mean share of a goal's blocks that are placed after `step` steps, an episode
    that has ended keeping what it had; `under_way` the share of episodes that have not ended
    before that step. Steps go as far as the longest episode of any model.
    """
    episodes = episodes_frame(run)
    longest = int(episodes["steps"].max()) if len(episodes) else 0
    rows = []
    for model in run.design.model_names:
        mine = episodes[episodes["model"] == model]
        if not len(mine):
            continue
        reached = np.array(
            [_padded(progress, longest) for progress in mine["progress"]], dtype=np.float64
        ).reshape(len(mine), longest)
        shares = reached / mine["n_blocks"].to_numpy()[:, None]
        steps = mine["steps"].to_numpy()
        rows += [
            (model, step, shares[:, step - 1].mean(), (steps >= step).mean())
            for step in range(1, longest + 1)
        ]
    return pd.DataFrame(rows, columns=["model", "step", "blocks", "under_way"])


def _padded(progress: tuple[int, ...], length: int) -> list[int]:
    last = progress[-1] if progress else 0
    return [*progress, *[last] * (length - len(progress))]


def _named(outcome: str) -> str:
    return outcome if outcome in STEP_OUTCOMES else "unread"
