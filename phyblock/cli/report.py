"""`phyblock report`: a run's tables and page, rebuilt from its records."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from phyblock import report
from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath, moved_data_option
from phyblock.cli.summary import print_summary
from phyblock.report.inputs import inputs_digest
from phyblock.report.made import PAGE, TABLES, note_made, still_made
from phyblock.report.terminal import terminal_of

__all__ = ["command", "show_made", "show_tables"]


@click.command("report")
@click.argument("run", type=UserPath())
@moved_data_option
def command(run: Path, data: Path | None) -> None:
    """Write tables and report.html of the folder RUN again, and print the tables.

    Takes numbers from run.yaml and records.jsonl alone: no model, no network. Draws scenes from the
    data set, where it is at hand.
    """
    show_tables(run, data)


def show_tables(folder: Path, data: Path | None = None) -> None:
    """Write tables and page of a run folder, and print what matters of the tables."""
    _show(folder, None, data, page=True, anew=True)


def show_made(folder: Path, tables: Sequence[str], *, page: bool) -> None:
    """As `show_tables` for these tables, but nothing is made anew that did not change."""
    _show(folder, tables, None, page=page, anew=False)


def _show(
    folder: Path, tables: Sequence[str] | None, data: Path | None, *, page: bool, anew: bool
) -> None:
    console = make_console()
    inputs = inputs_digest(folder, tables)
    made = None if anew else still_made(folder, inputs, page=page)
    if made is not None:
        print_summary(console, made.terminal, folder / TABLES)
    else:
        written = report.write_tables(folder, tables)
        terminal = terminal_of(written)
        print_summary(console, terminal, written.folder)
        paged = report.write_page(written, data) if page else None
        # Drawn from data elsewhere, it is not what a run makes of its own.
        note_made(folder, None if data else inputs, terminal, written.files, paged)
    if page:
        console.print(f"The report is {shown_path(folder / PAGE)}", soft_wrap=True, markup=False)
