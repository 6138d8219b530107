"""Options, tables, paths and the confirmation of costs, shared by all commands."""

from __future__ import annotations

import os
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, TypeVar

import click
from rich import box
from rich.console import Console
from rich.measure import Measurement
from rich.progress import track
from rich.table import Table
from rich.text import Text

from phyblock.results.text import Column, TextTable
from phyblock.text import one_line, plain_lines
from phyblock.types import QUOTE_HINT

if TYPE_CHECKING:
    from phyblock.workers import Shards

T = TypeVar("T")

INTERRUPTED = 130  # The exit code after Ctrl-C.
_PIPE_WIDTH = 160
_TEXT_WIDTH = 24  # Characters after which a cell of text may wrap.


class _PlainConsole(Console):
    """Shows strings literally: no markup, no emoji codes, no control characters."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Return the text with spaces for control characters."""
        return super().render_str(plain_lines(text), **options)


def make_console(*, stderr: bool = False) -> Console:
    """Return the console, wide enough for whole tables if the output is not a terminal."""
    # Paths, names and messages of servers may contain brackets and colons.
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
    """Print a table with its caption and notes, split into several pieces if it is too wide.

    Every piece begins with the names of the rows; numbers are never cut or wrapped.
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
    """Return some of the columns, with group names above the first of each group."""
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


def tracked(items: Iterable[T], total: int | None, doing: str) -> Iterable[T]:
    """Return the items, with a progress bar on a terminal while they are taken."""
    console = make_console(stderr=True)
    hidden = not console.is_terminal
    return track(items, doing, total, console=console, transient=True, disable=hidden)


def shown_path(path: Path) -> str:
    """Return a path relative to the working folder if possible, on one line."""
    try:
        return one_line(str(path.resolve().relative_to(Path.cwd())))
    except (ValueError, OSError):
        return one_line(str(path))


def print_path(console: Console, path: Path | str) -> None:
    """Print a path or a command on a line that never wraps, so that it can be copied."""
    console.print(shown_path(path) if isinstance(path, Path) else path, soft_wrap=True)


def print_again(console: Console, how: str = "run") -> None:
    """Print that the same command continues, and the command."""
    console.print(f"To continue, {how} the same command again:")
    print_path(console, f"  {shlex.join(['phyblock', *sys.argv[1:]])}")


class UserPath(click.Path):
    """A path with `~` for the home folder; an empty one, as from an unset variable, is an error."""

    def __init__(self, *, path_type: type[Any] = Path, **options: Any) -> None:
        super().__init__(path_type=path_type, **options)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path of `value`."""
        if not os.fspath(value):
            self.fail("it is empty: is a variable not set?", param, ctx)
        return super().convert(os.path.expanduser(value), param, ctx)


def _names(_: click.Context, __: click.Parameter, value: str | None) -> tuple[str, ...]:
    """Return the names in a comma-separated list."""
    names = () if value is None else tuple(name.strip() for name in value.split(","))
    if not all(names):
        raise click.BadParameter(f"{value!r} holds an empty name: {QUOTE_HINT}")
    return names


def _shard(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, int] | None:
    """Return the shard and the number of shards from a text such as 3/64."""
    if value is None:
        return None
    found = re.fullmatch(r"([1-9]\d{0,4})/([1-9]\d{0,4})", value)
    if found is None or int(found[1]) > int(found[2]):
        raise click.BadParameter(f"{value!r} is not a shard: 3/64 is the third of 64")
    return int(found[1]), int(found[2])


def jobs_option(default: int | None = None) -> Callable[..., Any]:
    """Return the option `--jobs`, by default all processors."""
    return click.option(
        *("--jobs", "-j"),
        type=click.IntRange(1, 256),
        default=default or os.cpu_count() or 1,
        show_default=True if default else "all processors",
        metavar="N",
        help="Processes.",
    )


def worker_options(jobs: int | None = None) -> Callable[[Any], Any]:
    """Return a decorator that adds the options of parallel commands."""
    on_cluster = "Run on this Ray cluster; local: one with N workers on this machine."
    as_shard = "Run as shard I of N programs that share the work through a folder .shards."
    options = (
        jobs_option(jobs),
        click.option("--ray", "ray_address", metavar="ADDRESS", help=on_cluster),
        click.option("--shard", callback=_shard, metavar="I/N", help=as_shard),
    )

    def add(command: Any) -> Any:
        for option in reversed(options):
            command = option(command)
        return command

    return add


def shards_folder(out: Path) -> Path:
    """Return the folder that the shards of the output `out` share."""
    return out.with_name(f"{out.name}.shards")


def open_shards(shard: tuple[int, int] | None, out: Path, work: str) -> Shards | None:
    """Return the requested shard, if any. Raises StoreError if the folder is of another job."""
    from phyblock.workers import Shards

    return None if shard is None else Shards(shards_folder(out), *shard, work)


def left_to_first(shards: Shards | None, out: Path) -> bool:
    """True, with a message, if another shard writes the result."""
    if shards is None or shards.writes:
        return False
    click.echo(f"shard {shards.number}/{shards.count} is done; the first writes {shown_path(out)}")
    return True


def models_option(help_text: str) -> Callable[..., Any]:
    """Return the option `--models`."""
    return click.option("--models", callback=_names, metavar="A,B", help=help_text)


NAME_OR_PATH = UserPath(path_type=str)  # The name of something bundled, or a path, as text.

run_argument = click.argument("run", type=UserPath())
models_file_option = click.option(
    "--models-file", type=NAME_OR_PATH, metavar="FILE", help="Models file instead of models.yaml."
)
data_option = click.option(
    "--data",
    type=UserPath(exists=True, file_okay=False),
    metavar="DIR",
    help="The data set, if it has moved.",
)
data_folders_option = click.option(
    "--data",
    type=UserPath(),
    metavar="DIR",
    multiple=True,
    help="A folder of data that the run needs; may be repeated.",
)
run_out_option = click.option(
    "--out",
    type=UserPath(),
    metavar="DIR",
    help="Folder of the run. [default: results/SUITE-DIGEST]",
)
sets_option = click.option(
    "--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a value of the suite."
)
limit_option = click.option(
    "--limit", type=click.IntRange(min=1), metavar="N", help="N scenes, spread over levels."
)
yes_option = click.option("--yes", is_flag=True, help="Spend money without asking.")
