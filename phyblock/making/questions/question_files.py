"""Writing a set of questions: lines, data card and checksums."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from phyblock.datasets.version import VERSION_FILE
from phyblock.domain.question import Question
from phyblock.domain.scene import Scene
from phyblock.errors import Problem, StoreError
from phyblock.files import atomic_write, check_free, writing
from phyblock.making.questions.question_card import question_card
from phyblock.records.question import StoredQuestion
from phyblock.stable import hex_digest

QUESTIONS_FILE = "questions.jsonl"
_CARD_FILE = "CARD.md"
_SUMS_FILE = "SHA256SUMS"
SET_VERSION = 4
"""Raised whenever questions of a name ask something else, so that no results are mixed."""


def check_place(folder: Path, replace: bool) -> None:
    """Raise StoreError when the folder holds questions already and is not to be replaced, or files
    of others by the names that will be written.
    """
    if (folder / QUESTIONS_FILE).exists() and not replace:
        hint = "give another --out, or --replace"
        raise StoreError(Problem(str(folder), "holds questions already", hint=hint))
    if not (folder / QUESTIONS_FILE).exists():
        others = [folder / name for name in (QUESTIONS_FILE, _CARD_FILE, VERSION_FILE, _SUMS_FILE)]
        check_free(others, "give another --out")


def write_questions(
    folder: Path,
    questions: Sequence[Question],
    originals: Mapping[str, Scene],
    scenes_name: str,
    made_by: str,
) -> None:
    """Write the questions, sorted as they are, with card and checksums; StoreError if it cannot.

    `originals` are the scenes as stored, by id, of the set `scenes_name`; `made_by` is the command
    that makes the same files.
    """
    lines = "".join(f"{StoredQuestion.of(q, originals[q.scene.id]).as_json()}\n" for q in questions)
    files = {
        _CARD_FILE: question_card(folder.name, scenes_name, questions, made_by).encode(),
        QUESTIONS_FILE: lines.encode(),
        VERSION_FILE: f"{SET_VERSION}\n".encode(),
    }
    sums = "".join(f"{hex_digest(d)}  {name}\n" for name, d in files.items())
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, data in {**files, _SUMS_FILE: sums.encode()}.items():
            atomic_write(folder / name, data)
