"""How much the order of the candidates matters: the spread over seeds, plans that stay, poses."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from phyblock.tables.headline import headline_rows
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL
from phyblock.tables.shares import shares_of
from phyblock.tables.text_table import Column, TextTable, between, number
from phyblock.tables.track_report import WHOLE
from phyblock.tracks.estimates import counted_samples, track_estimates
from phyblock.tracks.poses import POSE_COUNTS, POSE_MEASURES

__all__ = ["order_frame", "order_in_terminal", "order_view"]

_INTERVAL = {"value": "", "lo": "_lo", "hi": "_hi"}
_ENDS = {**_INTERVAL, **{end: f"_{end}" for end in ("mean", "sd", "least", "most")}}
_SPREAD = ("f1_mean", "f1_sd", "f1_least", "f1_most")
_SAME = {"_share": "", "_lo": "_lo", "_hi": "_hi"}
_HOW = {
    "shuffled": "Each seed draws another order of the candidates.",
    "file": "Candidates stand in the order of the file with every seed.",
    "varied": "The order of the candidates is varied; plans are compared within a way of asking.",
}
_POSES = tuple(measure.name for measure in POSE_MEASURES)


def order_frame(track: str, criterion: str, run: Run) -> pd.DataFrame:
    """One row a model: what another order of the candidates changes; shares in [0, 1].

    `order` is that of the run (or `varied`); shuffled, each of the `seeds` is another one, and in
    the file's they are repeats, to hold the others against. `f1` pools seeds; over single seeds it
    has `f1_mean`, `f1_sd` (ddof = 1), `f1_least` and `f1_most`; of all scenes in the headline
    setting, counted by `criterion`. `same_plan` is the share of `plan_pairs` (a scene with two
    seeds) in which the plan names the same blocks in the same order. `pose_first` is the share of
    `pose_first_n` kinds that were named in the right pose where that is listed first among several,
    `pose_later` of `pose_later_n` where a wrong one is; `pose_gap` is their difference. `*_lo` and
    `*_hi` bound 95 % intervals. Empty where the run has no samples of the track.
    """
    design = run.design
    records = run.records[run.records["track"] == track]
    estimates = headline_rows(track_estimates(run, track), design)
    estimates = estimates[
        (estimates[CELL] == WHOLE.name) & estimates["criterion"].isin(["", criterion])
    ]
    known = estimates.set_index(["measure", "model"]).to_dict("index")
    plans = _same_plans(records)
    same = shares_of(run, plans, ("same",), whole="pairs").droplevel(CELL).to_dict("index")
    named = counted_samples(run, track, POSE_COUNTS)
    counts = named[named[CELL] == WHOLE.name].groupby("model")[list(POSE_COUNTS.columns)].sum()
    rows = []
    for model in design.model_names if len(records) else ():
        row: dict[str, Any] = {"model": model, "order": _order(run)}
        row["seeds"] = len(design.suite.seeds)
        estimate = known.get(("f1", model), {})
        row |= {f"f1{name}": estimate.get(end, np.nan) for end, name in _ENDS.items()}
        mine = same.get(model, {})
        row |= {f"same_plan{name}": mine.get(f"same{end}", np.nan) for end, name in _SAME.items()}
        row["plan_pairs"] = int(mine.get("whole", 0))
        for name in _POSES:
            estimate = known.get((name, model), {})
            row |= {f"{name}{of}": estimate.get(end, np.nan) for end, of in _INTERVAL.items()}
        for name in ("first_n", "later_n"):
            row[f"pose_{name}"] = int(counts[name].get(model, 0))
        rows.append(row)
    return pd.DataFrame(rows)


def _order(run: Run) -> str:
    """The order of the candidates, `varied` where ways of asking differ in it."""
    suite = run.design.suite
    return "varied" if "candidate_order" in suite.vary.factors else suite.candidates.order


def _same_plans(records: pd.DataFrame) -> pd.DataFrame:
    """How many pairs of plans are the `same`, of how many `pairs`: a row a model and scene."""
    read = records[records["rule"].notna() | records["ending"].notna()]
    rows = []
    for (model, scene, _), plans in read.groupby(["model", "scene", "variant"])["file_plan"]:
        alike = [one == other for one, other in combinations(plans, 2)]
        rows.append((model, scene, 0, True, sum(alike), len(alike)))
    return pd.DataFrame(rows, columns=["model", "scene", "seed", "replied", "same", "pairs"])


def order_view(table: pd.DataFrame, run: Run) -> TextTable:
    """A row a model out of `order_frame`, in percent."""
    columns = (
        Column("Model", is_text=True),
        *(Column(name, "F1") for name in ("%", "95 % CI")),
        *(Column(name, "F1 over seeds") for name in ("mean", "sd", "least", "most")),
        *(Column(name, "Same plan") for name in ("%", "95 % CI")),
        *(Column(name, "Right pose listed first") for name in ("%", "95 % CI", "n")),
        *(Column(name, "listed later") for name in ("%", "95 % CI", "n")),
        *(Column(name, "First less later") for name in ("%", "95 % CI")),
    )
    rows = tuple(_row(row) for row in table.to_dict("records"))
    how = _HOW[_order(run)]
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
        *_with_interval(row, "f1"),
        *(number(100 * row[name]) for name in _SPREAD),
        *_with_interval(row, "same_plan"),
        *_with_interval(row, "pose_first"),
        str(row["pose_first_n"]),
        *_with_interval(row, "pose_later"),
        str(row["pose_later_n"]),
        *_with_interval(row, "pose_gap", signed=True),
    )


def _with_interval(row: Any, name: str, *, signed: bool = False) -> tuple[str, str]:
    interval = between(100 * row[f"{name}_lo"], 100 * row[f"{name}_hi"], signed=signed)
    return number(100 * row[name]), interval


def order_in_terminal(view: TextTable, table: pd.DataFrame) -> tuple[TextTable, ...]:
    """The table where candidates were shuffled, without intervals where it is too wide; else it
    stands in the files alone.
    """
    is_shuffled = (table["order"] == "shuffled").any()
    return (view, view.without(["95 % CI"])) if is_shuffled else ()
