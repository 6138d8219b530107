"""Runs and questions in the formats of other tools: CSV, Parquet, Hugging Face, VLMEvalKit."""

from __future__ import annotations

import asyncio
import base64
import csv
import json
from collections.abc import AsyncIterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from phyblock.data import Dataset, QuestionTask, find_questions
from phyblock.domain import LETTERS, SUBTASKS, Question, is_picture_option
from phyblock.files import OutFolder, needs, writing
from phyblock.models.request import Image
from phyblock.records.files import RecordLines, read_prompts, record_types
from phyblock.records.record import PictureMark, PromptMessage, Record
from phyblock.results.load import TOKENS, Run, track_measures
from phyblock.results.text import to_csv
from phyblock.sim.pictures import PictureStyle
from phyblock.tracks.pictures import Workshop
from phyblock.tracks.questions import (
    AskedQuestion,
    open_questions,
    question_drawings,
    select_questions,
)

_TYPES = {
    **dict.fromkeys(("sample", "track", "model", "scene"), "string"),
    "seed": "int64",
    **dict.fromkeys(("levels", "parents"), "object"),
    "n_blocks": "Int64",
    **dict.fromkeys(("outcome", "finish", "rule"), "string"),
    **dict.fromkeys(("cost_usd", "latency_s"), "Float64"),
    **dict.fromkeys(("attempts", *TOKENS), "Int64"),
    "cached": "boolean",
}
"""Columns that frames of records have as well."""
_TEXTS = ("prompt", "reply", "reasoning", "provider_model", "error", "asked")


def export_frame(run: Run) -> pd.DataFrame:
    """Return one row a sample: what was asked, of whom, the reply, what was read, and the counts.

    Counts are `tp_<setting>`, `fp_<setting>`, `fn_<setting>` of the headline matcher, all levels
    by the `aov` criterion (of episodes: over placed blocks); `count_<name>_<column>` are those that
    records keep. Columns have the same types whatever the rows are; what a track does not have is
    missing. `levels`, `parents` and `plan` are lists.
    """
    types = {**dict.fromkeys(_TEXTS, "string"), "plan": "object"}
    for record in record_types():
        types |= {column: kind for column, (kind, _) in record.exported.items()}
    for setting in run.design.suite.settings:
        types |= {f"{name}_{setting.lower()}": "Int64" for name in ("tp", "fp", "fn")}
    frame = run.records[list(_TYPES)].astype(_TYPES)
    frame[["levels", "parents"]] = frame[["levels", "parents"]].map(list)
    if run.design.suite.vary.factors:
        frame.insert(5, "variant", run.records["variant"].astype("string"))
    prompts = read_prompts(run.path)
    rows = [_row(run, one, prompts) for one in RecordLines(run.path).at(run.records["start"])]
    for name, kind in types.items():
        frame[name] = pd.Series([row.get(name) for row in rows], frame.index, dtype=kind)
    for track in run.design.suite.tracks:
        for counted in dict.fromkeys(measure.counted for measure in track_measures(track)):
            held = run.counts.get((track, counted.name))
            for n, column in enumerate(counted.columns if counted.sample is not None else ()):
                key = f"count_{counted.name}_{column}"
                if key not in frame:
                    frame[key] = pd.Series(pd.NA, frame.index, dtype="Float64")
                if held is not None:
                    frame.loc[frame.index[held.row], key] = held.numbers[:, n]
    return frame


def _row(
    run: Run, record: Record, prompts: Mapping[str, Sequence[PromptMessage]]
) -> dict[str, Any]:
    """Return what a frame of records does not hold of one."""
    reply, plan = record.reply, getattr(record.parse, "plan", None)
    messages = None if record.prompt is None else prompts.get(record.prompt.messages)
    parts = [part for message in messages or () for part in message.parts]
    found: dict[str, Any] = {
        # As it was sent, pictures by their labels; None where none was stored.
        "prompt": None if messages is None else "\n".join(
            f"[picture: {part.image}]" if isinstance(part, PictureMark) else part for part in parts
        ),
        "reply": reply and reply.text,
        "reasoning": reply and reply.reasoning,
        "provider_model": reply and reply.provider_model,
        "error": record.error and record.error.message,
        "asked": record.asked,
        "plan": None if plan is None else list(plan),
        **record.export_row(),
    }  # fmt: skip
    for score in record.scores:
        is_headline = score.matcher in (None, "", run.design.matcher)
        if is_headline and score.criterion in ("aov", "placed"):
            counts = {"tp": score.tp, "fp": score.fp, "fn": score.fn}
            found |= {f"{name}_{score.setting.lower()}": n for name, n in counts.items()}
    return found


def export_run(run: Run, form: str, folder: Path | None = None) -> tuple[Path, ...]:
    """Write a run in another format into `folder` (export/FORMAT in the run's); what was written.

    `csv`: records.csv, lists as JSON. `parquet`: records.parquet. `hf`: that and a folder that
    `datasets.load_from_disk` opens. Raises StoreError where the folder cannot be written or a file
    is in the way that we never wrote, SpecError where a package is missing.
    """
    out = OutFolder(folder or run.path)
    below = "" if folder else f"export/{form}/"
    target = out.path / below
    for package in {"hf": ("pyarrow", "datasets"), "parquet": ("pyarrow",)}.get(form, ()):
        needs(package, "hf", form)
    with writing(target), out.making(below) as made:
        frame = export_frame(run)
        if form == "csv":
            for name in ("levels", "parents", "plan"):
                as_json = [json.dumps(v) if isinstance(v, list) else v for v in frame[name]]
                frame[name] = pd.Series(as_json, dtype="object")
            (made / "records.csv").write_bytes(to_csv(frame).encode("utf-8", "replace"))
            return (target / "records.csv",)
        frame.to_parquet(made / "records.parquet", index=False, engine="pyarrow")
        if form == "parquet":
            return (target / "records.parquet",)
        from datasets import Dataset, utils  # type: ignore[import-untyped]

        utils.disable_progress_bars()
        Dataset.from_pandas(frame, preserve_index=False).save_to_disk(made / "dataset")
        return target / "records.parquet", target / "dataset"


MCQ_FILE, ORDERING_FILE = "PhyBlock_MCQ.tsv", "PhyBlock_Ordering.tsv"
EXPORT_FILES = {
    "vlmevalkit": (MCQ_FILE, ORDERING_FILE),
    "hf": ("dataset/", "questions.parquet", "README.md"),
}
"""The files of each format of questions."""
_COLUMNS = ("index", "question", *LETTERS, "answer", "category", "l2-category", "scene")
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
            asyncio.run(write(_drawn(tasks, shop, PictureStyle(size_px=size_px)), made))
    finally:
        shop.close()
    return tuple(folder / name for name in EXPORT_FILES[form] if name != "README.md")


async def _write_tsv(drawn: _Drawn, folder: Path) -> None:
    """Write pictures as base64; those of several are lists, with names in `image_path`."""
    opened = [(folder / name).open("w", newline="", encoding="utf-8") for name in
              (MCQ_FILE, ORDERING_FILE)]  # fmt: skip
    with opened[0], opened[1]:
        writers = [csv.writer(file, delimiter="\t", lineterminator="\n") for file in opened]
        for writer in writers:
            writer.writerow((*_COLUMNS, "image", "image_path"))
        async for question, images in drawn:
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


async def _write_hugging_face(drawn: _Drawn, folder: Path) -> None:
    from datasets import Dataset, Features, Value, utils
    from datasets import Image as HfImage

    texts = ("id", "subtask", "category", "scene", "wording", "question", "answer", "evidence")
    rows = [
        {
            **{name: getattr(question, name) for name in ("id", "subtask", "category", "wording")},
            "scene": question.scene.id,
            "question": question.text,
            "answer": question.answer_letters,
            "evidence": json.dumps(question.evidence, sort_keys=True),
            "options": list(question.options),
            "levels": list(question.scene.levels),
            "labels": [image.label for image in images],
            "images": [{"bytes": image.data, "path": f"{image.label}.png"} for image in images],
        }
        async for question, images in drawn
    ]
    lists = {"options": Value("string"), "levels": Value("int64"), "labels": Value("string")}
    features = {name: Value("string") for name in texts} | {n: [v] for n, v in lists.items()}
    utils.disable_progress_bars()
    dataset = Dataset.from_list(rows, features=Features({**features, "images": [HfImage()]}))
    dataset.save_to_disk(folder / "dataset")
    dataset.to_parquet(folder / "questions.parquet")
    (folder / "README.md").write_text(_CARD, encoding="utf-8")


_Drawn = AsyncIterator[tuple[Question, tuple[Image, ...]]]


async def _drawn(tasks: Sequence[QuestionTask], shop: Workshop, style: PictureStyle) -> _Drawn:
    """Yield questions with their pictures in the order in which models get them."""
    for task in tasks:
        yield task.question, await shop.images(question_drawings(AskedQuestion(task), style))
