"""Tables and paths in the terminal."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from textwrap import fill

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from phyblock.report import TextTable

__all__ = ["counted", "make_console", "plain_table", "print_view", "shown_path", "width_of"]

_PLAIN_WIDTH = 160
_HEADING_WIDTH = 12


def make_console(*, stderr: bool = False) -> Console:
    """The console; wide enough for whole tables when the output is no terminal."""
    # Without markup: paths, names and what servers say may hold brackets.
    console = Console(stderr=stderr, highlight=False, markup=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = _PLAIN_WIDTH
    return console


def print_view(console: Console, view: TextTable) -> None:
    """Print a table with its caption, group headings and notes."""
    table = Table(
        title=Text(view.caption, style="bold"),
        title_justify="left",
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        collapse_padding=True,
    )
    for heading, column in zip(_headings(view), view.columns, strict=True):
        names = not table.columns
        table.add_column(
            Text(heading),
            justify="left" if column.is_text else "right",
            no_wrap=names or not column.is_text,
            # Whatever is cut in a narrow terminal, it is not the name of a model.
            min_width=max((len(row[0]) for row in view.rows), default=0) if names else None,
            vertical="bottom",
        )
    for row in view.rows:
        table.add_row(*(Text(cell) for cell in row))
    console.print(table)
    for note in view.notes:
        console.print(Text(note, style="dim"))
    console.print()


def width_of(view: TextTable) -> int:
    """Characters that a table takes when nothing in it is cut."""
    widths = (
        max(*(len(line) for line in heading.splitlines()), *(len(row[i]) for row in view.rows), 0)
        for i, heading in enumerate(_headings(view))
    )
    return sum(width + 2 for width in widths)


def plain_table(
    headings: Sequence[str], rows: Sequence[Sequence[str]], *, numbers: int, tight: bool = False
) -> Table:
    """A small table whose last `numbers` columns are aligned to the right.

    With `tight` one space stands between columns, not three, and words are never broken.
    """
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
        table.add_row(*(Text(cell) for cell in row))
    return table


def counted(number: int, noun: str) -> str:
    """A number with its noun: `1 call`, `2 calls`."""
    return f"{number:,} {noun}" + ("" if number == 1 else "s")


def shown_path(path: Path) -> str:
    """A path as a person would type it from here."""
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def _headings(view: TextTable) -> list[str]:
    """Names of the columns, each group's name above its first; alone, it is broken by words."""
    headings: list[str] = []
    for group, members in groupby(view.columns, key=lambda column: column.group):
        names = [column.name for column in members]
        above = fill(group, _HEADING_WIDTH) if len(names) == 1 else group
        headings += [f"{above}\n{names[0]}".lstrip("\n"), *names[1:]]
    return headings
