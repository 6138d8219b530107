"""Step-planning episodes of a run as frames: one row an episode, and what is summed over them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from phyblock.scoring.plan import ERROR_TYPES
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL
from phyblock.tables.outcomes import has_reply
from phyblock.tables.shares import joined_shares, shares_of
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
    "variant": "object",
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

    `n` episodes of `expected`; a count and a share with the ends of its 95 % interval, in [0, 1],
    for each of `ENDINGS`; `steps` the mean number of steps; `steps_to_finish` the mean of those
    that completed, and `detour` their steps over the fewest possible, which is the number of
    blocks: sums first, NaN where none completed. A model without any reply has no shares.
    """
    episodes = episodes_frame(run)
    ended = {name: (episodes["ending"] == name).astype("int64") for name in ENDINGS}
    shares = _shares(run, episodes.assign(**ended), ENDINGS)
    rows = []
    for model in run.design.model_names:
        mine = episodes[episodes["model"] == model]
        whole = mine[mine["ending"] == "completed"]
        row: dict[str, Any] = {"model": model, "n": len(mine)}
        row["expected"] = run.design.samples(NAME)
        row["steps"] = mine["steps"].mean()
        row["steps_to_finish"] = whole["steps"].mean()
        fewest = whole["n_blocks"].sum()
        row["detour"] = whole["steps"].sum() / fewest if fewest else np.nan
        rows.append(row)
    table = joined_shares(pd.DataFrame(rows), shares, ["model"])
    first = ["model", "n", "expected", *ENDINGS]
    return table[[*first, *(name for name in table if name not in (*first, "whole"))]]


def moves_frame(run: Run) -> pd.DataFrame:
    """One row a model: `steps` in all, and a count of each of `STEP_OUTCOMES` and its share of
    them, with the ends of its 95 % interval, in [0, 1].
    """
    episodes = episodes_frame(run)
    counted = [Counter(map(_named, outcomes)) for outcomes in episodes["outcomes"]]
    parts = {name: [counts[name] for counts in counted] for name in STEP_OUTCOMES}
    shares = _shares(run, episodes.assign(**parts), STEP_OUTCOMES)
    models = pd.Series(run.design.model_names, name="model")
    sizes = models.map(episodes["model"].value_counts()).fillna(0).astype("int64")
    table = pd.DataFrame({"model": models, "episodes": sizes})
    return joined_shares(table, shares, ["model"]).rename(columns={"whole": "steps"})


def _shares(
    run: Run, episodes: pd.DataFrame, parts: Sequence[str], whole: str | None = None
) -> pd.DataFrame:
    """See `shares_of`; by model."""
    rows = episodes.assign(replied=has_reply(episodes))
    return shares_of(run, rows, parts, whole=whole).droplevel(CELL)


def progress_frame(run: Run) -> pd.DataFrame:
    """One row a model and step: the curve of how a goal grows.

    `blocks` is the mean share of a goal's blocks that are placed after `step` steps, an episode
    that has ended keeping what it had; `under_way` the share of episodes that have not ended
    before that step; `*_lo` and `*_hi` bound their 95 % intervals. Steps go as far as the longest
    episode of any model. A model without any reply has no rows.
    """
    episodes = episodes_frame(run)
    steps = range(1, 1 + (int(episodes["steps"].max()) if len(episodes) else 0))
    reached = [_padded(progress, len(steps)) for progress in episodes["progress"]]
    blocks = np.array(reached, dtype=np.float64).reshape(len(episodes), len(steps))
    curves = {
        "blocks": blocks / episodes["n_blocks"].to_numpy()[:, None],
        "under_way": episodes["steps"].to_numpy()[:, None] >= np.array(steps),
    }
    parts = []
    for curve, counts in curves.items():
        names = [str(step) for step in steps]
        counted = pd.DataFrame(counts, columns=names, index=episodes.index, dtype="float64")
        rows = pd.concat([episodes.assign(episodes=1), counted], axis=1)
        shares = _shares(run, rows, names, "episodes")
        table = pd.DataFrame(
            {
                f"{curve}{end}": shares[[f"{name}_{kind}" for name in names]].to_numpy().ravel()
                for end, kind in {"": "share", "_lo": "lo", "_hi": "hi"}.items()
            },
            index=pd.MultiIndex.from_product([shares.index, steps], names=["model", "step"]),
        )
        parts.append(table)
    known = pd.concat(parts, axis=1).dropna(subset=["blocks"])
    models = set(known.index.get_level_values("model"))
    return known.loc[[name for name in run.design.model_names if name in models]].reset_index()


def _padded(progress: tuple[int, ...], length: int) -> list[int]:
    last = progress[-1] if progress else 0
    return [*progress, *[last] * (length - len(progress))]


def _named(outcome: str) -> str:
    return outcome if outcome in STEP_OUTCOMES else "unread"
