"""Tables, paths and the question before money is spent, the same in all verbs."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any

import click
from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from phyblock.errors import Problem, SpecError
from phyblock.results.text import Column, TextTable
from phyblock.text import one_line, plain_lines

_PIPE_WIDTH = 160
_TEXT_WIDTH = 24
"""Characters after which a cell of text may go on in a new line."""


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
    texts = [column.is_text for column in view.columns]
    names = list(range(texts.index(False) if False in texts[1:] else len(texts)))
    pieces = [names]
    endless = console.options.update(width=10_000)
    for column in range(len(names), len(texts)):
        wider = [*pieces[-1], column]
        needed = Measurement.get(console, endless, _piece(view, wider, _TEXT_WIDTH)).maximum
        if needed > console.width and pieces[-1] != names:
            pieces.append(names)
        pieces[-1] = [*pieces[-1], column]
    for piece in pieces:
        console.print()
        console.print(_piece(view, piece))
    for number, note in enumerate(view.notes):
        console.print(f"\n{note}" if not number else note, style="dim")
    console.print()


def _piece(view: TextTable, columns: Sequence[int], text_width: int | None = None) -> Table:
    """Return some of the columns; the name of a group stands above the first of it."""
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
    group = ""
    for i in columns:
        column = view.columns[i]
        width = max(6, *(len(row[i]) for row in view.rows), 0)
        lines = [] if column.group == group else wrap(column.group, width, break_long_words=False)
        lines += wrap(column.name, width, break_long_words=False)
        table.add_column(
            Text("\n".join(lines)),
            justify="left" if column.is_text else "right",
            no_wrap=not column.is_text,
            overflow="fold",
            max_width=text_width if column.is_text else None,
        )
        group = column.group
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


def print_again(console: Console, how: str = "give") -> None:
    """Print that the same command goes on, and the command."""
    console.print(f"To go on, {how} the same command again:")
    print_path(console, f"  {shlex.join(['phyblock', *sys.argv[1:]])}")


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
