"""The paper's Table 3, step by step in the simulator, with the published numbers beside."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from phyblock.tables.cells import METRIC_NAMES, METRICS
from phyblock.tables.flat import joined_counts
from phyblock.tables.headline import (
    headline_rows,
    interval_frame,
    interval_view,
    narrower,
    seeds_notes,
    uncertainty_cells,
    uncertainty_columns,
)
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL
from phyblock.tables.paper_numbers import (
    NOTHING,
    OURS,
    PUBLISHED,
    beside_view,
    interleaved,
    published_table,
    row_name,
)
from phyblock.tables.text_table import Column, TextTable, number
from phyblock.tracks.base import ENGINE
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.step_planning.episodes import endings_frame
from phyblock.tracks.step_planning.measures import COUNTED, NAME, is_asked
from phyblock.tracks.step_planning.spec import StepsSpec

__all__ = [
    "paper_table3_frame",
    "paper_table3_view",
    "published_recall",
    "step_intervals",
    "step_intervals_view",
    "step_scores_frame",
    "table3_frame",
    "table3_in_terminal",
    "table3_view",
]

_MODEL = Column("Model", is_text=True)
_RECALL = "placed_recall"
"""What our numbers and the published ones both have: the blocks of the goal that stand."""
_SHOWN = {
    "completion": ("completion", ""),
    **{f"{way}_{metric}": (metric, way) for way in reversed(COUNTED) for metric in METRICS},
}
"""Measure and way of counting by column."""
_LEADING = {"completion": "Completed", "attempted_f1": "F1 of attempts"}
_FURTHER = {
    "attempted_precision": Column("Prec", "Attempts"),
    _RECALL: Column("Rec", "Goal blocks"),
    "placed_precision": Column("Prec", "Placed blocks"),
    "placed_f1": Column("F1", "Placed blocks"),
}
_CONSTRUCTION = (
    " The simulator goes by the same setting and places no wrong one: precision of placed blocks "
    "is 100 by construction, but for collapses, and tells no model from another."
)
_PUBLISHED_NOTE = (
    "Of the published numbers, of the paper's own scenes, recall alone stands beside ours: it is "
    "of the goal's blocks, whatever was tried. Precision, and F1 with it, depend on which wrong "
    "blocks a simulator lets stand, which the paper does not say; ours are no like numbers."
)


def step_scores_frame(run: Run) -> pd.DataFrame:
    """One row a model, setting and way of counting: n, tp, fp, fn, micro averages in [0, 1].

    `*_lo` and `*_hi` bound 95 % intervals; `*_mean` and `*_sd` (ddof = 1) are taken over the micro
    averages of single seeds. A model without any reply has counts, if the suite counts empty plans,
    but no metrics.
    """
    scores = run.scores[
        (run.scores["track"] == NAME) & ~run.scores["outcome"].isin(run.design.outcomes_left_out)
    ]
    keys = ["model", "setting", "criterion"]
    groups = scores.groupby(keys, sort=False)
    counts = ["n", "tp", "fp", "fn"]
    cells = [
        (model, setting, criterion)
        for model in run.design.model_names
        for setting in run.design.suite.settings
        for criterion in COUNTED
    ]
    frame = pd.DataFrame(cells, columns=keys)
    frame = frame.join(groups.size().rename("n"), on=keys).join(groups[counts[1:]].sum(), on=keys)
    frame[counts] = joined_counts(frame[counts])
    estimates = track_estimates(run, NAME)
    for ends in (("value",), ("lo", "hi"), ("mean", "sd")):
        for metric in METRICS:
            mine = (
                estimates[estimates["measure"] == metric]
                .set_index(keys)[list(ends)]
                .astype("float64")
            )
            names = {end: metric if end == "value" else f"{metric}_{end}" for end in ends}
            frame = frame.join(mine.rename(columns=names), on=keys)
    return frame


def step_intervals(run: Run) -> pd.DataFrame:
    """F1 in the headline setting, pooled over seeds: a row a model and way of counting.

    Columns are model, cell (`placed` or `attempted`), value, lo, hi, se [%], n, n_scenes,
    n_clusters.
    """
    estimates = track_estimates(run, NAME)
    estimates = estimates[(estimates["measure"] == "f1") & estimates["value"].notna()].drop(
        columns=CELL
    )
    estimates = estimates.rename(columns={"criterion": CELL}).sort_values(CELL, kind="stable")
    table = interval_frame(estimates, run.design, 100.0, [CELL])
    return table.drop(columns="seeds")


def step_intervals_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Shows the table of `step_intervals`."""
    return interval_view(table, run, list(dict.fromkeys(table[CELL])), "F1 of step planning")


def table3_frame(run: Run) -> pd.DataFrame:
    """The paper's Table 3 [%], unrounded: one row a model, and one as published where it has one.

    `completion` is the share of episodes that placed the whole goal; `attempted_*` are over every
    attempted move, `placed_*` over the blocks in the world; `completion` and `attempted_f1` have
    the ends `*_lo` and `*_hi` of an interval; `detour` as in `endings_frame`. Under the headline
    setting, pooled over seeds; with more than one seed `*_mean` and `*_sd` over single seeds.
    Published rows have the recall alone.
    """
    design = run.design
    estimates = headline_rows(track_estimates(run, NAME), design)
    known = estimates.set_index(["measure", "criterion", "model"]).to_dict("index")
    ends = ("mean", "sd") if len(design.suite.seeds) > 1 else ()
    wanted = [(name, end) for name in _LEADING for end in ("value", "lo", "hi")]
    wanted += [(name, "value") for name in _SHOWN if name not in _LEADING]
    wanted += [(name, end) for name in _SHOWN for end in ends]
    endings: dict[str, Any] = {row["model"]: row for row in endings_frame(run).to_dict("records")}
    rows: list[dict[str, Any]] = []
    for model in design.model_names:
        row: dict[str, Any] = {"model": model, "source": OURS, "published_name": ""}
        for name, end in wanted:
            value = known.get((*_SHOWN[name], model), {}).get(end, np.nan)
            row[name if end == "value" else f"{name}_{end}"] = 100 * value
        rows.append(row | {name: endings[model][name] for name in ("detour", "n")})
        recall = published_recall(design.published.get(model, ""))
        if recall is not None:
            about = {"model": model, "source": PUBLISHED}
            rows.append({**about, "published_name": design.published[model], _RECALL: recall})
    return pd.DataFrame(rows)


def published_recall(model: str) -> float | None:
    """The recall that Table 3 prints for a model [%], None where it has no row."""
    printed = published_table(3).set_index(["model", "metric"])["value"].to_dict()
    return printed.get((model, "recall"))


def table3_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Shows the table of `table3_frame`, completed goals and F1 of attempts first."""
    design = run.design
    columns = [
        column
        for group in _LEADING.values()
        for column in (Column("%", group), *uncertainty_columns(design, group))
    ]
    rows = tuple(
        (
            row_name(row),
            *(
                text
                for name in _LEADING
                for text in (number(row[name]), *uncertainty_cells(row, name, design))
            ),
            *(number(row[name]) for name in _FURTHER),
            number(row["detour"], 2),
        )
        for row in table.to_dict("records")
    )
    return TextTable(
        f"Step-by-step planning (%){run.design.of_suite}",
        (_MODEL, *columns, *_FURTHER.values(), Column("Steps / fewest")),
        rows,
        tuple(_notes(table, run)),
    )


def _other_engine(run: Run) -> str:
    """The engine, where it is not that of reference."""
    is_other = ENGINE in run.manifest.tracks.get(NAME, {})
    return f" in {run.manifest.engine}" if is_other and run.manifest.engine else ""


def _notes(table: pd.DataFrame, run: Run) -> list[str]:
    steps = run.section("steps", StepsSpec)
    accepts = steps.setting or run.design.setting
    notes = [
        f"Scored in setting {run.design.setting}. The simulator goes by setting {accepts}, gating "
        f"{steps.gating}, physics {steps.physics}{_other_engine(run)}; feedback {steps.feedback}, "
        f"history as {steps.history}. Micro averages.",
        "Completed: episodes that placed the whole goal. Attempts: all moves; those that placed "
        "nothing are wrong. Placed blocks: those in the world; one is wrong when the goal has no "
        "such block left in this setting, or when it fell."
        + (_CONSTRUCTION if accepts == run.design.setting else ""),
        *seeds_notes(run.design),
    ]
    if (table["source"] == PUBLISHED).any():
        notes.append(_PUBLISHED_NOTE)
    ours = table[table["source"] == OURS]
    expected = run.design.samples(NAME)
    short = [
        f"{row['model']} {row['n']:.0f}" for row in ours.to_dict("records") if row["n"] < expected
    ]
    if short:
        notes.append(f"Scored of {expected} episodes: {', '.join(short)}.")
    return notes


def paper_table3_frame(run: Run) -> pd.DataFrame:
    """Recall of step planning beside the paper's Table 3; see the note of its view."""
    return interleaved(table3_frame(run), [_RECALL]) if is_asked(run) else NOTHING


def paper_table3_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Shows the table of `paper_table3_frame`."""
    note = f"Setting {run.design.setting}. {_PUBLISHED_NOTE}"
    names = {_RECALL: METRIC_NAMES["recall"]}
    return beside_view(table, run, number_in_paper=3, names=names, note=note)


def table3_in_terminal(view: TextTable, _: pd.DataFrame) -> tuple[TextTable, ...]:
    """Table 3 without its notes; where it is too wide, without what says less, bit by bit."""
    whole = replace(view, notes=())
    return whole, *narrower(whole.without(("Prec", "F1")))
