"""Options that commands share, and progress."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import click

from phyblock.cli.console import UserPath, open_shards, shards_folder, tracked, worker_options
from phyblock.errors import Problem
from phyblock.making.files import check_out
from phyblock.making.season import code_digest
from phyblock.sim.engine import described_engine, other_engine
from phyblock.text import counted
from phyblock.workers import Shards, open_workers

T = TypeVar("T")
R = TypeVar("R")
Command = TypeVar("Command", bound=Callable[..., Any])


class Several(click.ParamType[tuple[str, ...]]):
    """A comma-separated list of known words, each once, or `all`."""

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
    """Add the options of a command that makes a set: seed, jobs, ray_address, shard, out."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def begin_set(
    shard: tuple[int, int] | None, out: Path, names: Sequence[str], work: str
) -> Shards | None:
    """Return the shard, if any, that makes a set. Raises StoreError if `out` already has one.

    Continued shards may find the set, which the first one wrote.
    """
    if shard is None or not shards_folder(out).exists():
        check_out(out, names)
    return open_shards(shard, out, f"{work}\n{described_engine()}\n{code_digest()}\n")


def mapped(function: Callable[[T], R], items: Sequence[T], jobs: int, doing: str) -> list[R]:
    """Return the results of a function for the items, from `jobs` processes, with progress."""
    with open_workers(min(jobs, len(items) or 1)) as workers:
        return list(tracked(workers.map(function, items), len(items), doing))


def print_engine() -> None:
    """Warn on standard error if the default engine may make another set from the same seed."""
    if other := other_engine():
        click.echo(
            f"made with {other}: the default one may make another set of the same seed", err=True
        )


def conclude(name: str, problems: Iterable[Problem | str]) -> None:
    """Print the problems and the verdict on a set; exit with 1 if there are problems."""
    failures = list(problems)
    for failure in failures:
        click.echo(f"failed: {failure}", err=True)
    verdict = counted(len(failures), "failure") if failures else "all checks passed"
    click.echo(f"{name}: {verdict}")
    if failures:
        raise click.exceptions.Exit(1)
