"""Scenes, questions, records and tasks as files that other frameworks read.

For `datasets.load_dataset` a folder holds one Parquet file, including pictures, and a card that
describes it. VLMEvalKit reads a TSV file, and lmms-eval a folder of tasks.
"""

from __future__ import annotations

import base64
import functools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from PIL import Image

from phyblock.api import Task, Tasks, tasks
from phyblock.data.scenes import StoredScene
from phyblock.domain.question import LETTERS, is_picture_option
from phyblock.errors import Problem, SpecError
from phyblock.files import OutFolder
from phyblock.results.text import CsvRows
from phyblock.sim.pictures import PictureStyle, candidates_png, goal_png, goal_style


def write_scenes(folder: Path, data: str, limit: int | None) -> tuple[Path, ...]:
    """Write the scenes of a data set with their pictures; return the paths.

    Raises StoreError for a folder that cannot be written, SpecError without pyarrow, DataError.
    """

    def row(task: Task) -> dict[str, Any]:
        given = task.item
        style = goal_style(given.scene, PictureStyle())
        return {
            "id": task.key,
            "levels": list(given.scene.levels),
            "parents": list(given.scene.parents),
            "n_blocks": len(given.scene),
            "goal": {"bytes": goal_png(given.scene, style), "path": "goal.png"},
            "candidates": {"bytes": candidates_png(given.candidates, style), "path": "blocks.png"},
            "scene": StoredScene.of(given.scene, given.candidates).as_json(),
        }

    rows = map(row, tasks("full_planning", data=data, limit=limit))
    return write_parquet(folder, "scenes", pd.DataFrame(rows))


def write_questions(folder: Path, questions: str, data: str, limit: int | None) -> tuple[Path, ...]:
    """Write a bundled set or folder of questions with pictures; raises as `write_scenes`."""

    def row(task: Task) -> dict[str, Any]:
        asked, images = task.item.question, task.request().images
        return {
            **{name: getattr(asked, name) for name in ("id", "subtask", "category", "wording")},
            "scene": asked.scene.id,
            "question": asked.text,
            "answer": asked.answer_letters,
            "evidence": json.dumps(asked.evidence, sort_keys=True),
            "options": list(asked.options),
            "levels": list(asked.scene.levels),
            "labels": [image.label for image in images],
            "images": [{"bytes": image.data, "path": f"{image.label}.png"} for image in images],
        }

    rows = map(row, question_tasks(questions, data, limit))
    return write_parquet(folder, "questions", pd.DataFrame(rows))


def question_tasks(questions: str, data: str, limit: int | None) -> Tasks:
    """Return the questions of a bundled set or folder."""
    return tasks("vqa", f"vqa.path={json.dumps(questions)}", data=data, limit=limit)


def write_parquet(folder: Path, kind: str, rows: pd.DataFrame) -> tuple[Path, ...]:
    """Write scenes, questions or records with their card, which says what columns are pictures."""
    card = Path(__file__).with_name("cards") / f"{kind}.md"
    try:
        # Readers take a group at once, and its rows hold pictures.
        table = rows.to_parquet(engine="pyarrow", index=False, row_group_size=100)
    except ImportError as error:
        hint = "pip install 'phyblock[hf]'"
        raise SpecError(Problem("--to hf", "needs the package pyarrow", hint=hint)) from error
    return OutFolder(folder).write({f"{kind}.parquet": table, "README.md": card.read_bytes()})


def write_vlmevalkit(
    folder: Path, questions: str, data: str, limit: int | None
) -> tuple[Path, ...]:
    """Write multiple-choice questions as a TSV file, not those of ordering; return the paths.

    In `$LMUData`, VLMEvalKit recognizes it by its name as a multiple-choice set. Pictures are
    base64; several are a list, with names in `image_path`. Raises StoreError if the folder cannot
    be written or a file of others would be overwritten, DataError for an unreadable set or picture.
    """

    def row(task: Task) -> dict[str, str]:
        asked, images = task.item.question, task.request().images
        labels = [image.label for image in images]
        coded = [base64.b64encode(image.data).decode() for image in images]
        names = [f"{asked.id}-{label}.png" for label in labels]
        # A picture is named by its place among the sent ones.
        options = [
            f"Picture {labels.index(letter) + 1}" if is_picture_option(option) else option
            for letter, option in zip(LETTERS, asked.options, strict=True)
        ]
        return {
            **{"index": asked.id, "question": asked.text},
            **dict(zip(LETTERS, options, strict=True)),
            **{"answer": asked.answer_letters, "category": asked.subtask},
            **{"l2-category": asked.category, "scene": asked.scene.id},
            "image": repr(coded) if len(images) > 1 else coded[0],
            "image_path": repr(names) if len(images) > 1 else names[0],
        }

    asked_of = question_tasks(questions, data, limit)
    rows = [row(task) for task in asked_of if len(task.item.question.answer) == 1]
    table = CsvRows()
    pd.DataFrame(rows).to_csv(table, sep="\t", index=False, lineterminator="\r\n")
    return OutFolder(folder).write({"PhyBlock_MCQ.tsv": table.getvalue()})


def write_lmms_eval(folder: Path, limit: int | None) -> tuple[Path, ...]:
    """Write tasks of single-turn tracks for lmms-eval's `--include_path`. Raises StoreError."""
    utils = f"from {__name__} import doc_to_text, doc_to_visual, process_results\n"
    texts = {"utils.py": utils}
    form = Path(__file__).with_name("lmms_eval.yaml").read_text(encoding="utf-8")
    for track in ("full_planning", "pose_planning", "vqa"):
        rows = f"{track}.jsonl"
        place = json.dumps(str((folder / rows).absolute()))
        texts[f"{track}.yaml"] = form.format(track=track, rows=place)
        keys = (json.dumps({"track": track, "key": one.key}) for one in tasks(track, limit=limit))
        texts[rows] = "".join(f"{line}\n" for line in keys)
    return OutFolder(folder).write(texts)


_tasks = functools.cache(tasks)


def _task(doc: Mapping[str, str]) -> Task:
    """Return the task of a row of lmms-eval; the tasks of a track are read once."""
    return _tasks(doc["track"])[doc["key"]]


def doc_to_visual(doc: Mapping[str, str]) -> list[Image.Image]:
    """Return the pictures of a row, in the order sent."""
    return [one.convert("RGB") for one in _task(doc).pictures.values()]


def doc_to_text(doc: Mapping[str, str], _: object = None) -> str:
    """Return the text of a row, to be sent after its pictures: the prompt of a run."""
    parts = (part for message in _task(doc).request().messages for part in message.parts)
    return "\n\n".join(part for part in parts if isinstance(part, str))


def process_results(doc: Mapping[str, str], results: Sequence[str]) -> dict[str, float]:
    """Return the measures of a reply."""
    score = _task(doc).score(results[0])
    return {"value": score.value, "success": float(score.success)}
