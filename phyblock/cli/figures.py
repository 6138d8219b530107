"""`phyblock figures`: a run's figures, drawn again from its records."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath
from phyblock.errors import Problem, SpecError
from phyblock.report.figures import figure_names, write_figures
from phyblock.tables.load import load_run

__all__ = ["command"]


@click.command("figures")
@click.argument("run", type=UserPath())
@click.option("--only", "names", multiple=True, metavar="NAME", help="Only this figure; repeat.")
def command(run: Path, names: tuple[str, ...]) -> None:
    """Draw the figures of the folder RUN into RUN/figures, as SVG and PNG.

    Figures that the run has no numbers for are left out.
    """
    loaded = load_run(run, texts=False)
    known = figure_names(loaded)
    if unknown := [name for name in names if name not in known]:
        found, allowed = ", ".join(unknown), ", ".join(known)
        raise SpecError(Problem(str(run), "has no such figure", "--only", found, allowed))
    files = write_figures(loaded, names or None)
    console = make_console()
    for file in files:
        console.print(shown_path(file), markup=False, soft_wrap=True)
    if not files:
        console.print("The run has no numbers for a figure.")
