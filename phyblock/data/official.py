"""The official layout: a checkout of the PhyBlock repository, whole or partial, and its questions.

    data/SCENEs_400_Goal_Jsons/NNN.json                 goal scenes
    data/SCENEs_400_Cand_Jsons/NNN_16_cand_blocks.json  candidate sets
    data/SCENEs_400_Goal_and_Cand_Imgs_resized/NNN.png  pictures of both (optional)
    outputs/<model>/NNN.json                            recorded raw replies (optional)

No released file is labelled level 1; the paper's Level-1 columns score the level-2 scenes without
order, so a level-2 scene is read as a scene of levels 1 and 2. Question files have the JSON form of
the paper's appendix A.4 (docs/vqa.md). Names of models are matched to the rows of Tables 1 and 2.
"""

from __future__ import annotations

import functools
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from phyblock.config.validation import Fault, checked, form
from phyblock.config.yaml import shown
from phyblock.data import scenes
from phyblock.data.base import Dataset, QuestionSet, QuestionTask, read_data, read_each
from phyblock.data.questions import Options
from phyblock.data.scenes import CandidateList, Name, Order, Position, SceneBlocks, StoredCandidate
from phyblock.domain.question import (
    LETTERS,
    SUBTASK_NAMES,
    SUBTASKS,
    Question,
    QuestionPicture,
    Subtask,
    is_picture_option,
)
from phyblock.domain.scene import AssemblyTask, CandidateSet, Scene
from phyblock.errors import DataError, Problem
from phyblock.files import read_own_yaml
from phyblock.records.record import Line, decode

_GOALS = Path("data", "SCENEs_400_Goal_Jsons")
_CANDIDATES = Path("data", "SCENEs_400_Cand_Jsons")
_PICTURES = Path("data", "SCENEs_400_Goal_and_Cand_Imgs_resized")
_OUTPUTS = Path("outputs")
# <IMG_CONTEXT> of InternVL, <|image_pad|> of Qwen, <image> of LLaVA
_PICTURE_MARKS = re.compile(r"\A(?:\s*<\|?[A-Za-z_]{1,30}\|?>)+")
_PARENTS = r"^[A-Za-z0-9][A-Za-z0-9.-]{0,99}(_[A-Za-z0-9][A-Za-z0-9.-]{0,99})*$"
_GOAL_VIEW = (45.0, 22.0)


class _Goal(Line, extra="ignore"):
    """A goal file; other fields are not read."""

    level: Annotated[int, Field(strict=True, ge=1, le=4)]
    # Declared layers differ from the longest path in 70 of the 400 released scenes.
    blocks: SceneBlocks
    lookat_pos: Position | None = None
    combined: Annotated[str, form(_PARENTS, "base scenes joined by '_'")] | None = None

    def scene(self, name: str) -> Scene:
        """Return the goal structure; a base scene is its own parent."""
        levels = (1, 2) if self.level == 2 else (self.level,)
        parents = self.combined.split("_") if self.combined is not None else [name]
        blocks = tuple(stored.block() for stored in self.blocks)
        return Scene(name, levels, blocks, tuple(parents), self.lookat_pos)


class _Numbered(StoredCandidate):
    position: Order
    """Its number, from 1, which the picture shows."""


def _number_faults(candidates: Sequence[_Numbered]) -> Iterator[Fault]:
    for i, candidate in enumerate(candidates, 1):
        if candidate.position != i:
            allowed = f"{i}: candidates are numbered from 1 in file order"
            yield Fault("is wrong", allowed, str(candidate.position), (i - 1, "position"))


_CandidateFile = Annotated[CandidateList[_Numbered], checked(_number_faults)]


def read_official(root: Path) -> Dataset:
    """Return all scenes of a checkout. Raises DataError with the problems of all scenes."""
    goals = sorted((root / _GOALS).glob("*.json"))
    if not goals:
        allowed = f"a checkout of the official PhyBlock repository, with {_GOALS.as_posix()}/*.json"
        raise DataError(Problem(str(root), "holds no official scenes", allowed=allowed))
    adapter = TypeAdapter(_Goal)

    def read(goal: Path, where: str) -> AssemblyTask:
        name, picture = goal.stem, root / _PICTURES / f"{goal.stem}.png"
        if not re.fullmatch(scenes.NAME, name):
            raise DataError(Problem(where, "is not a name", "the file", name, scenes.NAME_ALLOWED))
        scene = decode(adapter, read_data(goal), where, _Goal).scene(name)
        path = root / _CANDIDATES / f"{name}_16_cand_blocks.json"
        own = picture if picture.is_file() else None
        return scenes.task_of(scene, read_candidates(path), str(path), own)

    return Dataset("official", root, read_each(((str(goal), goal) for goal in goals), read))


def read_candidates(path: Path) -> CandidateSet:
    """Return the candidate set in a file. Raises DataError with all its problems."""
    return scenes.candidate_set(decode(TypeAdapter(_CandidateFile), read_data(path), str(path)))


def recorded_models(root: Path) -> dict[str, Path]:
    """Return the folders of recorded replies in a checkout, by name, in name order."""
    outputs = root / _OUTPUTS
    paths = sorted(outputs.iterdir()) if outputs.is_dir() else []
    folders = {path.name: path for path in paths if path.is_dir() and any(path.glob("*.json"))}
    if not folders:
        allowed = "a checkout with outputs/<model>/NNN.json"
        raise DataError(Problem(str(outputs), "holds no recorded replies", allowed=allowed))
    return folders


def official_prompt(root: Path) -> str:
    """Return the exact official text prompt, from the recordings that include it.

    The markers of the two pictures before the text are removed. If recordings differ, the prompt of
    the most models is used. Raises DataError if there is none, or none is the most frequent.
    """
    texts: Counter[str] = Counter()
    for folder in recorded_models(root).values():
        path = min(folder.glob("*.json"))
        raw = decode(TypeAdapter(Any), read_data(path), str(path))
        instruction = raw.get("instruction") if isinstance(raw, dict) else None
        if isinstance(instruction, str):
            texts[_PICTURE_MARKS.sub("", instruction)] += 1
    first, second = [*texts.most_common(2), ("", 0), ("", 0)][:2]
    if first[1] > second[1]:
        return first[0]
    message = "no recording carries the official prompt"
    if texts:
        message = "the recordings carry different prompts, none more often than the others"
    allowed = "recordings with a field 'instruction', such as those of the InternVL models"
    raise DataError(Problem(str(root / _OUTPUTS), message, "instruction", allowed=allowed))


class _Question(Line, extra="ignore"):
    id: Name | None = None
    scene_id: str
    question: scenes.Text
    options: Options
    answer: str | tuple[str, ...]


def read_official_questions(folder: Path, dataset: Dataset) -> QuestionSet:
    """Return all questions of a folder, about this data set. Raises DataError with all problems."""
    sets = sorted(folder.glob("*.json"))
    if not sets:
        allowed = "question files such as SH.json, one a subtask"
        raise DataError(Problem(str(folder), "holds no question files", allowed=allowed))
    names = {name: s for s in SUBTASKS for name in (s.lower(), SUBTASK_NAMES[s].replace(" ", ""))}
    items = []
    for path in sets:
        subtask = names.get(re.sub(r"[^a-z]+", "", path.stem.lower()))
        if subtask is None:
            allowed = ", ".join(SUBTASKS)
            raise DataError(Problem(str(path), "names no subtask", "the file", path.stem, allowed))
        lines = decode(TypeAdapter(tuple[_Question, ...]), read_data(path), str(path))
        for n, line in enumerate(lines):
            name = line.id or f"{subtask.lower()}-{n + 1:03d}"
            items.append((f"{path}[{n}]", (name, subtask, line)))

    def read(item: tuple[str, Subtask, _Question], where: str) -> QuestionTask:
        name, subtask, line = item
        scene = dataset.task(line.scene_id, where, "scene_id").scene
        # The picture of the scene may be missing.
        wanted = {"scene": line.scene_id}
        for letter, option in zip(LETTERS, line.options, strict=True):
            wanted |= {letter: f"{name}/{option.strip('<>')}"} if is_picture_option(option) else {}
        files: dict[str, Path] = {}
        for label, picture in wanted.items():
            path = folder / "images" / f"{picture}.png"
            if path.is_file():
                files[label] = path
            elif label != "scene":
                raise DataError(Problem(where, "the file is missing", "options", allowed=str(path)))
        # The right options are given as letters or as the options themselves.
        is_order = subtask == "OR"
        parts = [line.answer] if isinstance(line.answer, str) else list(line.answer)
        if is_order and isinstance(line.answer, str):
            parts = [letter for letter in line.answer if letter.isalnum()]
        letters = {letter: n for n, letter in enumerate(LETTERS)}
        places = {option: n for n, option in enumerate(line.options)}
        texts = map(str.strip, parts)
        found = [letters.get(text.strip("().").upper(), places.get(text)) for text in texts]
        answer = tuple(n for n in found if n is not None)
        if not len(set(answer)) == len(parts) == (len(LETTERS) if is_order else 1):
            allowed = "all four letters or options" if is_order else "a letter or an option"
            message = "is none of the options"
            raise DataError(Problem(where, message, "answer", shown(line.answer), allowed))
        # The scene is drawn where it is not among the files.
        drawn = QuestionPicture("scene", scene.blocks, _GOAL_VIEW)
        pictures = () if "scene" in files or is_order else (drawn,)
        question = Question(name, subtask, scene, line.question, line.options, answer, pictures)
        return QuestionTask(question, files)

    return QuestionSet(folder.name, folder, read_each(items, read))


_TOKEN = re.compile(r"[a-z]+|[0-9]+|[^\W_]+")
_MONTH, _DAY = "(?:0[1-9]|1[0-2])", "(?:0[1-9]|[12][0-9]|3[01])"
_DATE = re.compile(rf"(?<![0-9])20[0-9]{{2}}[-_./ ]?{_MONTH}(?:[-_./ ]?{_DAY})?(?![0-9])")
_SHORT_DATE = re.compile(rf"(?<=[-_./ @]){_MONTH}[-_./ ]?{_DAY}$")
_RELEASE = re.compile(r"(?<=[-_./ @])(?:latest|00[0-9])$")


def match_published(name: str) -> str | None:
    """Return the row of Table 1 or 2 for a folder of recordings or a model name.

    Case, separators, release dates and folders before the last slash are ignored; apart from that,
    all tokens (runs of letters and of digits) must match a known spelling. None if the name is
    unknown or ambiguous: "claude-3-5" matches two models, "gemini-2.0" four.
    """
    return _rows().get(_tokens(name))


@functools.cache
def _rows() -> dict[tuple[str, ...], str]:
    rows = read_own_yaml(Path(__file__).with_name("published.yaml"))
    return {_tokens(name): row for row, others in rows.items() for name in (row, *others)}


def _tokens(name: str) -> tuple[str, ...]:
    bare = name.strip().rstrip("/").rpartition("/")[2].lower()
    bare = _DATE.sub(" ", bare).rstrip("-_. @")
    for pattern in (_RELEASE, _SHORT_DATE, _RELEASE):
        bare = pattern.sub("", bare).rstrip("-_. @")
    return tuple(_TOKEN.findall(bare))
