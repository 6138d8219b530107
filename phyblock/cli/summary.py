"""A run's tables in the terminal: what fits and matters; the files hold the rest."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from phyblock.cli.console import print_view, shown_path
from phyblock.cli.layout import width_of
from phyblock.report import TextTable
from phyblock.report.terminal import Failure, Terminal
from phyblock.text import one_line

__all__ = ["print_summary"]

_FAILURES_SHOWN = 8


def print_summary(console: Console, terminal: Terminal, tables: Path) -> None:
    """Print of each table what it has for the terminal, what was not answered and why, and in
    which folder the tables are.
    """
    for forms in terminal.tables:
        _print_fitting(console, forms)
    _print_failures(console, terminal.failures)
    for lines in terminal.lines:
        _print_lines(console, lines)
    console.print(f"Tables are in {shown_path(tables)}", soft_wrap=True, markup=False)


def _print_fitting(console: Console, forms: Sequence[TextTable]) -> None:
    """Print the first form that fits, else the last."""
    fitting = [form for form in forms if width_of(form) <= console.width]
    for form in (fitting or forms[-1:])[:1]:
        print_view(console, form)


def _print_lines(console: Console, lines: Sequence[str]) -> None:
    for place, line in enumerate(lines):
        style = "bold" if place == 0 else None
        console.print(line, style=style, markup=False, soft_wrap=True)
    console.print()


def _print_failures(console: Console, failures: Sequence[Failure]) -> None:
    """What providers said where a call failed, the most frequent first."""
    if not failures:
        return
    console.print("Failed calls", style="bold")
    for failure in failures[:_FAILURES_SHOWN]:
        text = one_line(f"{failure.model}: {failure.message}")
        console.print(f"{failure.times:>6,} x {text}", soft_wrap=True)
    if len(failures) > _FAILURES_SHOWN:
        others = f"       and {len(failures) - _FAILURES_SHOWN} other messages"
        console.print(others, markup=False)
    console.print()
