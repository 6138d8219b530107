"""Options that verbs share, and progress."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from phyblock.cli.console import UserPath, make_console, open_shards, shards_folder, worker_options
from phyblock.errors import Problem
from phyblock.making.files import check_out
from phyblock.making.season import code_digest
from phyblock.sim.engine import described_engine, other_engine
from phyblock.text import counted
from phyblock.workers import Shards, open_workers

T = TypeVar("T")
R = TypeVar("R")
Command = TypeVar("Command", bound=Callable[..., Any])
_LINE_EVERY = 25


class Several(click.ParamType[tuple[str, ...]]):
    """Some of the known words, each once, with commas between them, or `all`."""

    name = "words"

    def __init__(self, known: Iterable[str]) -> None:
        self._known = tuple(known)

    def convert(
        self, value: str, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, ...]:
        """Return the words in the order given."""
        words = self._known if value == "all" else tuple(value.upper().split(","))
        if not set(self._known).issuperset(words) or len(set(words)) < len(words):
            self.fail(f"{value!r}: give all, or some of {','.join(self._known)}", param, ctx)
        return words


_OPTIONS = (
    click.option("--seed", type=click.IntRange(0), default=0, show_default=True, metavar="S"),
    worker_options(),
    click.option(
        "--out", "-o", type=UserPath(), required=True, metavar="DIR", help="Folder to write."
    ),
)


def making_options(command: Command) -> Command:
    """Add the options of a verb that makes a set: seed, jobs, ray_address, shard, out."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def begin_set(
    shard: tuple[int, int] | None, out: Path, names: Sequence[str], work: str
) -> Shards | None:
    """Return the shard, if any, that makes a set; StoreError where `out` has one.

    Shards that go on may find the set, which the first one wrote.
    """
    if shard is None or not shards_folder(out).exists():
        check_out(out, names)
    return open_shards(shard, out, f"{work}\n{described_engine()}\n{code_digest()}\n")


def tracked(items: Iterable[T], total: int, doing: str, noun: str = "scenes") -> Iterator[T]:
    """Yield the items; show a progress bar on a terminal, a line now and then elsewhere."""
    console = make_console(stderr=True)
    columns = (TextColumn(doing), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    hidden = not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=hidden) as progress:
        bar = progress.add_task("", total=total)
        for count, item in enumerate(items, 1):
            progress.advance(bar)
            if hidden and count % _LINE_EVERY == 0:
                console.print(f"{count} of {total} {noun}")
            yield item


def mapped(
    function: Callable[[T], R], items: Sequence[T], jobs: int, doing: str, noun: str = "scenes"
) -> list[R]:
    """Return the function's answers for the items, from `jobs` processes, with progress shown."""
    with open_workers(min(jobs, len(items) or 1)) as workers:
        return list(tracked(workers.map(function, items), len(items), doing, noun))


def print_engine() -> None:
    """Say on standard error where a set is not what the default engine makes of its seed."""
    if other := other_engine():
        click.echo(
            f"made with {other}: the default one may make another set of the same seed", err=True
        )


def conclude(name: str, problems: Iterable[Problem | str]) -> None:
    """Print what failed and the verdict on a set; exit with 1 where something failed."""
    failures = list(problems)
    for failure in failures:
        click.echo(f"failed: {failure}", err=True)
    verdict = counted(len(failures), "failure") if failures else "all checks passed"
    click.echo(f"{name}: {verdict}")
    if failures:
        raise click.exceptions.Exit(1)
