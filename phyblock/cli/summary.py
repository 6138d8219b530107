"""A run's tables in the terminal: what fits and matters; the files hold the rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from rich.console import Console

from phyblock.cli.console import print_view, shown_path
from phyblock.cli.layout import width_of
from phyblock.tables.outcomes import HEADINGS
from phyblock.tables.text_table import NO_VALUE, number
from phyblock.tracks.full_planning.published import comparison_notes, largest_differences

if TYPE_CHECKING:
    from phyblock.report import TablesWritten, TextTable

__all__ = ["print_summary"]

_SIDE_METRICS = ("Prec", "Rec")
_FAILURES_SHOWN = 8
_MET = 0.06
"""Largest difference that rounding of the published numbers and of ours explains [points]."""


def print_summary(console: Console, written: TablesWritten) -> None:
    """Print Table 1, wrong steps over all levels, what was not answered and why, and the
    comparison; tables that the suite does not ask for are left out.
    """
    views = written.views
    if (table1 := views.get("table1")) is not None:
        _print_table1(console, table1)
    if "table2" in views:
        _print_table2(console, views["table2"])
    for name in ("table3", "endings"):
        if name in views:
            print_view(console, _narrowed(console, views[name]))
    if "errors" in views:
        errors = _overall(views["errors"])
        if width_of(errors) > console.width:
            errors = _without(errors, ("Plans", "Wrong steps"))
        print_view(console, errors)
    coverage = written.frames["coverage"]
    if (coverage["ok"] < coverage["expected"]).any():
        print_view(console, _answered(views["coverage"]))
        _print_failures(console, written)
    if "published" in written.frames:
        _print_comparison(console, written)
    console.print(f"Tables are in {shown_path(written.folder)}", soft_wrap=True, markup=False)


def _narrowed(console: Console, view: TextTable) -> TextTable:
    """A table of episodes without its notes, and without side metrics where it is too wide."""
    view = replace(view, notes=())
    return _without(view, _SIDE_METRICS) if width_of(view) > console.width else view


def _print_table1(console: Console, table1: TextTable) -> None:
    if width_of(table1) > console.width:
        table1 = _without(table1, _SIDE_METRICS)
        # The last note is about the labels of the columns that were left out.
        note = "F1 alone, to fit; precision and recall are in tables/table1.md."
        table1 = replace(table1, notes=(note, *table1.notes[:-1]))
    if width_of(table1) > console.width:
        table1 = replace(
            table1, rows=tuple(tuple(c.partition(" ± ")[0] for c in row) for row in table1.rows)
        )
    print_view(console, table1)


def _print_table2(console: Console, table2: TextTable) -> None:
    """The columns that were asked, or averages alone where those do not fit."""
    notes = table2.notes[:-1]
    asked = [
        i
        for i in range(len(table2.columns))
        if any(row[i] != NO_VALUE for row in table2.rows if not row[0].startswith(" "))
    ]
    table2 = _with_columns(table2, asked)
    if width_of(table2) > console.width:
        names = [column.name for column in table2.columns]
        table2 = _with_columns(table2, [i for i, n in enumerate(names) if n in ("Model", "Avg")])
        notes = ("Averages alone, to fit; every subtask is in tables/table2.md.", *notes)
    print_view(console, replace(table2, notes=notes))


def _print_failures(console: Console, written: TablesWritten) -> None:
    """What providers said where a call failed, the most frequent first."""
    failed = written.run.records.dropna(subset=["error_message"])
    said = Counter(zip(failed["model"], failed["error_message"], strict=True))
    if not said:
        return
    console.print("Failed calls", style="bold")
    for (model, message), times in said.most_common(_FAILURES_SHOWN):
        console.print(f"{times:>6,} x {model}: {message}", markup=False, soft_wrap=True)
    if len(said) > _FAILURES_SHOWN:
        console.print(f"       and {len(said) - _FAILURES_SHOWN} other messages", markup=False)
    console.print()


def _print_comparison(console: Console, written: TablesWritten) -> None:
    frame = written.frames["published"]
    largest = largest_differences(frame)
    cells = Counter(frame.dropna(subset=["difference"])["model"])
    width = max(map(len, largest.index), default=0)
    console.print("Beside the paper's Table 1: largest difference in points", style="bold")
    for name, points in largest.items():
        # Where nothing was compared, there is no difference to judge.
        mark = ("as published" if points <= _MET else "differs") if cells[name] else "not compared"
        console.print(
            f"{name:<{width}}  {number(points, 3):>7}  {cells[name]} cells, {mark}", markup=False
        )
    for note in comparison_notes(frame, written.run.design):
        console.print(note, markup=False, soft_wrap=True)
    console.print()


def _overall(errors: TextTable) -> TextTable:
    """The rows over all levels, each with its model's name; shares alone."""
    rows, model = [], ""
    for row in errors.rows:
        model = row[0] or model
        if row[1] == "Overall":
            rows.append((model, *row[1:]))
    return _without(replace(errors, rows=tuple(rows)), ("Level", "n"))


def _answered(coverage: TextTable) -> TextTable:
    """Samples and the outcomes that occurred; tokens and costs stay in the file."""
    always = ("Model", "Track", "Expected", "OK")
    told = ("Not run", *HEADINGS.values())
    dropped = tuple(
        column.name
        for i, column in enumerate(coverage.columns)
        if column.name not in always
        and (column.name not in told or all(row[i] == "0" for row in coverage.rows))
    )
    return replace(_without(coverage, dropped), notes=())


def _without(view: TextTable, names: tuple[str, ...]) -> TextTable:
    return _with_columns(view, [i for i, c in enumerate(view.columns) if c.name not in names])


def _with_columns(view: TextTable, kept: Sequence[int]) -> TextTable:
    return replace(
        view,
        columns=tuple(view.columns[i] for i in kept),
        rows=tuple(tuple(row[i] for i in kept) for row in view.rows),
    )
