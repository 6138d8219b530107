"""Small question sets for tests of the VQA track: every subtask, right answers drawn at random."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from phyblock.domain.question import CATEGORIES, LETTERS, SUBTASKS
from tests.workspace import SCENES, Raw

VIEW = [45, 22]
SHAPES = ["cube", "arch", "cylinder", "cuboid"]
WITH_PICTURES = ("VP", "CF", "PD", "OR")
PER_SUBTASK = 4


def question(subtask: str, scene: Raw, number: int, rng: np.random.Generator) -> Raw:
    """A question of a subtask about a scene; the right letter is drawn."""
    letters = [str(letter) for letter in rng.permutation(list(LETTERS))]
    made: Raw = {
        "id": f"{subtask.lower()}-{number:03d}",
        "subtask": subtask,
        "category": next(name for name, codes in CATEGORIES.items() if subtask in codes),
        "scene_id": scene["id"],
        "wording": f"{subtask.lower()}-1",
        "question": f"A question of kind {subtask}, number {number}, about the red cube?",
        "options": [str(word) for word in rng.permutation(SHAPES)],
        "answer": letters[0],
        "pictures": [{"label": "scene", "view": VIEW}],
        "evidence": {"slots": {}},
    }
    if subtask in WITH_PICTURES:
        made["options"] = [f"<img{i}>" for i in range(1, 5)]
        made["pictures"] += [
            {"label": letter, "view": [45 + 35 * place, 25 + number], "framed": True}
            for place, letter in enumerate(LETTERS)
        ]
    if subtask == "OR":
        made["answer"] = "".join(letters)
        made["pictures"] = made["pictures"][1:]
    if subtask == "AD":
        made["options"] = [f"place {letter}" for letter in LETTERS]
        marks = [
            {"letter": letter, "position": [0.04 * (place - 1.5), 0.08, 0.0]}
            for place, letter in enumerate(LETTERS)
        ]
        made["pictures"][0]["marks"] = marks
        orders = [block["order"] for block in scene["blocks"]]
        made["pictures"].append({"label": "block", "view": VIEW, "without": orders[1:]})
    return made


def questions(
    scenes: Sequence[Raw] = SCENES,
    per_subtask: int = PER_SUBTASK,
    subtasks: Sequence[str] = SUBTASKS,
) -> list[Raw]:
    """Questions of every subtask, about the scenes in turn."""
    rng = np.random.default_rng(7)
    return [
        question(subtask, scenes[number % len(scenes)], number, rng)
        for subtask in subtasks
        for number in range(per_subtask)
    ]


def write_questions(folder: Path, made: Sequence[Raw] | None = None) -> Path:
    """`questions.jsonl` in a folder."""
    folder.mkdir(exist_ok=True)
    lines = (json.dumps(one) + "\n" for one in (questions() if made is None else made))
    (folder / "questions.jsonl").write_text("".join(lines), encoding="utf-8")
    return folder


def vqa_suite(**fields: Any) -> Raw:
    """Fields of a suite that asks the questions in `questions`; `fields` go into its section."""
    return {
        "tracks": ["vqa"],
        "vqa": {"path": "./questions", **fields},
        "images": {"size_px": 128},
        "models": ["random", "oracle"],
    }
