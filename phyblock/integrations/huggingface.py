"""Scenes, questions and records as folders that `datasets.load_dataset` reads.

A folder holds one Parquet file, including pictures, and a card that describes it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from phyblock.api import Task, tasks
from phyblock.data.scenes import StoredScene
from phyblock.files import OutFolder, needs, writing
from phyblock.results.export import export_run
from phyblock.results.load import Run
from phyblock.sim.pictures import PictureStyle, candidates_png, goal_png, goal_style

FILES = "data.parquet", "README.md"
_CARD = """---
pretty_name: {title}
task_categories: [visual-question-answering]
tags: [physical-reasoning, assembly, phyblock]
configs:
- config_name: default
  data_files: [{{split: {split}, path: {file}}}]
---
# {title}

{about}
"""
_SCENES = """One row a goal structure: `goal` and `candidates` are its pictures, `scene` is its line
of `scenes.jsonl` as JSON (blocks, candidates, dependencies), `levels` the levels that it counts in,
`parents` the base scenes that it was made from, by which errors cluster."""
_QUESTIONS = """One row a question: `question`, four `options`, `answer` (a letter; four for
ordering), and `images` in the order sent with their `labels` (`scene`, `block`, or the letter of an
option)."""
_RECORDS = """One row a sample of a run: what was asked, the reply, what was read, and the
counts."""


def write_records(run: Run, folder: Path | None = None) -> tuple[Path, ...]:
    """Write the records of a run into `folder` (default: export/hf in the run's); return the paths.

    Raises as `export_run`.
    """
    target = folder or run.path / "export" / "hf"
    (file,) = export_run(run, "parquet", target)
    card = _CARD.format(title="PhyBlock records", split="train", file=file.name, about=_RECORDS)
    OutFolder(target).write({"README.md": card.encode()})
    return file, target / "README.md"


def write_scenes(folder: Path, data: str, limit: int | None, size_px: int) -> tuple[Path, ...]:
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
    return _write(folder, rows, ("goal", "candidates"), "PhyBlock scenes", _SCENES)


def write_questions(
    folder: Path, questions: str, data: str, limit: int | None, size_px: int
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
    return _write(folder, rows, ("images",), "PhyBlock questions", _QUESTIONS)


def question_tasks(questions: str, data: str, limit: int | None, size_px: int) -> Iterator[Task]:
    """Yield the questions of a bundled set or folder, with pictures of this size."""
    given = (f"vqa.path={json.dumps(questions)}", f"images.size_px={size_px}")
    yield from tasks("vqa", *given, data=data, limit=limit)


def _write(
    folder: Path, rows: Iterator[dict[str, Any]], pictures: Sequence[str], title: str, about: str
) -> tuple[Path, ...]:
    """Write rows and their card; columns in `pictures` hold a picture or a list of them."""
    needs("datasets", "hf", "hf")
    from datasets import Dataset, Image, List, utils

    out = OutFolder(folder)
    out.check(FILES)
    utils.disable_progress_bars()
    with writing(folder), out.making() as made:
        found = list(rows)
        table = Dataset.from_list(found)
        for name in pictures:
            several = isinstance(found[0][name], list)
            table = table.cast_column(name, List(Image()) if several else Image())
        table.to_parquet(made / FILES[0])
        card = _CARD.format(title=title, split="test", file=FILES[0], about=about)
        (made / FILES[1]).write_text(card, encoding="utf-8")
    return tuple(folder / name for name in FILES)
