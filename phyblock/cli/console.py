"""Tables and paths in the terminal."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from phyblock.cli.layout import lay_out
from phyblock.report import TextTable
from phyblock.text import one_line, plain_lines

__all__ = ["make_console", "plain_table", "print_view", "shown_path"]

_PLAIN_WIDTH = 160


class _PlainConsole(Console):
    """Shows strings as they are: no markup, no emoji codes, nothing that steers a terminal."""

    def render_str(self, text: str, **options: Any) -> Text:
        """The text, its control characters as spaces."""
        return super().render_str(plain_lines(text), **options)


def make_console(*, stderr: bool = False) -> Console:
    """The console; wide enough for whole tables when the output is no terminal."""
    # Paths, names and what servers say may hold brackets and colons.
    console = _PlainConsole(stderr=stderr, highlight=False, markup=False, emoji=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = _PLAIN_WIDTH
    return console


def print_view(console: Console, view: TextTable) -> None:
    """Print a table with its caption and notes; one that is too wide in several pieces."""
    console.print(Text(view.caption, style="bold"))
    for lines in lay_out(view, console.width):
        console.print()
        for line in lines:
            console.print(Text(line), soft_wrap=True)
    if view.notes:
        console.print()
    for note in view.notes:
        console.print(Text(note, style="dim"))
    console.print()


def plain_table(
    headings: Sequence[str], rows: Sequence[Sequence[str]], *, numbers: int, tight: bool = False
) -> Table:
    """A small table whose last `numbers` columns are aligned to the right.

    With `tight` one space stands between columns, not three, and words are never broken.
    """
    rows = [[one_line(cell) for cell in row] for row in rows]
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=0 if tight else (0, 1))
    for position, heading in enumerate(headings):
        right = position >= len(headings) - numbers
        cells = [row[position] for row in rows]
        words = [word for cell in cells for word in cell.split()]
        kept = cells if position == 0 else words if tight else []
        table.add_column(
            heading,
            justify="right" if right else "left",
            no_wrap=position == 0,
            min_width=max((len(part) for part in kept), default=0),
            overflow="fold",
        )
    for row in rows:
        table.add_row(*map(Text, row))
    return table


def shown_path(path: Path) -> str:
    """A path as a person would type it from here, on one line."""
    try:
        return one_line(str(path.resolve().relative_to(Path.cwd())))
    except (ValueError, OSError):
        return one_line(str(path))
