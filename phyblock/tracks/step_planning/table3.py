"""The paper's Table 3, step by step in the simulator, with the published numbers beside."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from phyblock.tables.cells import METRIC_NAMES, METRICS, SIDE_METRICS
from phyblock.tables.headline import interval_frame, interval_view
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL
from phyblock.tables.paper_numbers import (
    NOTHING,
    OURS,
    PUBLISHED,
    beside_view,
    cell_text,
    interleaved,
    published_table,
    row_name,
)
from phyblock.tables.text_table import NO_VALUE, Column, TextTable, number
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.step_planning.episodes import STEP_OUTCOMES, endings_frame
from phyblock.tracks.step_planning.measures import COUNTED, NAME, is_asked
from phyblock.tracks.step_planning.rules import ENDINGS
from phyblock.tracks.step_planning.spec import StepsSpec

__all__ = [
    "ENDING_NAMES",
    "endings_view",
    "episodes_in_terminal",
    "moves_view",
    "paper_table3_frame",
    "paper_table3_view",
    "progress_view",
    "published_scores",
    "step_intervals",
    "step_intervals_view",
    "step_scores_frame",
    "table3_frame",
    "table3_view",
]

_MODEL = Column("Model", is_text=True)
_GROUPS = {"placed": "Placed blocks", "attempted": "All attempted moves"}
ENDING_NAMES = {
    "completed": "Completed",
    "done": "Said Done",
    "collapsed": "Collapsed",
    "max_steps": "Step limit",
    "max_failures": "Failures in a row",
    "max_repeats": "Repeats",
    "max_tokens": "Token limit",
    "max_cost": "Cost limit",
    "unanswered": "Unanswered",
}
"""What people read in the place of each ending."""
_OUTCOMES = {
    "placed": "Placed",
    "shape_not_in_gt": "Shape not in GT",
    "overflow": "Overflow",
    "incorrect_orientation": "Incorrect orientation",
    "dependency_not_met": "Dependency not met",
    "invalid": "No candidate",
    "unread": "Unread",
    "done": "Done",
}
_CURVE = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 30, 44)


def step_scores_frame(run: Run) -> pd.DataFrame:
    """One row a model, setting and way of counting: n, tp, fp, fn, micro averages in [0, 1].

    `*_mean` and `*_sd` (ddof = 1) are taken over the micro averages of single seeds. A model
    without any reply has counts, if the suite counts empty plans, but no metrics.
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
    frame[counts] = frame[counts].fillna(0).astype("int64")
    found = track_estimates(run, NAME)
    parts = {
        (metric, kind): found[found["measure"] == metric].set_index(keys)[kind].astype("float64")
        for metric in METRICS
        for kind in ("value", "mean", "sd")
    }
    for metric in METRICS:
        frame = frame.join(parts[metric, "value"].rename(metric), on=keys)
    for metric in METRICS:
        for kind in ("mean", "sd"):
            frame = frame.join(parts[metric, kind].rename(f"{metric}_{kind}"), on=keys)
    return frame


def step_intervals(run: Run) -> pd.DataFrame:
    """F1 in the headline setting, pooled over seeds: a row a model and way of counting.

    Columns are model, cell (`placed` or `attempted`), value, lo, hi, se [%], n, n_scenes,
    n_clusters.
    """
    found = track_estimates(run, NAME)
    found = found[(found["measure"] == "f1") & found["value"].notna()].drop(columns=CELL)
    found = found.rename(columns={"criterion": CELL}).sort_values(CELL, kind="stable")
    table = interval_frame(found, run.design, 100.0, [CELL])
    return table.drop(columns="seeds")


def step_intervals_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Out of `step_intervals`."""
    return interval_view(table, run, list(dict.fromkeys(table[CELL])), "F1 of step planning")


def table3_frame(run: Run) -> pd.DataFrame:
    """The paper's Table 3 [%], unrounded: one row a model, and one as published where it has one.

    `placed_*` are over the blocks in the world, as the published numbers are taken to be;
    `attempted_*` over every attempted move, our stricter figure; `completion` and `detour` as in
    `endings_frame`, `completion` in percent. Under the headline setting; with more than one seed
    means over seeds, and `*_sd` beside them.
    """
    design = run.design
    several = len(design.suite.seeds) > 1
    scores: dict[tuple[str, str], Any] = {
        (row["model"], row["criterion"]): row
        for row in step_scores_frame(run).to_dict("records")
        if row["setting"] == design.setting
    }
    endings: dict[str, Any] = {row["model"]: row for row in endings_frame(run).to_dict("records")}
    kinds = {"": "_mean", "_sd": "_sd"} if several else {"": ""}
    rows: list[dict[str, Any]] = []
    for model in design.model_names:
        row: dict[str, Any] = {"model": model, "source": OURS, "published_name": ""}
        for criterion in COUNTED:
            cells = scores[(model, criterion)]
            row |= {
                f"{criterion}_{metric}{ending}": 100 * cells[f"{metric}{kind}"]
                for metric in METRICS
                for ending, kind in kinds.items()
            }
        ended = endings[model]
        row |= {"completion": 100 * ended["completion"], "detour": ended["detour"], "n": ended["n"]}
        rows.append(row)
        if printed := published_scores(design.published.get(model, "")):
            about = {"model": model, "source": PUBLISHED}
            rows.append({**about, "published_name": design.published[model], **printed})
    return pd.DataFrame(rows)


def published_scores(model: str) -> dict[str, float]:
    """What Table 3 prints for a model [%], by `placed_<metric>`; empty where it has no row."""
    table = published_table(3)
    rows = table[table["model"] == model]
    return {f"placed_{m}": float(v) for m, v in zip(rows["metric"], rows["value"], strict=True)}


def table3_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Table 3 in the paper's layout out of `table3_frame`, and what more an episode tells."""
    columns = [
        Column(METRIC_NAMES[m], _GROUPS[criterion]) for criterion in COUNTED for m in METRICS
    ]
    cells = [f"{criterion}_{metric}" for criterion in COUNTED for metric in METRICS]
    rows = tuple(
        (
            row_name(row),
            *(cell_text(row, cell) for cell in cells),
            number(row["completion"]),
            number(row["detour"], 2),
        )
        for row in table.to_dict("records")
    )
    return TextTable(
        f"Step-by-step planning (%){run.design.of_suite}",
        (_MODEL, *columns, Column("Completed"), Column("Steps / fewest")),
        rows,
        tuple(_notes(table, run)),
    )


def _notes(table: pd.DataFrame, run: Run) -> list[str]:
    steps = run.section("steps", StepsSpec)
    seeds = len(run.design.suite.seeds)
    accepts = steps.setting or run.design.setting
    notes = [
        f"Scored in setting {run.design.setting}. The simulator goes by setting {accepts}, gating "
        f"{steps.gating}, physics {steps.physics}; feedback {steps.feedback}, "
        f"history as {steps.history}. Micro averages.",
        "Placed blocks: those in the world; one is wrong when the goal has no such block left in "
        "this setting, or when it fell. A simulator that goes by the same setting places no wrong "
        "one, so precision is then below 100 by collapses alone. The paper does not say how its "
        "simulator or its precision worked.",
        "All attempted moves: moves that placed nothing are wrong as well.",
    ]
    if seeds > 1:
        notes.append(f"Mean ± standard deviation over {seeds} seeds.")
    ours = table[table["source"] == OURS]
    expected = run.design.samples(NAME)
    short = [
        f"{row['model']} {row['n']:.0f}" for row in ours.to_dict("records") if row["n"] < expected
    ]
    if short:
        notes.append(f"Scored of {expected} episodes: {', '.join(short)}.")
    return notes


def endings_view(table: pd.DataFrame, run: Run) -> TextTable:
    """How episodes ended, out of `endings_frame`; ways in which none ended are left out."""
    ways = [name for name in ENDINGS if table[name].sum() or name in ("completed", "done")]
    columns = [Column(ENDING_NAMES[name]) for name in ways]
    rows = tuple(
        (
            row["model"],
            str(row["n"]),
            *(_share(row[name], row["n"]) for name in ways),
            number(row["steps"]),
            number(row["detour"], 2),
        )
        for row in table.to_dict("records")
    )
    return TextTable(
        f"How episodes ended (%){run.design.of_suite}",
        (_MODEL, Column("Episodes"), *columns, Column("Steps"), Column("Steps / fewest")),
        rows,
        ("Steps is the mean over all episodes; Steps / fewest is over those completed.",),
    )


def moves_view(table: pd.DataFrame, run: Run) -> TextTable:
    """What became of steps, out of `moves_frame`."""
    rows = tuple(
        (
            row["model"],
            str(row["steps"]),
            *(number(100 * row[f"{name}_share"]) for name in STEP_OUTCOMES),
        )
        for row in table.to_dict("records")
    )
    columns = [Column(_OUTCOMES[name]) for name in STEP_OUTCOMES]
    return TextTable(
        f"What became of steps (%){run.design.of_suite}",
        (_MODEL, Column("Steps"), *columns),
        rows,
        ("Shares of all steps. Unread: no single operation could be read in the reply.",),
    )


def progress_view(table: pd.DataFrame, run: Run) -> TextTable:
    """The curve out of `progress_frame`, at some steps."""
    longest = int(table["step"].max()) if len(table) else 0
    shown = [step for step in _CURVE if step <= longest]
    curves = table.set_index(["model", "step"])["blocks"].to_dict()
    rows = tuple(
        (model, *(number(100 * curves.get((model, step), np.nan)) for step in shown))
        for model in run.design.model_names
    )
    return TextTable(
        f"Blocks of the goal that are placed after so many steps (%){run.design.of_suite}",
        (_MODEL, *(Column(str(step)) for step in shown)),
        rows,
        ("Mean over episodes; one that has ended keeps what it had. Every step: progress.csv.",),
    )


def _share(count: int, whole: int) -> str:
    return number(100 * count / whole) if whole else NO_VALUE


def paper_table3_frame(run: Run) -> pd.DataFrame:
    """Precision, recall and F1 of step planning beside the paper's Table 3."""
    cells = [f"placed_{metric}" for metric in METRICS]
    return interleaved(table3_frame(run), cells) if is_asked(run) else NOTHING


def paper_table3_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Out of `paper_table3_frame`."""
    note = f"Setting {run.design.setting}; precision is over the blocks that were placed."
    names = {f"placed_{metric}": name for metric, name in METRIC_NAMES.items()}
    return beside_view(table, run, number_in_paper=3, names=names, note=note)


def episodes_in_terminal(view: TextTable, _: pd.DataFrame) -> tuple[TextTable, ...]:
    """A table of episodes without its notes, and without side metrics where it is too wide."""
    whole = replace(view, notes=())
    return whole, whole.without(SIDE_METRICS)
