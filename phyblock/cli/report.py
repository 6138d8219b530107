"""`phyblock report`: a run's tables and page, rebuilt from its records."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console

from phyblock import report
from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath
from phyblock.cli.summary import print_summary

__all__ = ["command", "show_page", "show_tables"]


@click.command("report")
@click.argument("run", type=UserPath())
@click.option("--data", type=UserPath(), help="The data set, where it has moved.")
def command(run: Path, data: Path | None) -> None:
    """Write tables and report.html of the folder RUN again, and print the tables.

    Numbers come from run.yaml and records.jsonl alone: no model, no network. What the page draws
    comes from the data set, as far as it is at hand.
    """
    show_tables(run, data)


def show_tables(folder: Path, data: Path | None = None) -> None:
    """Write tables and page of a run folder, and print what matters of the tables."""
    console = make_console()
    written = report.write_tables(folder)
    print_summary(console, written)
    show_page(console, report.write_report(written, data))


def show_page(console: Console, page: Path) -> None:
    """Say where the page is."""
    console.print(f"The report is {shown_path(page)}", soft_wrap=True, markup=False)
