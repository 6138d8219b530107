"""Writing a set of questions: lines, data card and checksums."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from phyblock.data import VERSION_FILE
from phyblock.data.questions import StoredQuestion
from phyblock.domain.question import LETTERS, SUBTASK_NAMES, SUBTASKS, Question
from phyblock.domain.scene import Scene
from phyblock.errors import Problem, StoreError
from phyblock.files import atomic_write, check_free, writing
from phyblock.sim.engine import other_engine
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


def question_card(name: str, scenes_name: str, questions: Sequence[Question], made_by: str) -> str:
    """Return the Markdown card of a set of questions called `name` about those scenes."""
    by_subtask = {s: [q for q in questions if q.subtask == s] for s in SUBTASKS}
    text = Path(__file__).with_name("card.md").read_text(encoding="utf-8")
    return text.format(
        name=name,
        scenes_name=scenes_name,
        count=len(questions),
        scenes=len({question.scene.id for question in questions}),
        subtasks=sum(bool(asked) for asked in by_subtask.values()),
        made_by=made_by,
        simulators=f", with {engine}," if (engine := other_engine()) else "",
        rows="\n".join(_row(asked) for asked in by_subtask.values() if asked),
    )


def _row(questions: Sequence[Question]) -> str:
    subtask, count = questions[0].subtask, len(questions)
    letters = Counter(question.answer[0] for question in questions)
    texts = Counter(question.options[question.answer[0]] for question in questions)
    scenes = {question.scene.id for question in questions}
    wordings = {question.wording for question in questions}
    shares = [f"{letters[i] / count:.0%}" for i in range(len(LETTERS))]
    most = "" if "<img1>" in texts or "place A" in texts else f"{max(texts.values()) / count:.0%}"
    cells = [subtask, SUBTASK_NAMES[subtask], count, len(scenes), len(wordings), *shares, most]
    return f"| {' | '.join(map(str, cells))} |"
