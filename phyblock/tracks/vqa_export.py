"""Questions with their pictures in the formats of other tools: VLMEvalKit TSV, Hugging Face."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import csv
import json
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Any

from phyblock.data import Dataset, QuestionTask, find_questions
from phyblock.domain import LETTERS, SUBTASKS, is_picture_option
from phyblock.files import OutFolder, writing
from phyblock.models.request import Image
from phyblock.resources import needs
from phyblock.sim.pictures import PictureStyle
from phyblock.tracks.measures import ItemExport
from phyblock.tracks.opening import picture_folder
from phyblock.tracks.pictures import render_workers
from phyblock.tracks.vqa import (
    BUILTIN_QUESTIONS,
    QuestionPictures,
    ShownQuestion,
    open_questions,
    select_questions,
)

MCQ_FILE, ORDERING_FILE = "PhyBlock_MCQ.tsv", "PhyBlock_Ordering.tsv"
_TSV = ("index", "question", *LETTERS, "answer", "category", "l2-category", "scene")
_LEVELS = (1, 2, 3, 4)
_FILES = {
    "vlmevalkit": (MCQ_FILE, ORDERING_FILE),
    "hf": ("questions.parquet", "README.md", "dataset/"),
}
"""What each format writes, as far as it is known before it is made."""
_AT_ONCE = 4

_Drawn = tuple[QuestionTask, tuple[Image, ...]]


def export_questions(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures, form: str, folder: Path
) -> tuple[Path, ...]:
    """Write questions and their pictures into `folder`; what was written.

    Raises StoreError where the folder cannot be written or a file is in the way that we never
    wrote, SpecError where a package is missing,
    DataError for a picture that cannot be had.
    """
    out = OutFolder(folder)
    out.check(_FILES[form])
    with writing(folder), out.making() as made:
        files = _FORMATS[form](tasks, pictures, made)
    return tuple(folder / file.relative_to(made) for file in files)


def _vlmevalkit(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures, folder: Path
) -> tuple[Path, ...]:
    """Two TSV files: of one right letter, and of ordering, whose answer is four letters.

    Put into `$LMUData`, the first is a multiple-choice set of VLMEvalKit by its file name. Pictures
    are base64; those of several are lists, with names in `image_path`.
    """
    return asyncio.run(_write_tsv(tasks, pictures, folder))


async def _write_tsv(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures, folder: Path
) -> tuple[Path, ...]:
    paths = (folder / MCQ_FILE, folder / ORDERING_FILE)
    with contextlib.ExitStack() as stack:
        files = [
            stack.enter_context(path.open("w", newline="", encoding="utf-8")) for path in paths
        ]
        writers = [csv.writer(file, delimiter="\t", lineterminator="\n") for file in files]
        for writer in writers:
            writer.writerow((*_TSV, "image", "image_path"))
        async for task, drawn in _drawn(tasks, pictures):
            is_ordering = len(task.question.answer) > 1
            writers[is_ordering].writerow(_tsv_row(task, drawn))
    return paths


def _tsv_row(task: QuestionTask, drawn: Sequence[Image]) -> tuple[str, ...]:
    question = task.question
    coded = [base64.b64encode(image.data).decode() for image in drawn]
    names = [f"{question.id}-{image.label}.png" for image in drawn]
    options = [_option(option, place, drawn) for place, option in enumerate(question.options)]
    several = len(drawn) > 1
    return (
        question.id,
        question.text,
        *options,
        question.answer_letters,
        question.subtask,
        question.category,
        question.scene.id,
        repr(coded) if several else coded[0],
        repr(names) if several else names[0],
    )


def _option(option: str, place: int, drawn: Sequence[Image]) -> str:
    """An option's text; a picture is named by where it stands among those that are sent."""
    if not is_picture_option(option):
        return option
    labels = [image.label for image in drawn]
    return f"Picture {labels.index(LETTERS[place]) + 1}"


def _hugging_face(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures, folder: Path
) -> tuple[Path, ...]:
    """A folder for `load_from_disk`, and a Parquet file with pictures inside for `load_dataset`."""
    needs("datasets", "hf", "hf")
    from datasets import Dataset, Features, Value, utils  # type: ignore[import-untyped]
    from datasets import Image as HfImage

    texts = ("id", "subtask", "category", "scene", "wording", "question", "answer", "evidence")
    features = Features(
        {
            **{name: Value("string") for name in texts},
            "options": [Value("string")],
            "levels": [Value("int64")],
            "labels": [Value("string")],
            "images": [HfImage()],
        }
    )
    utils.disable_progress_bars()
    rows = asyncio.run(_rows(tasks, pictures))
    dataset = Dataset.from_list(rows, features=features)
    dataset.save_to_disk(folder / "dataset")
    path = folder / "questions.parquet"
    dataset.to_parquet(path)
    (folder / "README.md").write_text(_CARD, encoding="utf-8")
    return folder / "dataset", path


async def _rows(tasks: Sequence[QuestionTask], pictures: QuestionPictures) -> list[dict[str, Any]]:
    return [
        {
            "id": task.question.id,
            "subtask": task.question.subtask,
            "category": task.question.category,
            "scene": task.question.scene.id,
            "wording": task.question.wording,
            "question": task.question.text,
            "answer": task.question.answer_letters,
            "evidence": json.dumps(task.question.evidence, sort_keys=True),
            "options": list(task.question.options),
            "levels": list(task.question.scene.levels),
            "labels": [image.label for image in drawn],
            "images": [{"bytes": image.data, "path": f"{image.label}.png"} for image in drawn],
        }
        async for task, drawn in _drawn(tasks, pictures)
    ]


async def _drawn(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures
) -> AsyncIterator[_Drawn]:
    """Questions with their pictures in the order in which models get them, a few at a time."""
    for start in range(0, len(tasks), _AT_ONCE):
        some = tasks[start : start + _AT_ONCE]
        drawn = await asyncio.gather(
            *(pictures.of(ShownQuestion(task.question, task.files)) for task in some)
        )
        for task, images in zip(some, drawn, strict=True):
            yield task, images


_CARD = """---
configs:
- config_name: default
  data_files: questions.parquet
---
# Questions about block structures

One row a question: `question`, four `options`, `answer` (a letter; four for ordering), and
`images` in the order sent with their `labels` (`scene`, `block`, or the letter of an option).
"""

_FORMATS: dict[
    str, Callable[[Sequence[QuestionTask], QuestionPictures, Path], tuple[Path, ...]]
] = {"vlmevalkit": _vlmevalkit, "hf": _hugging_face}
"""Formats of questions by the word after `--to`."""


def _write(
    form: str, out: Path, questions: str, scenes: Dataset, limit: int | None, size_px: int
) -> tuple[Path, ...]:
    """As `ItemExport` says; a `limit` is shared over subtasks."""
    asked = open_questions("builtin", find_questions(questions), scenes)
    tasks = select_questions(asked.tasks, SUBTASKS, _LEVELS, None, limit)
    style = PictureStyle(size_px=size_px)
    pictures = QuestionPictures(picture_folder(), style, "images", render_workers())
    try:
        return export_questions(tasks, pictures, form, out)
    finally:
        pictures.close()


QUESTION_EXPORT = ItemExport(tuple(_FORMATS), BUILTIN_QUESTIONS, _write)
"""What `phyblock export --questions` writes."""
