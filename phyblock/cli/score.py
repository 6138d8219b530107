"""`phyblock score`: stored replies read and scored again."""

from __future__ import annotations

import time
from pathlib import Path
from typing import cast

import click

from phyblock.cli.paths import UserPath, moved_data_option
from phyblock.cli.report import show_tables
from phyblock.run.rescore import rescore
from phyblock.text import plain_lines
from phyblock.types import MATCHERS, PLAN_PARSERS, Matcher, PlanParser

__all__ = ["command"]

_EVERY_S = 2.0


@click.command("score")
@click.argument("run", type=UserPath())
@click.option("--parser", type=click.Choice(PLAN_PARSERS), help="Parser to read replies with.")
@click.option("--matcher", type=click.Choice(MATCHERS), help="Matcher of the headline numbers.")
@click.option("--out", type=UserPath(), help="Folder for the new scores.")
@moved_data_option
def command(
    run: Path, parser: str | None, matcher: str | None, out: Path | None, data: Path | None
) -> None:
    """Read and score the stored replies of the folder RUN again, and count every measure again.
    Calls no model.

    The new scores replace the records of RUN in one step. With another parser or matcher they go
    to RUN/scores/PARSER-MATCHER, or to --out, and RUN stays as it is.
    """
    chosen = cast("PlanParser | None", parser), cast("Matcher | None", matcher)
    show_tables(rescore(run, *chosen, out, data, _tell, _Progress()), data)


class _Progress:
    """Says every two seconds how many samples are scored."""

    def __init__(self) -> None:
        self._said = time.monotonic()

    def __call__(self, done: int) -> None:
        """Say it, if it is time."""
        if time.monotonic() - self._said > _EVERY_S:
            self._said = time.monotonic()
            click.echo(f"scored {done:,} samples", err=True)


def _tell(text: str) -> None:
    click.echo(plain_lines(text), err=True)
