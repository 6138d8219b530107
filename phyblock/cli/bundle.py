"""`phyblock bundle`: a run as one file that others can score again."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.bundle import BUNDLE_FILE, Verified, bundle_run
from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath
from phyblock.text import counted

__all__ = ["command", "how_whole"]

_MB = 1e6


@click.command("bundle")
@click.argument("run", type=UserPath())
@click.option("--out", type=UserPath(), help=f"The file. [default: RUN/{BUNDLE_FILE}]")
@click.option(
    "--data",
    type=UserPath(),
    multiple=True,
    help="A folder of data, where they have moved; may be given again.",
)
def command(run: Path, out: Path | None, data: tuple[Path, ...]) -> None:
    """Write the folder RUN as one file: manifest, records, digests.

    Leaves out keys, pictures, prompts, addresses of servers, and all but the last part of paths of
    this machine. Keeps what models wrote, and what they were sent beside the prompt. Scores the
    replies again first, where the data are at hand, and refuses a run whose scores do not come out
    the same.
    """
    console = make_console()
    made = bundle_run(run, out, data)
    console.print(f"The bundle is {shown_path(made.path)} ({made.size_bytes / _MB:.1f} MB)")
    if made.verified is None:
        console.print(f"It was not verified here: {made.lacking}")
        return
    console.print(
        f"Verified: {counted(made.verified.records, 'record')} scored again and "
        f"{counted(made.verified.tables, 'table file')} come out the same."
    )
    console.print(how_whole(made.verified))


def how_whole(verified: Verified) -> str:
    """How many samples a bundle has of those that its suite asks for."""
    samples = f"{verified.records:,} of {verified.expected:,} expected samples"
    return f"{samples}." if verified.is_whole else f"{samples}: the run is not whole."
