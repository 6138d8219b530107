"""`phyblock verify-bundle`: a bundle scored again, offline."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.bundle import FELL, opened_bundle
from phyblock.cli.bundle import how_whole
from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath
from phyblock.text import counted

__all__ = ["command"]


@click.command("verify-bundle")
@click.argument("file", type=UserPath())
@click.option(
    "--data",
    type=UserPath(),
    multiple=True,
    help="A folder of data that the run needs; may be given again.",
)
def command(file: Path, data: tuple[Path, ...]) -> None:
    """Score the replies in the bundle FILE again; say whether its records and tables come out as
    the same bytes, and whether samples were left out. Exits with 2 where they do not come out.

    Calls no model. A bundle holds no data: sets that come with phyblock are found; name others
    with --data.
    """
    console = make_console()
    with opened_bundle(file, data) as verified:
        models = [model.name for model in verified.manifest.models]
        console.print(f"{shown_path(file)} verifies.")
        console.print(how_whole(verified))
        console.print(
            f"{counted(verified.records, 'record')} of {counted(len(models), 'model')}, "
            f"scored again, and {counted(verified.tables, 'table file')} "
            f"come out as the same bytes."
        )
        console.print(f"Run {verified.manifest.run}, made with phyblock {verified.about.phyblock}.")
        if verified.physics:
            tracks = ", ".join(verified.physics)
            console.print(f"{tracks}: physics was not carried out, {FELL}.")
        console.print("That the models gave these replies, no bundle can show.")
        console.print("Nor can it what they cost, how long they took, and which model answered.")
