"""`phyblock questions show`: one question, with its pictures."""

from __future__ import annotations

import io
import json
from pathlib import Path

import click
from PIL import Image

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.options import UserPath
from phyblock.data import QuestionSet
from phyblock.domain import LETTERS, SUBTASK_NAMES, Question
from phyblock.errors import DataError, Problem
from phyblock.files import write_named
from phyblock.making.cli.question_sets import (
    data_option,
    questions_option,
    read_question_set,
    size_option,
)
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_png
from phyblock.text import did_you_mean

__all__ = ["command"]

_GAP_PX = 8


@click.command("show")
@click.argument("question")
@questions_option
@data_option
@click.option("--out", type=UserPath(), metavar="FILE", help="Draw the pictures to this PNG.")
@size_option
@click.option("--blind", is_flag=True, help="Leave out answer and evidence.")
def command(
    question: str, questions: str, data: str, out: Path | None, size: int, blind: bool
) -> None:
    """Show QUESTION, an id like sh-001: text, options, answer and evidence.

    With --out, draw its pictures side by side, in the order of the recipe.
    """
    shown = _find(read_question_set(questions, data), question)
    console = make_console()
    labels = ", ".join(picture.label for picture in shown.pictures)
    lines = [
        f"{shown.id} · {SUBTASK_NAMES[shown.subtask]} · scene {shown.scene.id}",
        f"pictures: {labels}",
        "",
        shown.text,
        *(f"  {letter}. {text}" for letter, text in zip(LETTERS, shown.options, strict=True)),
    ]
    if not blind:
        lines += ["", f"answer: {shown.answer_letters}"]
        lines.append(f"evidence: {json.dumps(shown.evidence)}")
    for line in lines:
        console.print(line, markup=False, highlight=False, soft_wrap=True)
    if out is not None:
        write_named(out, _side_by_side(shown, PictureStyle(size)))
        console.print(f"pictures: {shown_path(out)}", markup=False, soft_wrap=True)


def _find(questions: QuestionSet, name: str) -> Question:
    by_id = {task.question.id: task.question for task in questions.tasks}
    if name not in by_id:
        message, hint = "holds no such question", did_you_mean(name, by_id)
        raise DataError(Problem(str(questions.root), message, "", name, hint=hint))
    return by_id[name]


def _side_by_side(question: Question, style: PictureStyle) -> bytes:
    images = [Image.open(io.BytesIO(question_png(one, style))) for one in question.pictures]
    width = len(images) * (style.size_px + _GAP_PX) - _GAP_PX
    sheet = Image.new("RGB", (width, style.size_px), "white")
    for i, image in enumerate(images):
        sheet.paste(image, (i * (style.size_px + _GAP_PX), 0))
        image.close()
    file = io.BytesIO()
    sheet.save(file, "PNG")
    return file.getvalue()
