"""Tables, paths and the question before money is spent, the same in all verbs."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path
from textwrap import wrap
from typing import Any

import click
from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from phyblock.errors import Problem, SpecError
from phyblock.results.text import Column, TextTable
from phyblock.text import one_line, plain_lines

_PIPE_WIDTH = 160
_HEADING_WIDTH = 6
"""Characters after which a heading above narrower cells goes on in a new line."""
_TEXT_WIDTH = 32
"""Characters after which a cell of text may go on in a new line."""
_GAP = 2


class _PlainConsole(Console):
    """Shows strings as they are: no markup, no emoji codes, nothing that steers a terminal."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Return the text, its control characters as spaces."""
        return super().render_str(plain_lines(text), **options)


def make_console(*, stderr: bool = False) -> Console:
    """Return the console; wide enough for whole tables when the output is no terminal."""
    # Paths, names and what servers say may hold brackets and colons.
    console = _PlainConsole(stderr=stderr, highlight=False, markup=False, emoji=False)
    if not console.is_terminal and "COLUMNS" not in os.environ:
        console.width = _PIPE_WIDTH
    return console


def print_rows(
    console: Console, headings: Sequence[str], rows: Sequence[Sequence[str]], *, numbers: int
) -> None:
    """Print a small table whose last `numbers` columns are aligned to the right."""
    first = len(headings) - numbers
    columns = tuple(Column(name, is_text=i < first) for i, name in enumerate(headings))
    print_table(console, TextTable("", columns, tuple(map(tuple, rows))))


def print_table(console: Console, view: TextTable) -> None:
    """Print a table with its caption and notes; one that is too wide in several pieces.

    Every piece begins with the names of the rows; numbers are never cut or broken.
    """
    if view.caption:
        console.print(view.caption, style="bold")
    for columns in _pieces(view, console.width):
        console.print()
        console.print(_piece(view, columns))
    for number, note in enumerate(view.notes):
        console.print(f"\n{note}" if not number else note, style="dim")
    console.print()


def _pieces(view: TextTable, width: int) -> list[list[int]]:
    """Return the columns of each piece; columns of one group stay together where they fit."""
    texts = [column.is_text for column in view.columns]
    n_names = max(1, texts.index(False) if False in texts else len(texts))
    names = list(range(n_names))
    rest = range(n_names, len(texts))
    groups = [list(part) for _, part in groupby(rest, key=lambda i: view.columns[i].group or i)]
    pieces = [names]
    for group in groups:
        if _width(view, [*names, *group]) > width:
            parts = [[column] for column in group]
        else:
            parts = [group]
        for part in parts:
            if pieces[-1] != names and _width(view, [*pieces[-1], *part]) > width:
                pieces.append(names)
            pieces[-1] = [*pieces[-1], *part]
    return pieces


def _width(view: TextTable, columns: Sequence[int]) -> int:
    """Return the characters that these columns need at least, side by side."""
    widths = []
    for i in columns:
        cells = max((cell_len(row[i]) for row in view.rows), default=0)
        if view.columns[i].is_text:
            cells = min(cells, _TEXT_WIDTH)
        widths.append(max(cells, *map(cell_len, _heading(view, columns, i).split("\n"))))
    return sum(widths) + _GAP * (len(widths) - 1)


def _heading(view: TextTable, columns: Sequence[int], i: int) -> str:
    """Return a column's name, below its group's name where it is the first of the group there."""
    column = view.columns[i]
    before = columns[columns.index(i) - 1] if columns.index(i) else None
    is_first = before is None or view.columns[before].group != column.group
    cells = max((cell_len(row[i]) for row in view.rows), default=0)
    width = max(_HEADING_WIDTH, min(cells, _TEXT_WIDTH))
    lines = wrap(column.group, width, break_long_words=False) if is_first else []
    return "\n".join([*lines, *wrap(column.name, width, break_long_words=False)])


def _piece(view: TextTable, columns: Sequence[int]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, _GAP - 1, 0, 0))
    for i in columns:
        is_text = view.columns[i].is_text
        table.add_column(
            Text(_heading(view, columns, i)),
            justify="left" if is_text else "right",
            no_wrap=not is_text,
            overflow="fold",
        )
    for row in view.rows:
        table.add_row(*(Text(row[i]) for i in columns))
    return table


def shown_path(path: Path) -> str:
    """Return a path as a person would type it from here, on one line."""
    try:
        return one_line(str(path.resolve().relative_to(Path.cwd())))
    except (ValueError, OSError):
        return one_line(str(path))


def print_path(console: Console, path: Path | str) -> None:
    """Print a path, or a command, on a line that is never broken, so that it can be copied."""
    console.print(shown_path(path) if isinstance(path, Path) else path, soft_wrap=True)


def may_spend(
    models: Sequence[str], show: Callable[[], None], *, has_limit: bool | None = None
) -> bool:
    """True if a person agrees that calls to these models may cost money: the gate of all verbs.

    `show` prints what the calls would take. Where nobody can answer, a cost limit is the answer
    (None: the verb has no such limit); raises SpecError where there is none.
    """
    is_asked = sys.stdin is not None and sys.stdin.isatty()
    if not models or (has_limit and not is_asked):
        return True
    show()
    if is_asked:
        return click.confirm("Go on?", default=True)
    message = "would cost money, and there is no terminal to ask on"
    hint = "agree with --yes"
    if has_limit is not None:
        hint += ", or set a limit: --set limits.max_cost_usd=5"
    raise SpecError(Problem("models", message, found=", ".join(models), hint=hint))
