"""Sets as folders: lines, a card, the version, checksums."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from phyblock.data.base import VERSION_FILE
from phyblock.data.questions import StoredQuestion
from phyblock.data.scenes import StoredScene
from phyblock.domain.question import LETTERS, SUBTASK_NAMES, SUBTASKS, Question
from phyblock.domain.scene import CandidateSet, Kind, Scene
from phyblock.errors import Problem
from phyblock.files import atomic_write, check_free, make_folder, read_text, writing
from phyblock.making.checks import LEVEL_LIMITS
from phyblock.making.scenes.sketch import PALETTES, Palette
from phyblock.sim.engine import other_engine
from phyblock.text import hex_digest

SUMS_FILE = "SHA256SUMS"
SCENE_FILES = ("README.md", "scenes.jsonl", VERSION_FILE)
QUESTION_FILES = ("CARD.md", "questions.jsonl", VERSION_FILE)
"""Card, lines and version of a set."""
SCENE_SET_VERSION = 5
"""Increased whenever the same seed makes other scenes or candidate sets: 2 offers distractors as
often as goals need them, and shows at least 3 % of every block's outline; 3 excludes scenes of the
built-in set; 4 accepts only finished structures that are proven to stand; 5 simulates with more
iterations of the contact solver.
"""
QUESTION_SET_VERSION = 11
"""Increased whenever questions with the same name change, so that results are never mixed."""
_Tasks = Sequence[tuple[Scene, CandidateSet]]


def check_out(folder: Path, names: Sequence[str]) -> None:
    """Raise StoreError if the folder already holds files of these names."""
    check_free([folder / name for name in (*names, SUMS_FILE)], "give another --out")


def write_scenes(folder: Path, tasks: _Tasks, card: str) -> None:
    """Write scenes with their candidate sets, sorted by id. Raises StoreError if that fails."""
    by_id = sorted(tasks, key=lambda task: task[0].id)
    lines = (StoredScene.of(scene, candidates).as_json() for scene, candidates in by_id)
    _write(folder, SCENE_FILES, card, lines, SCENE_SET_VERSION)


def write_questions(
    folder: Path, questions: Sequence[Question], originals: Mapping[str, Scene], card: str
) -> None:
    """Write questions in their order; `originals` are the scenes as stored, by id."""
    lines = (StoredQuestion.of(q, originals[q.scene.id]).as_json() for q in questions)
    _write(folder, QUESTION_FILES, card, lines, QUESTION_SET_VERSION)


def _write(
    folder: Path, names: Sequence[str], card: str, lines: Iterable[str], version: int
) -> None:
    texts = (card, "".join(f"{line}\n" for line in lines), f"{version}\n")
    check_out(folder, names)
    make_folder(folder)
    with writing(folder):
        for name, text in zip(names, texts, strict=True):
            atomic_write(folder / name, text)
        atomic_write(folder / SUMS_FILE, sums_text(folder, names))


def sums_text(folder: Path, names: Sequence[str]) -> str:
    """Return checksums of files in the format of `sha256sum -c`."""
    return "".join(f"{hex_digest((folder / name).read_bytes())}  {name}\n" for name in names)


def check_sums(folder: Path) -> tuple[int, tuple[Problem, ...]]:
    """Return the number of files in `SHA256SUMS`, and problems of missing or changed ones."""
    path = folder / SUMS_FILE
    if not path.is_file():
        return 1, (Problem(str(path), "is missing"),)
    lines = read_text(path).splitlines()
    wrong = []
    for line in lines:
        digest, _, name = line.partition("  ")
        file = folder / name
        if not file.is_file():
            wrong.append(Problem(str(file), "is missing"))
        elif hex_digest(file.read_bytes()) != digest:
            wrong.append(Problem(str(file), f"differs from its checksum in {SUMS_FILE}"))
    return len(lines), tuple(wrong)


def _card(template: str, /, **facts: object) -> str:
    """Return a card from a Jinja template in `cards/`, filled with facts."""
    text = (Path(__file__).parent / "cards" / f"{template}.md").read_text(encoding="utf-8")
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(text).render(simulator=other_engine(), **facts) + "\n"


def scene_card(name: str, tasks: _Tasks, command: str, palette: Palette, rejected: int) -> str:
    """Return the Markdown card of scenes that `command` generated."""
    scenes, sizes = [scene for scene, _ in tasks], {len(offered) for _, offered in tasks}
    by_level = {n: [one for one in scenes if n in one.levels] for n in LEVEL_LIMITS}
    text = _card(
        "scenes",
        name=name,
        command=command,
        version=SCENE_SET_VERSION,
        rejected=rejected,
        count=len(scenes),
        shared=sum(len(scene.levels) > 1 for scene in scenes),
        base=_bases(scenes),
        levels=[(n, LEVEL_LIMITS[n], _row(some)) for n, some in by_level.items() if some],
        palette=palette,
        pairs=len(PALETTES[palette]),
        candidates=" to ".join(map(str, sorted({min(sizes), max(sizes)}))),
    )
    return text + _card("scenes_file")


def completed_card(name: str, count: int, command: str) -> str:
    """Return the Markdown card of scenes that were completed from positions."""
    text = _card("completed", name=name, count=count, command=command)
    return text + _card("scenes_file")


def _bases(scenes: Sequence[Scene]) -> int:
    return sum(scene.parents == (scene.id,) for scene in scenes)


def _row(scenes: Sequence[Scene]) -> list[str]:
    """Return numbers of scenes, base scenes; mean and maximum of blocks, types, colors, layers."""
    counts = [
        (len(one), *(len({kind[i] for kind in _kinds(one)}) for i in (0, 1)), max(one.graph.layers))
        for one in scenes
    ]
    cells = [str(len(scenes)), str(_bases(scenes))]
    for column in zip(*counts, strict=True):
        cells += [f"{sum(column) / len(column):.1f}", str(max(column))]
    return cells


def _kinds(scene: Scene) -> set[Kind]:
    return {block.kind for block in scene.blocks}


def question_card(name: str, scenes_name: str, questions: Sequence[Question], command: str) -> str:
    """Return the Markdown card of questions about the scenes of a set, made by `command`."""
    by_subtask = {s: [q for q in questions if q.subtask == s] for s in SUBTASKS}
    return _card(
        "questions",
        name=name,
        scenes_name=scenes_name,
        command=command,
        count=len(questions),
        scenes=len({question.scene.id for question in questions}),
        rows=[(s, SUBTASK_NAMES[s], *_shares(some)) for s, some in by_subtask.items() if some],
    )


def _shares(questions: Sequence[Question]) -> list[object]:
    """Return numbers of questions, scenes and wordings; shares of the letters, and of the most
    frequent answer if options are texts.
    """
    count = len(questions)
    letters = Counter(question.answer[0] for question in questions)
    texts = Counter(question.options[question.answer[0]] for question in questions)
    most = "" if "<img1>" in texts or "place A" in texts else f"{max(texts.values()) / count:.0%}"
    return [
        *(count, len({one.scene.id for one in questions}), len({one.wording for one in questions})),
        *(f"{letters[i] / count:.0%}" for i in range(len(LETTERS))),
        most,
    ]
