"""The frames as tables a person reads: captions, headings, rounded cells, notes."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd

from phyblock.scoring.plan import ERROR_TYPES, ErrorType
from phyblock.tables.cells import METRIC_NAMES, METRICS, SIDE_METRICS
from phyblock.tables.design import OVERALL, Design
from phyblock.tables.headline import narrower, seeds_notes, uncertainty_cells, uncertainty_columns
from phyblock.tables.load import Run
from phyblock.tables.paper_numbers import beside_by_level
from phyblock.tables.shares import share_texts
from phyblock.tables.text_table import NO_VALUE, Column, TextTable, level_name, number
from phyblock.tracks.full_planning.assembly import assembly_frame, headline_cells, level_column
from phyblock.tracks.full_planning.errors import levels_in_order
from phyblock.tracks.full_planning.published import (
    PUBLISHED_LEVELS,
    PUBLISHED_SETTING,
    comparison_notes,
    largest_differences,
)

__all__ = [
    "ERROR_NAMES",
    "errors_in_terminal",
    "errors_view",
    "how_counted",
    "published_view",
    "table1_in_terminal",
    "table1_view",
]

_MODEL = Column("Model", is_text=True)
ERROR_NAMES: dict[ErrorType, str] = {
    "shape_not_in_gt": "Shape not in GT",
    "overflow": "Overflow",
    "incorrect_orientation": "Incorrect orientation",
    "dependency_not_met": "Dependency not met",
}
_COUNTED = ("Plans", "Wrong steps")
_OF_TYPE = ("n", "%", "95 % CI")
_LABELS_NOTE = (
    "Prec, Rec, F1 are labeled by what they are. The paper prints its model rows as precision, "
    "recall, F1 under the header “Rec, Prec, F1”; only its Random row is as that header says."
)


def table1_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Table 1 in the paper's layout out of `table1_frame`."""
    design = run.design
    cells = [level_column(level, metric) for level in design.levels for metric in METRICS]
    columns = [
        Column(METRIC_NAMES[metric], level_name(level))
        for level in design.levels
        for metric in METRICS
    ]
    rows = tuple(
        (
            row["model"],
            *(number(row[cell]) for cell in cells),
            *uncertainty_cells(row, cells[-1], design),
        )
        for row in table.to_dict("records")
    )
    return TextTable(
        f"Assembly planning (%){design.of_suite}",
        (_MODEL, *columns, *uncertainty_columns(design, level_name(OVERALL))),
        rows,
        (how_counted(design), *_table1_notes(run), _LABELS_NOTE),
    )


def _table1_notes(run: Run) -> list[str]:
    cells = headline_cells(assembly_frame(run), run.design)
    overall = cells[cells["level"] == OVERALL]
    short = overall[overall["n"] < overall["expected"]]
    notes = [*seeds_notes(run.design)]
    if len(short):
        counts = zip(short["model"], short["n"], strict=True)
        listed = ", ".join(f"{model} {n}" for model, n in counts)
        notes.append(f"Scored of {run.design.expected(OVERALL)} samples: {listed}.")
    if run.design.suite.scoring.missing == "count":
        notes += _empty_plan_notes(cells)
    for note, rows in overall[overall["seed_note"] != ""].groupby("seed_note", sort=False):
        notes.append(f"{', '.join(rows['model'])}: {note}.")
    return notes


def _empty_plan_notes(cells: pd.DataFrame) -> list[str]:
    """Which models have samples without a reply, by kind; a lone kind needs no number."""
    listed = []
    for row in cells[cells["level"] == OVERALL].to_dict("records"):
        kinds = {"API errors": row["api_errors"], "missing replies": row["missing"]}
        kinds = {name: count for name, count in kinds.items() if count}
        if kinds:
            each = [f"{name} {count}" for name, count in kinds.items()]
            why = ", ".join(kinds if len(kinds) == 1 else each)
            listed.append(f"{row['model']} {sum(kinds.values())} of {row['n']} ({why})")
    notes = [f"Counted as empty plans: {', '.join(listed)}."] if listed else []
    unanswered = cells["api_errors"] + cells["missing"]
    if ((unanswered > 0) & (unanswered == cells["n"])).any():
        notes.append("No value stands where a model has no reply at all.")
    return notes


def how_counted(design: Design) -> str:
    """Setting, matcher, criterion, and what becomes of missing replies, as a sentence."""
    scoring = design.suite.scoring
    level1 = f", Level 1 by {scoring.level1}" if 1 in design.suite.levels else ""
    missing = "left out" if scoring.missing == "skip" else "counted as empty plans"
    return (
        f"Setting {design.setting}, matcher {design.matcher}{level1}; micro averages; "
        f"missing replies and API errors are {missing}."
    )


def errors_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Error types out of `errors_frame`: a count, a share (%) and its interval a type."""
    design, levels = run.design, levels_in_order(run)
    columns = [Column(kind, ERROR_NAMES[name]) for name in ERROR_TYPES for kind in _OF_TYPE]
    rows = [
        (
            row["model"] if row["level"] == levels[0] else "",
            level_name(row["level"]),
            str(row["n"]),
            str(row["wrong_steps"]),
            *(cell for name in ERROR_TYPES for cell in (str(row[name]), *share_texts(row, name))),
        )
        for row in table.to_dict("records")
    ]
    is_apart = 1 in design.suite.levels and "1" not in levels
    why = f"; {level_name('1')} asks for no order and has no such types" if is_apart else ""
    return TextTable(
        f"Wrong steps by type{design.of_suite}",
        (_MODEL, Column("Level", is_text=True), *map(Column, _COUNTED), *columns),
        tuple(rows),
        (
            f"Setting {design.setting}, matcher {design.matcher}, by aov{why}. Shares are of all "
            "wrong steps; intervals: base scenes left out in turn.",
        ),
    )


def published_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Published, ours and difference out of `published_frame`: a row a model and metric.

    Under the name of a model stands the name that it was published by.
    """
    columns, rows = beside_by_level(table, PUBLISHED_LEVELS, "Metric", METRIC_NAMES, 1)
    largest = largest_differences(table)
    last = (text for value in largest for text in (number(value, 3), "", ""))
    return TextTable(
        f"Our numbers beside the paper's Table 1{run.design.of_suite} (%)",
        (*columns, Column("Largest")),
        tuple((*row, end) for row, end in zip(rows, last, strict=True)),
        tuple(_difference_notes(table, run.design)),
    )


def _difference_notes(table: pd.DataFrame, design: Design) -> list[str]:
    matchers = "/".join(sorted(set(table["matcher"]) - {""})) or NO_VALUE
    seeds = len(design.suite.seeds)
    pooled = f", pooled over {seeds} seeds" if seeds > 1 else ""
    level1 = f", Level 1 by {design.suite.scoring.level1}" if 1 in design.suite.levels else ""
    return [
        *comparison_notes(table, design),
        f"Ours: setting {PUBLISHED_SETTING}, matcher {matchers}{level1}; micro averages{pooled}. "
        "Published: micro averages of one run.",
        "The last column has the largest absolute difference of each model.",
    ]


def table1_in_terminal(view: TextTable, _: pd.DataFrame) -> tuple[TextTable, ...]:
    """All of Table 1, else F1 alone, else without what seeds say and intervals."""
    # The last note is about the labels of the columns that are left out.
    note = "F1 alone, to fit; precision and recall are in tables/table1.md."
    short = replace(view.without(SIDE_METRICS), notes=(note, *view.notes[:-1]))
    return view, *narrower(short)


def errors_in_terminal(view: TextTable, _: pd.DataFrame) -> tuple[TextTable, ...]:
    """The rows over all levels, each with its model's name; where space is short, without
    intervals, then shares alone.
    """
    rows, model = [], ""
    for row in view.rows:
        model = row[0] or model
        if row[1] == level_name(OVERALL):
            rows.append((model, *row[1:]))
    whole = replace(view, rows=tuple(rows)).without(("Level", "n"))
    bare = whole.without(_OF_TYPE[2:])
    return whole, whole.without(_COUNTED), bare, bare.without(_COUNTED)
