"""How much the order of the candidates matters: the spread over seeds, plans that stay, poses."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from phyblock.scoring.ratios import f1_of
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL
from phyblock.tables.text_table import Column, TextTable, between, number
from phyblock.tables.track_report import WHOLE
from phyblock.tracks.estimates import counted_samples, track_estimates
from phyblock.tracks.poses import POSE_COUNTS, POSE_MEASURES

__all__ = ["order_frame", "order_in_terminal", "order_view"]

_SPREAD = ("f1", "f1_sd", "f1_least", "f1_most")
_POSES = tuple(measure.name for measure in POSE_MEASURES)


def order_frame(track: str, criterion: str, matcher: str, run: Run) -> pd.DataFrame:
    """One row a model: what another order of the candidates changes; shares in [0, 1].

    `order` is that of the run; shuffled, each of the `seeds` is another one, and in the file's they
    are repeats, to hold the others against. `f1` is the mean over seeds with `f1_sd` (ddof = 1),
    `f1_least` and `f1_most`, of all scenes in the headline setting, counted by `criterion`.
    `same_plan` is the share of `plan_pairs` (a scene with two seeds) in which the plan names the
    same blocks in the same order. `pose_first` is the share of `pose_first_n` kinds that were named
    in the right pose where that is listed first among several, `pose_later` of `pose_later_n` where
    a wrong one is; `pose_gap` is their difference, with a 95 % interval. Empty where the run has
    no samples of the track.
    """
    design = run.design
    records = run.records[run.records["track"] == track]
    spread = _over_seeds(run, track, criterion, matcher)
    found = track_estimates(run, track)
    poses = found[found[CELL] == WHOLE.name].set_index(["measure", "model"]).sort_index()
    named = counted_samples(run, track, POSE_COUNTS)
    counts = named[named[CELL] == WHOLE.name].groupby("model")[list(POSE_COUNTS.columns)].sum()
    rows = []
    for model in design.model_names if len(records) else ():
        same, pairs = _same_plans(records[records["model"] == model])
        row: dict[str, Any] = {"model": model, "order": design.suite.candidates.order}
        row["seeds"] = len(design.suite.seeds)
        row |= dict(zip(_SPREAD, spread.get(model, [np.nan] * len(_SPREAD)), strict=True))
        row |= {"same_plan": same / pairs if pairs else np.nan, "plan_pairs": pairs}
        for name in _POSES:
            row[name] = poses["value"].get((name, model), np.nan)
        for end in ("lo", "hi"):
            row[f"pose_gap_{end}"] = poses[end].get((_POSES[-1], model), np.nan)
        for name in ("first_n", "later_n"):
            row[f"pose_{name}"] = int(counts[name].get(model, 0))
        rows.append(row)
    return pd.DataFrame(rows)


def _over_seeds(run: Run, track: str, criterion: str, matcher: str) -> dict[str, list[float]]:
    """Mean, standard deviation, least and greatest F1 of single seeds, by model."""
    scores = run.scores
    kept = (scores["track"] == track) & (scores["criterion"] == criterion)
    kept &= (scores["setting"] == run.design.setting) & (scores["matcher"] == matcher)
    kept &= ~scores["outcome"].isin(run.design.outcomes_left_out)
    sums = scores[kept].groupby(["model", "seed"])[["tp", "fp", "fn"]].sum()
    values = pd.Series(f1_of(sums.to_numpy(np.float64)), index=sums.index)
    each = values.groupby(level="model")
    table = each.agg(["mean", "std", "min", "max"])
    return {str(model): [float(value) for value in row] for model, *row in table.itertuples()}


def _same_plans(records: pd.DataFrame) -> tuple[int, int]:
    """How many pairs of plans for one scene are the same, of how many."""
    same = pairs = 0
    read = records[records["rule"].notna() | records["ending"].notna()]
    for _, plans in read.groupby("scene")["file_plan"]:
        for one, other in combinations(plans, 2):
            same += one == other
            pairs += 1
    return same, pairs


def order_view(table: pd.DataFrame, run: Run) -> TextTable:
    """A row a model out of `order_frame`, in percent."""
    columns = (
        Column("Model", is_text=True),
        *(Column(name, "F1 over seeds") for name in ("mean", "sd", "least", "most")),
        Column("Same plan"),
        *(Column(name, "Right pose listed first") for name in ("%", "n")),
        *(Column(name, "listed later") for name in ("%", "n")),
        *(Column(name, "First less later") for name in ("%", "95 % CI")),
    )
    rows = tuple(_row(row) for row in table.to_dict("records"))
    is_shuffled = run.design.suite.candidates.order == "shuffled"
    how = (
        "Each seed draws another order of the candidates."
        if is_shuffled
        else "Candidates stand in the order of the file with every seed."
    )
    suite = f", suite {run.design.suite.name}" if run.design.suite.name else ""
    return TextTable(
        f"What the order of the candidates changes (%){suite}",
        columns,
        rows,
        (
            f"{how} Setting {run.design.setting}, all scenes.",
            "Same plan: of two seeds for one scene, how often the same blocks in the same order.",
            "Right pose: of kinds that are offered in wrong poses too, how often the one that is "
            "named first is right, where a right one is listed first and where a wrong one is.",
        ),
    )


def _row(row: Any) -> tuple[str, ...]:
    return (
        row["model"],
        *(number(100 * row[name]) for name in (*_SPREAD, "same_plan", "pose_first")),
        str(row["pose_first_n"]),
        number(100 * row["pose_later"]),
        str(row["pose_later_n"]),
        number(100 * row["pose_gap"]),
        between(100 * row["pose_gap_lo"], 100 * row["pose_gap_hi"], signed=True),
    )


def order_in_terminal(view: TextTable, table: pd.DataFrame) -> tuple[TextTable, ...]:
    """The table where candidates were shuffled; else it stands in the files alone."""
    return (view,) if (table["order"] == "shuffled").any() else ()
