"""How episodes went, as tables a person reads: ends, moves, progress."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from phyblock.tables.load import Run
from phyblock.tables.shares import share_texts
from phyblock.tables.text_table import Column, TextTable, between, number
from phyblock.tracks.step_planning.episodes import STEP_OUTCOMES
from phyblock.tracks.step_planning.rules import ENDINGS

__all__ = [
    "ENDING_NAMES",
    "OUTCOME_NAMES",
    "endings_in_terminal",
    "endings_view",
    "moves_view",
    "progress_view",
]

_MODEL = Column("Model", is_text=True)
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
OUTCOME_NAMES = {
    "placed": "Placed",
    "shape_not_in_gt": "Shape not in GT",
    "overflow": "Overflow",
    "incorrect_orientation": "Incorrect orientation",
    "dependency_not_met": "Dependency not met",
    "invalid": "No candidate",
    "unread": "Unread",
    "done": "Done",
}
"""What people read in the place of each outcome of a step."""
_OF_SHARE = ("%", "95 % CI")
_CURVE = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16, 20, 30, 44)


def endings_view(table: pd.DataFrame, run: Run) -> TextTable:
    """How episodes ended, out of `endings_frame`; ways in which none ended are left out."""
    ways = [name for name in ENDINGS if table[name].sum() or name in ("completed", "done")]
    columns = [Column(kind, ENDING_NAMES[name]) for name in ways for kind in _OF_SHARE]
    rows = tuple(
        (
            row["model"],
            str(row["n"]),
            *(text for name in ways for text in share_texts(row, name)),
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


def endings_in_terminal(view: TextTable, _: pd.DataFrame) -> tuple[TextTable, ...]:
    """How episodes ended, without notes, and without intervals where it is too wide."""
    whole = replace(view, notes=())
    return whole, whole.without(_OF_SHARE[1:])


def moves_view(table: pd.DataFrame, run: Run) -> TextTable:
    """What became of steps, out of `moves_frame`."""
    rows = tuple(
        (
            row["model"],
            str(row["steps"]),
            *(text for name in STEP_OUTCOMES for text in share_texts(row, name)),
        )
        for row in table.to_dict("records")
    )
    columns = [Column(kind, OUTCOME_NAMES[name]) for name in STEP_OUTCOMES for kind in _OF_SHARE]
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
    names = ["blocks", "blocks_lo", "blocks_hi"]
    curves = table.set_index(["model", "step"])[names].to_dict("index")
    none = dict.fromkeys(names, np.nan)
    rows = []
    for model in run.design.model_names:
        points = [curves.get((model, step), none) for step in shown]
        rows.append((model, *(number(100 * point["blocks"]) for point in points)))
        ends = (between(100 * point["blocks_lo"], 100 * point["blocks_hi"]) for point in points)
        rows.append(("  95 % CI", *ends))
    return TextTable(
        f"Blocks of the goal that are placed after so many steps (%){run.design.of_suite}",
        (_MODEL, *(Column(str(step)) for step in shown)),
        tuple(rows),
        ("Mean over episodes; one that has ended keeps what it had. Every step: progress.csv.",),
    )
