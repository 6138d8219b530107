"""Data that many tests look at, each read once: what comes with the project, official data."""

import functools
import json
from pathlib import Path

from phyblock.data.base import QuestionSet
from phyblock.data.official import read_official, recorded_models
from phyblock.data.questions import read_questions
from phyblock.data.scenes import read_builtin
from phyblock.domain.scene import AssemblyTask
from phyblock.files import bundled
from phyblock.models.client import read_raw_reply

DATA = bundled("benchmarks", "data")
BUILT_IN = read_builtin(DATA / "phyblock-400")
TASKS = BUILT_IN.tasks


@functools.cache
def built_in_questions() -> QuestionSet:
    return read_questions(DATA / "phyblock-vqa", BUILT_IN)


@functools.cache
def official_tasks(checkout: Path) -> tuple[AssemblyTask, ...]:
    return read_official(checkout).tasks


@functools.cache
def reply_texts(checkout: Path) -> dict[tuple[str, str], str]:
    """Text of every recorded reply by (model folder, scene id)."""
    return {
        (model, path.stem): read_raw_reply(json.loads(path.read_bytes()), str(path)).text
        for model, folder in recorded_models(checkout).items()
        for path in sorted(folder.glob("*.json"))
    }
