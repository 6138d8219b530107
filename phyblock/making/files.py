"""Sets as folders: lines, a card, the version, checksums, and commitments to later sets."""

from __future__ import annotations

import secrets
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from pydantic import Field, TypeAdapter

import phyblock
from phyblock import files
from phyblock.data.base import VERSION_FILE, read_data
from phyblock.data.lookup import find_data_set
from phyblock.data.questions import StoredQuestion
from phyblock.data.scenes import SCENES_FILE, StoredScene
from phyblock.domain.question import LETTERS, SUBTASK_NAMES, SUBTASKS, Question
from phyblock.domain.scene import AssemblyTask, Scene
from phyblock.errors import DataError, Problem
from phyblock.making.checks import LEVEL_LIMITS
from phyblock.making.scenes.sketch import PALETTES, Palette
from phyblock.records.record import Line, decode
from phyblock.sim.engine import described_engine, other_engine
from phyblock.text import hex_digest

SUMS_FILE = "SHA256SUMS"
SCENE_FILES = ("README.md", "scenes.jsonl", VERSION_FILE)
QUESTION_FILES = ("CARD.md", "questions.jsonl", VERSION_FILE)
"""Card, lines and version of a set."""
PICTURES = "pictures"
"""Folder of the pictures of a set of questions that stores them."""
SCENE_SET_VERSION = 5
"""Increased whenever the same seed makes other scenes or candidate sets."""
QUESTION_SET_VERSION = 12
"""Increased whenever questions with the same name change, so that results are never mixed."""


def check_out(folder: Path, names: Sequence[str]) -> None:
    """Raise StoreError if the folder already holds files of these names."""
    files.check_free([folder / name for name in (*names, SUMS_FILE)], "give another --out")


def write_scenes(folder: Path, tasks: Sequence[AssemblyTask], card: str) -> None:
    """Write scenes with their candidate sets, sorted by id. Raises StoreError if that fails."""
    by_id = sorted(tasks, key=lambda task: task.key)
    lines = (StoredScene.of(task.scene, task.candidates) for task in by_id)
    _write(folder, SCENE_FILES, card, lines, SCENE_SET_VERSION)


def write_questions(
    folder: Path,
    questions: Sequence[Question],
    originals: Mapping[str, Scene],
    card: str,
    pictures: Iterable[str] = (),
) -> None:
    """Write questions in order; `originals` are stored scenes, `pictures` existing file names."""
    lines = (StoredQuestion.of(q, originals[q.scene.id]) for q in questions)
    _write(folder, QUESTION_FILES, card, lines, QUESTION_SET_VERSION, pictures)


def _write(
    folder: Path,
    names: Sequence[str],
    card: str,
    lines: Iterable[Line],
    version: int,
    pictures: Iterable[str] = (),
) -> None:
    texts = (card, "".join(f"{line.as_json()}\n" for line in lines), f"{version}\n")
    check_out(folder, names)
    files.make_folder(folder)
    with files.writing(folder):
        for name, text in zip(names, texts, strict=True):
            files.atomic_write(folder / name, text)
        files.atomic_write(folder / SUMS_FILE, sums_text(folder, (*names, *pictures)))


def sums_text(folder: Path, names: Iterable[str]) -> str:
    """Return checksums of files in the format of `sha256sum -c`."""
    return "".join(f"{files.digest_of_file(folder / name)}  {name}\n" for name in names)


def check_sums(folder: Path) -> tuple[int, tuple[Problem, ...]]:
    """Return the number of files in `SHA256SUMS`, and problems of missing or changed ones."""
    path = folder / SUMS_FILE
    if not path.is_file():
        return 1, (Problem(str(path), "is missing"),)
    lines = files.read_text(path).splitlines()
    wrong = []
    for line in lines:
        digest, _, name = line.partition("  ")
        if (found := files.digest_of_file(folder / name)) != digest:
            message = f"differs from its checksum in {SUMS_FILE}" if found else "is missing"
            wrong.append(Problem(str(folder / name), message))
    return len(lines), tuple(wrong)


# Cards


def card(template: str, /, **facts: object) -> str:
    """Return a Markdown card from a Jinja template in `cards/`, filled with facts."""
    loader = FileSystemLoader(Path(__file__).parent / "cards")
    environment = Environment(
        loader=loader, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    text = environment.get_template(f"{template}.md").render(simulator=other_engine(), **facts)
    return f"{text}\n"


def scene_card(
    name: str, tasks: Sequence[AssemblyTask], command: str, palette: Palette, rejected: int
) -> str:
    """Return the Markdown card of scenes that `command` generated."""
    scenes, sizes = [task.scene for task in tasks], {len(task.candidates) for task in tasks}

    def bases(some: Iterable[Scene]) -> int:
        return sum(scene.parents == (scene.id,) for scene in some)

    def row(some: Sequence[Scene]) -> list[object]:
        """Return numbers of scenes and base scenes, and mean and maximum of their contents."""
        cells: list[object] = [len(some), bases(some)]
        for counts in (
            [len(scene) for scene in some],
            [len({block.type for block in scene.blocks}) for scene in some],
            [len({block.color for block in scene.blocks}) for scene in some],
            [max(scene.graph.layers) for scene in some],
        ):
            cells += [f"{sum(counts) / len(counts):.1f}", max(counts)]
        return cells

    by_level = {n: [one for one in scenes if n in one.levels] for n in LEVEL_LIMITS}
    return card(
        "scenes",
        name=name,
        command=command,
        version=SCENE_SET_VERSION,
        rejected=rejected,
        count=len(scenes),
        shared=sum(len(scene.levels) > 1 for scene in scenes),
        base=bases(scenes),
        levels=[(n, LEVEL_LIMITS[n], row(some)) for n, some in by_level.items() if some],
        palette=palette,
        pairs=len(PALETTES[palette]),
        candidates=" to ".join(map(str, sorted({min(sizes), max(sizes)}))),
    )


def question_card(
    name: str,
    scenes_name: str,
    questions: Sequence[Question],
    command: str,
    *,
    has_pictures: bool = False,
) -> str:
    """Return the Markdown card of questions about the scenes of a set, made by `command`."""
    rows = []
    for subtask in SUBTASKS:
        some = [question for question in questions if question.subtask == subtask]
        if not some:
            continue
        counts = (len(some), len({q.scene.id for q in some}), len({q.wording for q in some}))
        letters = Counter(question.answer[0] for question in some)
        texts = Counter(question.options[question.answer[0]] for question in some)
        is_text = texts.keys().isdisjoint(("<img1>", "place A"))
        most = f"{max(texts.values()) / len(some):.0%}" if is_text else ""
        shares = (f"{letters[i] / len(some):.0%}" for i in range(len(LETTERS)))
        rows.append((subtask, SUBTASK_NAMES[subtask], *counts, *shares, most))
    return card(
        "questions",
        name=name,
        scenes_name=scenes_name,
        command=command,
        count=len(questions),
        scenes=len({question.scene.id for question in questions}),
        rows=rows,
        pictures=PICTURES if has_pictures else "",
    )


# Seasons: sets that nobody can choose or know in advance, and that anyone can make again. A maker
# publishes the digests of a secret and of the code, then waits for a value that nobody controls,
# such as that of a beacon. The seed of the set is a digest of the secret and the value.

_Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class Commitment(Line, extra="forbid"):
    """Everything that is fixed before a season; to be published."""

    secret_sha256: _Digest
    code_sha256: _Digest
    engine: str
    arguments: str
    """Arguments of `phyblock scenes generate`, except seed and folder."""
    public: str
    """The later public value to use, in words."""

    @classmethod
    def now(cls, secret: str, arguments: str, public: str) -> Commitment:
        """Return the commitment to a secret with today's code and engine."""
        return cls(
            secret_sha256=hex_digest(secret),
            code_sha256=code_digest(),
            engine=described_engine(),
            arguments=arguments,
            public=public,
        )


def commit_season(folder: Path, arguments: str, public: str) -> tuple[Path, Path]:
    """Write a new secret and the commitment to it, and return the two files."""
    paths = (folder / "secret.txt", folder / "commitment.json")
    files.check_free(paths, "give another --out")
    secret = secrets.token_hex(32)
    commitment = Commitment.now(secret, arguments, public)
    files.make_folder(folder)
    with files.writing(folder):
        files.atomic_write(paths[0], f"{secret}\n")
        paths[0].chmod(0o600)
        files.atomic_write(paths[1], f"{commitment.as_json()}\n")
    return paths


def reveal_season(commitment: Path, secret: Path, public: str) -> tuple[str, int]:
    """Return a season's arguments and seed. Raises DataError for another secret, code or engine."""
    where = str(commitment)
    committed = decode(TypeAdapter(Commitment), read_data(commitment), where, Commitment)
    revealed = read_data(secret).decode("ascii", "replace").strip()
    found = Commitment.now(revealed, committed.arguments, committed.public)
    problems = [
        Problem(where, "is not what was committed to", field, getattr(found, field), meant)
        for field, meant in committed
        if getattr(found, field) != meant
    ]
    if problems:
        raise DataError(problems)
    return committed.arguments, int(hex_digest(f"{revealed}\n{public}")[:16], 16)


def code_digest() -> str:
    """Return the digest of the package's own files and the built-in scenes, with their names."""
    root = Path(phyblock.__file__).parent
    own = (path for path in root.rglob("*") if path.suffix in (".py", ".md", ".yaml"))
    named = sorted((path.relative_to(root).as_posix(), path) for path in own)
    named = [(name, path) for name, path in named if not name.startswith("bundled/")]
    named += [(name, find_data_set(name) / SCENES_FILE) for name in files.bundled_sets(SCENES_FILE)]
    return hex_digest("".join(f"{hex_digest(path.read_bytes())} {name}\n" for name, path in named))
