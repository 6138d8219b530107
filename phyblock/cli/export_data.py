"""`phyblock export-data`: what tracks ask about, with its pictures, for other tools."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import NAME_OR_PATH, UserPath
from phyblock.data import read_data_set
from phyblock.tables.track_report import ItemExport
from phyblock.tracks import kinds

__all__ = ["command"]


def _exports() -> dict[str, ItemExport]:
    """What the tracks write, by the word after `--to`; of two, the later track has it."""
    brought = [kind.report().export for kind in kinds().values()]
    return {form: export for export in brought if export is not None for form in export.formats}


_EXPORTS = _exports()
_SETS = dict.fromkeys(export.items for export in _EXPORTS.values())


@click.command("export-data")
@click.option("--to", "form", required=True, type=click.Choice(list(_EXPORTS)), help="The format.")
@click.option("--out", required=True, type=UserPath(), help="Folder to write.")
@click.option(
    "--questions",
    type=NAME_OR_PATH,
    help=f"A set of questions, or folder. [default: {', '.join(_SETS)}]",
)
@click.option(
    "--data",
    type=NAME_OR_PATH,
    default="phyblock-400",
    show_default=True,
    help="Scenes they are about, or folder.",
)
@click.option("--limit", type=click.IntRange(min=1), help="N questions, spread over subtasks.")
@click.option(
    "--size",
    "size_px",
    type=click.IntRange(128, 2048),
    default=512,
    show_default=True,
    help="Edge of a picture in pixels.",
)
def command(
    form: str, out: Path, questions: str | None, data: str, limit: int | None, size_px: int
) -> None:
    """Write questions with their pictures: a VLMEvalKit TSV, or a Hugging Face dataset."""
    export = _EXPORTS[form]
    scenes = read_data_set(data)
    files = export.write(form, out, questions or export.items, scenes, limit, size_px)
    console = make_console()
    for file in files:
        console.print(shown_path(file), markup=False, soft_wrap=True)
