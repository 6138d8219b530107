"""`phyblock export`: a run in the formats of other tools."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath
from phyblock.report.export.write import FORMATS, export_run
from phyblock.tables.load import load_run

__all__ = ["command"]


@click.command("export")
@click.argument("run", type=UserPath())
@click.option("--to", "form", required=True, type=click.Choice(FORMATS), help="The format.")
@click.option("--out", type=UserPath(), help="Folder. [default: RUN/export/FORMAT]")
def command(run: Path, form: str, out: Path | None) -> None:
    """Write the records of the folder RUN for another tool.

    inspect: Inspect AI logs, one a track and model. hf: a Hugging Face dataset. csv, parquet: a
    row a sample.
    """
    console = make_console()
    for path in export_run(load_run(run, texts=False), form, out):
        console.print(shown_path(path), markup=False, soft_wrap=True)
