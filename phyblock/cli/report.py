"""`phyblock report`: a run's tables, rebuilt from its records."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.cli.console import make_console, print_view, shown_path
from phyblock.report import write_tables

__all__ = ["command", "show_tables"]


@click.command("report")
@click.argument("run", type=click.Path(path_type=Path))
def command(run: Path) -> None:
    """Write the tables of the folder RUN again from its records, and print them.

    Reads run.yaml and records.jsonl alone: no model, no network, no data set.
    """
    show_tables(run)


def show_tables(folder: Path) -> None:
    """Write and print all tables of a run folder."""
    console = make_console()
    written = write_tables(folder)
    for view in written.views.values():
        print_view(console, view)
    console.print(f"Tables are in {shown_path(written.folder)}", soft_wrap=True)
