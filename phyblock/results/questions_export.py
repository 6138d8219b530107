"""Questions with their pictures in the formats of other frameworks: VLMEvalKit, Hugging Face."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import csv
import json
from collections.abc import AsyncIterator, Sequence
from functools import partial
from pathlib import Path

from phyblock.data import Dataset, QuestionTask, find_questions
from phyblock.domain import LETTERS, SUBTASKS, Question, is_picture_option
from phyblock.files import OutFolder, writing
from phyblock.models.request import Image
from phyblock.resources import needs
from phyblock.sim.pictures import PictureStyle
from phyblock.tracks.pictures import Workshop
from phyblock.tracks.questions import (
    AskedQuestion,
    QuestionPictures,
    open_questions,
    select_questions,
)

MCQ_FILE, ORDERING_FILE = "PhyBlock_MCQ.tsv", "PhyBlock_Ordering.tsv"
EXPORT_FILES = {
    "vlmevalkit": (MCQ_FILE, ORDERING_FILE),
    "hf": ("dataset/", "questions.parquet", "README.md"),
}
"""The files of each format of export."""
_COLUMNS = ("index", "question", *LETTERS, "answer", "category", "l2-category", "scene")
_AT_ONCE = 4
_CARD = """---
configs:
- config_name: default
  data_files: questions.parquet
---
# Questions about block structures

One row a question: `question`, four `options`, `answer` (a letter; four for ordering), and
`images` in the order sent with their `labels` (`scene`, `block`, or the letter of an option).
"""


def export_questions(
    form: str, folder: Path, questions: str, scenes: Dataset, limit: int | None, size_px: int
) -> tuple[Path, ...]:
    """Write questions and their pictures into `folder` in a form of `EXPORT_FILES`; the files.

    `vlmevalkit`: two TSV files, of one right letter and of ordering; put into `$LMUData`, the first
    is a multiple-choice set of VLMEvalKit by its file name. `hf`: a folder for `load_from_disk`,
    and a Parquet file with pictures inside for `load_dataset`. `questions` is a bundled set or a
    folder, `limit` the number of questions, shared over subtasks, `size_px` the edge of a picture.
    Raises StoreError where the folder cannot be written or a file is in the way that we never
    wrote, SpecError where a package is missing, DataError for a set or picture that cannot be read.
    """
    known = open_questions("builtin", find_questions(questions), scenes)
    tasks = select_questions(known.tasks, SUBTASKS, (1, 2, 3, 4), None, limit)
    out, shop = OutFolder(folder), Workshop()
    out.check(EXPORT_FILES[form])
    if form == "hf":
        needs("datasets", "hf", "hf")
    write = _write_hugging_face if form == "hf" else _write_tsv
    try:
        with writing(folder), out.making() as made:
            pictures = QuestionPictures(shop, PictureStyle(size_px=size_px), "images")
            asyncio.run(write(tasks, pictures, made))
    finally:
        shop.close()
    return tuple(folder / name for name in EXPORT_FILES[form] if name != "README.md")


async def _write_tsv(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures, folder: Path
) -> None:
    """Write pictures as base64; those of several are lists, with names in `image_path`."""
    with contextlib.ExitStack() as stack:
        opened = partial(Path.open, mode="w", newline="", encoding="utf-8")
        files = [stack.enter_context(opened(folder / n)) for n in (MCQ_FILE, ORDERING_FILE)]
        writers = [csv.writer(file, delimiter="\t", lineterminator="\n") for file in files]
        for writer in writers:
            writer.writerow((*_COLUMNS, "image", "image_path"))
        async for question, images in _drawn(tasks, pictures):
            labels = [image.label for image in images]
            coded = [base64.b64encode(image.data).decode() for image in images]
            names = [f"{question.id}-{label}.png" for label in labels]
            # A picture is named by where it stands among those that are sent.
            options = [
                f"Picture {labels.index(LETTERS[at]) + 1}" if is_picture_option(option) else option
                for at, option in enumerate(question.options)
            ]
            about = (question.subtask, question.category, question.scene.id)
            sent = (repr(coded), repr(names)) if len(images) > 1 else (coded[0], names[0])
            row = (question.id, question.text, *options, question.answer_letters, *about, *sent)
            writers[len(question.answer) > 1].writerow(row)


async def _write_hugging_face(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures, folder: Path
) -> None:
    from datasets import Dataset, Features, Value, utils  # type: ignore[import-untyped]
    from datasets import Image as HfImage

    rows = [
        {
            "id": question.id,
            "subtask": question.subtask,
            "category": question.category,
            "scene": question.scene.id,
            "wording": question.wording,
            "question": question.text,
            "answer": question.answer_letters,
            "evidence": json.dumps(question.evidence, sort_keys=True),
            "options": list(question.options),
            "levels": list(question.scene.levels),
            "labels": [image.label for image in images],
            "images": [{"bytes": image.data, "path": f"{image.label}.png"} for image in images],
        }
        async for question, images in _drawn(tasks, pictures)
    ]
    texts = ("id", "subtask", "category", "scene", "wording", "question", "answer", "evidence")
    lists = {"options": Value("string"), "levels": Value("int64"), "labels": Value("string")}
    features = {name: Value("string") for name in texts} | {n: [v] for n, v in lists.items()}
    utils.disable_progress_bars()
    dataset = Dataset.from_list(rows, features=Features({**features, "images": [HfImage()]}))
    dataset.save_to_disk(folder / "dataset")
    dataset.to_parquet(folder / "questions.parquet")
    (folder / "README.md").write_text(_CARD, encoding="utf-8")


async def _drawn(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures
) -> AsyncIterator[tuple[Question, tuple[Image, ...]]]:
    """Yield questions with their pictures in the order in which models get them."""
    for start in range(0, len(tasks), _AT_ONCE):
        some = tasks[start : start + _AT_ONCE]
        drawn = await asyncio.gather(*(pictures.of(AskedQuestion(task)) for task in some))
        for task, images in zip(some, drawn, strict=True):
            yield task.question, images
