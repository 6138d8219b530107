"""Table C, what a pose costs a model, and what was wrong with the steps."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from typing import Any

import pandas as pd

from phyblock.scoring.pose import POSE_ERRORS
from phyblock.scoring.pose_matching import TOLERANCES_CM
from phyblock.tables.design import OVERALL
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL
from phyblock.tables.text_table import Column, TextTable, between, level_name, number, with_interval
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.pose_planning.measures import (
    ERROR_NAMES,
    NAME,
    POSE_PLANNING_MEASURES,
    error_measure,
    is_asked,
    tolerance_measure,
)

__all__ = [
    "pose_errors_frame",
    "pose_errors_view",
    "table_c_frame",
    "table_c_in_terminal",
    "table_c_view",
]

_INTERVAL = "95 % CI"
_INTERVAL_C = f"C, {_INTERVAL}"
_SETTINGS = {"f1_a": "A", "f1_b": "B", "f1_c": "C"}
_CURVE = {tolerance_measure("absolute", cm): f"{cm:g} cm" for cm in TOLERANCES_CM}
_CARRIED = {
    "stands": "Stand",
    "reached": "Reached",
    "final_iou": "IoU",
    "completed": "Completed",
}
_SHOWN = (*_SETTINGS, *_CURVE, "f1_c_aligned", "position_error", *_CARRIED)
_SCALES = {measure.name: measure.scale for measure in POSE_PLANNING_MEASURES}


def _overall(run: Run) -> dict[tuple[str, str], dict[Hashable, Any]]:
    """Estimates over all scenes by model and measure."""
    estimates = track_estimates(run, NAME)
    rows = estimates[estimates[CELL] == OVERALL].to_dict("records")
    return {(str(row["model"]), str(row["measure"])): row for row in rows}


@made_once_copied
def table_c_frame(run: Run) -> pd.DataFrame:
    """One row a model, over all scenes: F1 without poses in A and in B, with them in C, and what
    became of plans that were carried out, each with the ends of a 95 % interval.

    Shares in percent, distances in centimeters; `n` plans.
    """
    rows = []
    known = _overall(run)
    for model in run.design.model_names if is_asked(run) else ():
        row: dict[str, Any] = {"model": model, "n": int(_of(known, model, "final_iou").get("n", 0))}
        for name in _SHOWN:
            estimate = _of(known, model, name)
            for end, suffix in (("value", ""), ("lo", "_lo"), ("hi", "_hi")):
                row[f"{name}{suffix}"] = _SCALES[name] * float(estimate.get(end, float("nan")))
        rows.append(row)
    return pd.DataFrame(rows)


def _of(
    known: Mapping[tuple[str, str], Mapping[Hashable, Any]], model: str, name: str
) -> Mapping[Hashable, Any]:
    return known.get((model, name), {})


def table_c_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Table C out of `table_c_frame`."""
    columns = [Column("Model", is_text=True)]
    columns += [Column(name, "F1 in") for name in _SETTINGS.values()]
    columns += [Column(_INTERVAL_C, "F1 in")]
    columns += [Column(name, "F1 in C at") for name in _CURVE.values()]
    columns += [Column("aligned", "F1 in C"), Column("cm", "Off by")]
    columns += [Column(name, "Carried out") for name in _CARRIED.values()]
    rows = [
        (
            row["model"],
            *(number(row[name]) for name in _SETTINGS),
            between(row["f1_c_lo"], row["f1_c_hi"]),
            *(number(row[name]) for name in _CURVE),
            number(row["f1_c_aligned"]),
            number(row["position_error"], 2),
            *(number(row[name]) for name in _CARRIED),
        )
        for row in table.to_dict("records")
    ]
    return TextTable(
        f"What poses cost (%){run.design.of_suite}",
        tuple(columns),
        tuple(rows),
        (
            f"One reply, scored three times: A and B leave out the poses, matcher "
            f"{run.design.matcher}; C is the mean of F1 at 0.5, 1, 2 and 4 cm and 15 degrees. "
            f"{level_name(OVERALL)}; micro averages.",
            "Aligned: after the best shift over the floor and turn of the whole plan. Off by: mean "
            "distance of steps from the blocks that they stand for. Stand: steps "
            "carried out that stay and let others stay. Reached: blocks of the goal in their "
            "places in the end. IoU: of all that stands then with the goal.",
        ),
    )


def table_c_in_terminal(view: TextTable, _: pd.DataFrame) -> tuple[TextTable, ...]:
    """All of it, else without tolerances, else without intervals too."""
    short = view.without(list(_CURVE.values()))
    return view, short, short.without([_INTERVAL_C, "cm"])


@made_once_copied
def pose_errors_frame(run: Run) -> pd.DataFrame:
    """One row a model and error, over all scenes: its share of all steps with a 95 % interval [%];
    `n` plans.
    """
    known = _overall(run)
    rows = []
    for model in run.design.model_names if is_asked(run) else ():
        for error in POSE_ERRORS:
            estimate = _of(known, model, error_measure(error))
            ends = {
                end: 100 * float(estimate.get(end, float("nan"))) for end in ("value", "lo", "hi")
            }
            rows.append({"model": model, "error": error, **ends, "n": int(estimate.get("n", 0))})
    return pd.DataFrame(rows)


def pose_errors_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Shares of the errors out of `pose_errors_frame`, a row a model."""
    cells = {(row["model"], row["error"]): row for row in table.to_dict("records")}
    names = ("%", _INTERVAL)
    columns = [Column(name, ERROR_NAMES[error]) for error in POSE_ERRORS for name in names]
    rows = [
        (
            str(model),
            *(text for error in POSE_ERRORS for text in with_interval(cells[model, error])),
        )
        for model in dict.fromkeys(table["model"] if len(table) else ())
    ]
    return TextTable(
        f"What was wrong with steps that have poses{run.design.of_suite}",
        (Column("Model", is_text=True), *columns),
        tuple(rows),
        (
            "Shares of all steps, of which the rest was right within 1 cm and stood; each step "
            "counts by the first error that it meets. docs/pose.md says what each is.",
        ),
    )
