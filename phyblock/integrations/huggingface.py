"""Scenes, questions and records as folders that `datasets.load_dataset` reads.

A folder holds one Parquet file, including pictures, and a card that describes it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from phyblock.api import Task, tasks
from phyblock.data.scenes import StoredScene
from phyblock.errors import Problem, SpecError
from phyblock.files import OutFolder
from phyblock.sim.pictures import PictureStyle, candidates_png, goal_png, goal_style


def write_scenes(
    folder: Path, data: str, limit: int | None, size_px: int = 512
) -> tuple[Path, ...]:
    """Write the scenes of a data set with their pictures; return the paths.

    Raises StoreError if the folder cannot be written or a file of others would be overwritten,
    SpecError if a package is missing, DataError for an unreadable set.
    """

    def row(task: Task) -> dict[str, Any]:
        given = task.item
        style = goal_style(given.scene, PictureStyle(size_px))
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
    return write(folder, "scenes", pd.DataFrame(rows))


def write_questions(
    folder: Path, questions: str, data: str, limit: int | None, size_px: int = 512
) -> tuple[Path, ...]:
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

    rows = map(row, question_tasks(questions, data, limit, size_px))
    return write(folder, "questions", pd.DataFrame(rows))


def question_tasks(questions: str, data: str, limit: int | None, size_px: int) -> Iterator[Task]:
    """Yield the questions of a bundled set or folder, with pictures of this size."""
    given = (f"vqa.path={json.dumps(questions)}", f"images.size_px={size_px}")
    yield from tasks("vqa", *given, data=data, limit=limit)


def write(folder: Path, kind: str, rows: pd.DataFrame) -> tuple[Path, ...]:
    """Write scenes, questions or records with their card, which says what columns are pictures."""
    card = Path(__file__).with_name("cards") / f"{kind}.md"
    try:
        # Readers take a group at once, and its rows hold pictures.
        table = rows.to_parquet(engine="pyarrow", index=False, row_group_size=100)
    except ImportError as error:
        hint = "pip install 'phyblock[hf]'"
        raise SpecError(Problem("--to hf", "needs the package pyarrow", hint=hint)) from error
    return OutFolder(folder).write({f"{kind}.parquet": table, "README.md": card.read_bytes()})
