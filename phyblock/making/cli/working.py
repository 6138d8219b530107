"""What the verbs that make sets share: processes, seeds, progress, by what a set was made."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

import click
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from phyblock.cli.console import make_console
from phyblock.sim.engine import other_engine

__all__ = ["jobs_option", "ray_option", "seed_option", "tell_simulators", "tracked"]

T = TypeVar("T")
Command = TypeVar("Command", bound=Callable[..., Any])
_LINE_EVERY = 25

jobs_option = click.option(
    *("--jobs", "-j"),
    type=click.IntRange(1, 256),
    default=os.cpu_count() or 1,
    show_default="all processors",
    metavar="N",
    help="Processes.",
)
ray_option = click.option(
    *("--ray", "ray_address"),
    metavar="ADDRESS",
    help="Work on this Ray cluster; local: on one of N workers here.",
)


def seed_option(about: str) -> Callable[[Command], Command]:
    """The option of a seed; `about` says what another one gives."""
    return click.option(
        "--seed", type=click.IntRange(0), default=0, show_default=True, metavar="S", help=about
    )


def tracked(items: Iterable[T], total: int, doing: str, noun: str = "scenes") -> Iterator[T]:
    """The items; a progress bar on a terminal, a line now and then elsewhere, on standard error."""
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


def tell_simulators() -> None:
    """Say on standard error where a set is not what the default simulators make of its seed."""
    if other := other_engine():
        click.echo(
            f"made with {other}: the default one may make another set of the same seed", err=True
        )
