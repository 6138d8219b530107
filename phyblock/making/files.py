"""Sets as folders: lines, a card, the version, checksums."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from phyblock.data import VERSION_FILE
from phyblock.data.questions import StoredQuestion
from phyblock.data.scenes import StoredScene
from phyblock.domain.question import LETTERS, SUBTASK_NAMES, SUBTASKS, Question
from phyblock.domain.scene import CandidateSet, Scene
from phyblock.errors import Problem
from phyblock.files import atomic_write, check_free, make_folder, read_text, writing
from phyblock.making.checks import LEVEL_LIMITS
from phyblock.making.scenes.sketch import PALETTES, Palette
from phyblock.sim.engine import other_engine
from phyblock.stable import hex_digest

SUMS_FILE = "SHA256SUMS"
SCENE_FILES = ("README.md", "scenes.jsonl", VERSION_FILE)
QUESTION_FILES = ("CARD.md", "questions.jsonl", VERSION_FILE)
"""Card, lines and version of a set."""
SCENE_SET_VERSION = 2
"""Counts what makes other scenes or candidate sets out of the same seed: 2 offers distractors as
often as goals need them, and shows at least 3 % of every block's outline.
"""
QUESTION_SET_VERSION = 5
"""Raised whenever questions of a name ask something else, so that no results are mixed."""
_QUANTITIES = ("blocks", "types", "colors", "layers")
_Tasks = Sequence[tuple[Scene, CandidateSet]]


def check_out(folder: Path, names: Sequence[str]) -> None:
    """Raise StoreError when the folder holds files of these names already."""
    check_free([folder / name for name in (*names, SUMS_FILE)], "give another --out")


def write_scenes(folder: Path, tasks: _Tasks, card: str) -> None:
    """Write scenes with their candidate sets, sorted by id; StoreError where it cannot."""
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
    """Checksums of files, as `sha256sum -c` reads them."""
    return "".join(f"{hex_digest((folder / name).read_bytes())}  {name}\n" for name in names)


def check_sums(folder: Path) -> tuple[int, tuple[Problem, ...]]:
    """The number of files that `SHA256SUMS` names, and those that are missing or changed."""
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


def _card(template: str, /, **fields: object) -> str:
    """A card with its fields filled."""
    text = (Path(__file__).parent / "cards" / f"{template}.md").read_text(encoding="utf-8")
    return text.format(**fields) if fields else text


def scene_card(name: str, tasks: _Tasks, command: str, palette: Palette) -> str:
    """Return the Markdown card of scenes that `command` generated."""
    by_level: dict[int, list[Scene]] = {}
    for scene, _ in tasks:
        for level in scene.levels:
            by_level.setdefault(level, []).append(scene)
    levels = dict(sorted(by_level.items()))
    base, sizes = sum(_is_base(scene) for scene, _ in tasks), {len(offered) for _, offered in tasks}
    owner = {"kit": "the official kit's", "full": "all"}[palette]
    limits = (
        f"    level {level}: {one.least_blocks} to {one.most_blocks} blocks, "
        f"up to {one.most_layers} layers"
        for level, one in LEVEL_LIMITS.items()
        if level in levels
    )
    text = _card(
        "scenes",
        name=name,
        count=len(tasks),
        levels=", ".join(f"{len(some)} of level {level}" for level, some in levels.items()),
        shared=sum(len(scene.levels) > 1 for scene, _ in tasks),
        base=base,
        varied=len(tasks) - base,
        command=command,
        simulators=f", by {engine}" if (engine := other_engine()) else "",
        palette=f"{owner} {len(PALETTES[palette])} pairs of type and color",
        version=SCENE_SET_VERSION,
        limits="\n".join(limits),
        heads=" | ".join(f"{quantity}, mean | most" for quantity in _QUANTITIES),
        rules="|".join("---|---" for _ in _QUANTITIES),
        rows="\n".join(_scene_row(level, some) for level, some in levels.items()),
        candidates=" to ".join(map(str, sorted({min(sizes), max(sizes)}))),
    )
    return text + _card("scenes_file")


def completed_card(name: str, count: int, command: str) -> str:
    """Return the Markdown card of scenes that were given by their positions."""
    text = _card("completed", name=name, count=count, command=command)
    return text + _card("scenes_file")


def _is_base(scene: Scene) -> bool:
    return scene.parents == (scene.id,)


def _scene_row(level: int, scenes: Sequence[Scene]) -> str:
    counts = [
        (
            len(scene),
            len({block.type for block in scene.blocks}),
            len({block.color for block in scene.blocks}),
            max(scene.graph.layers),
        )
        for scene in scenes
    ]
    cells = [str(level), str(len(scenes)), str(sum(map(_is_base, scenes)))]
    for column in zip(*counts, strict=True):
        cells += [f"{sum(column) / len(column):.1f}", str(max(column))]
    return f"| {' | '.join(cells)} |"


def question_card(name: str, scenes_name: str, questions: Sequence[Question], command: str) -> str:
    """Return the Markdown card of questions about the scenes of a set, made by `command`."""
    by_subtask = [[q for q in questions if q.subtask == subtask] for subtask in SUBTASKS]
    return _card(
        "questions",
        name=name,
        scenes_name=scenes_name,
        count=len(questions),
        scenes=len({question.scene.id for question in questions}),
        subtasks=sum(map(bool, by_subtask)),
        made_by=command,
        simulators=f", with {engine}," if (engine := other_engine()) else "",
        rows="\n".join(map(_question_row, filter(None, by_subtask))),
    )


def _question_row(questions: Sequence[Question]) -> str:
    subtask, count = questions[0].subtask, len(questions)
    letters = Counter(question.answer[0] for question in questions)
    texts = Counter(question.options[question.answer[0]] for question in questions)
    scenes = {question.scene.id for question in questions}
    wordings = {question.wording for question in questions}
    shares = [f"{letters[i] / count:.0%}" for i in range(len(LETTERS))]
    most = "" if "<img1>" in texts or "place A" in texts else f"{max(texts.values()) / count:.0%}"
    cells = [subtask, SUBTASK_NAMES[subtask], count, len(scenes), len(wordings), *shares, most]
    return f"| {' | '.join(map(str, cells))} |"
