"""`phyblock export-data`: questions with their pictures, for other tools."""

from __future__ import annotations

import os
from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import NAME_OR_PATH, UserPath
from phyblock.datasets import SCENES_FILE
from phyblock.domain import SUBTASKS
from phyblock.report.export.questions import QUESTION_FORMATS, export_questions
from phyblock.resources import bundled, cache_dir
from phyblock.run.data import open_dataset
from phyblock.sim import PictureStyle
from phyblock.tracks.vqa.opening import open_questions, select_questions
from phyblock.tracks.vqa.pictures import QuestionPictures

__all__ = ["command"]

_LEVELS = (1, 2, 3, 4)


@click.command("export-data")
@click.option(
    "--to", "form", required=True, type=click.Choice(list(QUESTION_FORMATS)), help="The format."
)
@click.option("--out", required=True, type=UserPath(), help="Folder to write.")
@click.option(
    "--questions",
    type=NAME_OR_PATH,
    default="phyblock-vqa",
    show_default=True,
    help="A set of questions, or folder.",
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
    form: str, out: Path, questions: str, data: str, limit: int | None, size_px: int
) -> None:
    """Write questions with their pictures: a VLMEvalKit TSV, or a Hugging Face dataset."""
    scenes = open_dataset("builtin", _found(data, SCENES_FILE))
    asked = open_questions("builtin", _found(questions, "questions.jsonl"), scenes)
    tasks = select_questions(asked.tasks, SUBTASKS, _LEVELS, None, limit)
    workers = min(4, os.cpu_count() or 1)
    style = PictureStyle(size_px=size_px)
    pictures = QuestionPictures(cache_dir() / "pictures", style, "images", workers)
    try:
        files = export_questions(tasks, pictures, form, out)
    finally:
        pictures.close()
    console = make_console()
    for file in files:
        console.print(shown_path(file), markup=False, soft_wrap=True)


def _found(name: str, file: str) -> Path:
    """The folder that a name means: a path that holds `file`, else a bundled data set."""
    return Path(name) if (Path(name) / file).is_file() else bundled("benchmarks", "data", name)
