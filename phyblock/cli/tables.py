"""`phyblock tables`: a run's tables in the terminal, or as Markdown, LaTeX or CSV to paste."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.cli.console import make_console, print_view
from phyblock.cli.paths import UserPath
from phyblock.errors import Problem, SpecError
from phyblock.report import TextTable, to_latex, to_markdown
from phyblock.report.write import make_tables, table_names
from phyblock.tables.load import load_run
from phyblock.tables.showing import marked
from phyblock.tracks.kind import kinds

__all__ = ["command"]


@click.command("tables")
@click.argument("run", type=UserPath())
@click.option("--paper", is_flag=True, help="Published, ours and difference: Tables 1, 2, 3, 5.")
@click.option("--only", "names", multiple=True, metavar="NAME", help="Only this table; repeat.")
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "md", "tex"]),
    default="text",
    show_default=True,
    help="How to print them.",
)
def command(run: Path, paper: bool, names: tuple[str, ...], form: str) -> None:
    """Print all tables of the folder RUN that have rows. Writes nothing.

    With --paper, print those of the paper's tables in which a model of the run has a row.
    """
    loaded = load_run(run, texts=False)
    if paper:
        views = {}
        known = [kind.report() for kind in kinds().values()]
        tables = {n: (t, one) for one in known for n, t in one.paper_tables.items()}
        for number, (table, of_track) in sorted(tables.items()):
            frame = table.frame(loaded)
            if len(frame):
                words = of_track.showing(loaded)
                views[f"paper{number}"] = marked(table.view(frame, loaded), words)
    else:
        frames, views = make_tables(loaded, names or table_names(loaded))
        views = {name: view for name, view in views.items() if name in names or len(frames[name])}
    if unknown := [name for name in names if name not in views]:
        allowed = ", ".join(views if paper else table_names(loaded))
        raise SpecError(
            Problem(str(run), "has no such table", "--only", ", ".join(unknown), allowed)
        )
    for name, view in views.items():
        if not names or name in names:
            _print(name, view, form)
    if not views:
        click.echo("No model of the run has a row in the paper's tables.")


def _print(name: str, view: TextTable, form: str) -> None:
    if form == "text":
        print_view(make_console(), view)
    else:
        text = to_markdown(view) if form == "md" else to_latex(view, f"phyblock-{name}")
        click.echo(text)
