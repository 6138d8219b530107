"""`phyblock site`: runs as a leaderboard in a static folder."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath
from phyblock.site import write_site
from phyblock.text import counted

__all__ = ["command"]

_MB = 1e6


@click.command("site")
@click.argument("runs", nargs=-1, required=True, type=UserPath())
@click.option("--out", type=UserPath(), required=True, help="Folder of the site.")
@click.option(
    "--data",
    type=UserPath(),
    multiple=True,
    help="A folder of data that bundles need; may be given again.",
)
@click.option("--title", default="PhyBlock leaderboard", show_default=True, help="Its heading.")
def command(runs: tuple[Path, ...], out: Path, data: tuple[Path, ...], title: str) -> None:
    """Put RUNS (run folders and bundles) into one static folder: a ranked table, cost against
    score, a page for every model and scene, replays.

    The folder opens from disk or from any web server. Runs must be of one data version and prompt.
    Bundles are scored again first, and those that do not verify are refused.
    """
    console = make_console()
    made = write_site(runs, out, data, title)
    console.print(
        f"The site is {shown_path(made.path)}: {counted(made.models, 'model')}, "
        f"{counted(made.samples, 'sample')}, {made.size_bytes / _MB:.1f} MB"
    )
    if made.lacking:
        console.print(made.lacking)
