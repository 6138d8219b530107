"""`phyblock compare`: models on the same samples, and whether their difference can be told."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.cli.console import make_console, print_view, shown_path
from phyblock.cli.names import split_names
from phyblock.cli.paths import UserPath
from phyblock.report.compare import compare_models, compare_runs
from phyblock.report.compare_view import compare_view, flipped_lines, ranks_view, write_comparison
from phyblock.tables.load import load_run

__all__ = ["command"]


@click.command("compare")
@click.argument("run", type=UserPath())
@click.argument("other", type=UserPath(), required=False)
@click.option("--models", metavar="A,B", help="Only these models; of two runs, A of the first.")
@click.option("--track", metavar="NAME", help="[default: the first that they have]")
@click.option("--measure", metavar="NAME", help="[default: the first of the track]")
@click.option("--out", type=UserPath(), help="Folder for CSV, Markdown and LaTeX.")
def command(
    run: Path,
    other: Path | None,
    models: str | None,
    track: str | None,
    measure: str | None,
    out: Path | None,
) -> None:
    """Compare the models of the folder RUN with one another, or those of RUN with OTHER's.

    Pairs samples of the same scene or question and seed, and tests them by a t test that knows
    which scenes share base scenes. Shows p values with Holm's correction, and the difference that
    each test could have found.
    """
    names = split_names(models)
    first = load_run(run, texts=False)
    comparison = (
        compare_models(first, names, track or "", measure or "")
        if other is None
        else compare_runs(first, load_run(other, texts=False), names, track or "", measure or "")
    )
    console = make_console()
    print_view(console, compare_view(comparison))
    if len(comparison.ranks) > 2:
        print_view(console, ranks_view(comparison))
    if comparison.table[["a", "b"]].drop_duplicates().shape[0] == 1:
        for line in flipped_lines(comparison):
            console.print(line, markup=False, soft_wrap=True)
    if out is not None:
        write_comparison(comparison, out)
        console.print(f"Written to {shown_path(out)}", markup=False, soft_wrap=True)
