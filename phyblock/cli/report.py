"""`phyblock report`: a run's tables, rebuilt from its records."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock import report
from phyblock.cli.console import make_console
from phyblock.cli.summary import print_summary

__all__ = ["command", "show_tables"]


@click.command("report")
@click.argument("run", type=click.Path(path_type=Path))
def command(run: Path) -> None:
    """Write the tables of the folder RUN again from its records, and print them.

    Reads run.yaml and records.jsonl alone: no model, no network, no data set.
    """
    show_tables(run)


def show_tables(folder: Path) -> None:
    """Write the tables of a run folder and print what matters of them."""
    print_summary(make_console(), report.write_tables(folder))
