"""A run's tables in the terminal: what fits and matters; the files hold the rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console

from phyblock import report
from phyblock.cli.console import print_view, shown_path
from phyblock.cli.layout import width_of
from phyblock.plain_text import one_line

if TYPE_CHECKING:
    from phyblock.report import TablesWritten, TextTable

__all__ = ["print_summary"]

_FAILURES_SHOWN = 8


def print_summary(console: Console, written: TablesWritten) -> None:
    """Print of each table that was written what its maker has for the terminal, and what was not
    answered and why.
    """
    makers = report.table_makers(written.run)
    known = {name: makers[name] for name in makers if name in written.frames}
    for name, maker in known.items():
        if maker.in_terminal is not None:
            forms = maker.in_terminal(written.views[name], written.frames[name])
            _print_fitting(console, forms)
    _print_failures(console, written)
    for name, maker in known.items():
        if maker.lines is not None:
            _print_lines(console, maker.lines(written.frames[name], written.run))
    console.print(f"Tables are in {shown_path(written.folder)}", soft_wrap=True, markup=False)


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


def _print_failures(console: Console, written: TablesWritten) -> None:
    """What providers said where a call failed, the most frequent first."""
    failed = written.run.records.dropna(subset=["error_message"])
    said = Counter(zip(failed["model"], failed["error_message"], strict=True))
    if not said:
        return
    console.print("Failed calls", style="bold")
    for (model, message), times in said.most_common(_FAILURES_SHOWN):
        told = one_line(f"{model}: {message}")
        console.print(f"{times:>6,} x {told}", soft_wrap=True)
    if len(said) > _FAILURES_SHOWN:
        console.print(f"       and {len(said) - _FAILURES_SHOWN} other messages", markup=False)
    console.print()
