"""The official layout: a checkout of the PhyBlock repository, whole or partial, and its questions.

    data/SCENEs_400_Goal_Jsons/NNN.json                 goal scenes
    data/SCENEs_400_Cand_Jsons/NNN_16_cand_blocks.json  candidate sets
    data/SCENEs_400_Goal_and_Cand_Imgs_resized/NNN.png  pictures of both (optional)
    outputs/<model>/NNN.json                            recorded raw replies (optional)

No released file is labelled level 1; the paper's Level-1 columns score the level-2 scenes without
order, so a level-2 scene is read as a scene of levels 1 and 2. Question files in the JSON form of
the paper's appendix A.4 are in a separate folder; docs/vqa.md describes them. Names of models are
matched to the rows of the paper's Tables 1 and 2.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter

from phyblock.config.validation import Fault, checked, form
from phyblock.config.yaml import shown
from phyblock.data.base import Dataset, QuestionSet, QuestionTask, read_data, read_each, report
from phyblock.data.questions import Options, scene_of
from phyblock.data.scenes import (
    NAME,
    NAME_ALLOWED,
    Name,
    Order,
    Position,
    SceneBlocks,
    StoredCandidate,
    Text,
    candidate_set,
    look_faults,
    task_of,
    triple,
)
from phyblock.domain.question import (
    LETTERS,
    SUBTASK_NAMES,
    SUBTASKS,
    Question,
    QuestionPicture,
    Subtask,
    is_picture_option,
)
from phyblock.domain.scene import MAX_CANDIDATES, AssemblyTask, CandidateSet, Scene
from phyblock.errors import DataError, Problem
from phyblock.files import load_json
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
        look_at_m = None if self.lookat_pos is None else triple(self.lookat_pos)
        return Scene(name, levels, blocks, tuple(parents), look_at_m)


class _Numbered(StoredCandidate):
    position: Order
    """Its number, from 1, which the picture shows."""


def _number_faults(candidates: Sequence[_Numbered]) -> Iterator[Fault]:
    for i, candidate in enumerate(candidates, 1):
        if candidate.position != i:
            allowed = f"{i}: candidates are numbered from 1 in file order"
            yield Fault("is wrong", allowed, str(candidate.position), (i - 1, "position"))


_CandidateFile = Annotated[
    tuple[_Numbered, ...],
    Field(min_length=1, max_length=MAX_CANDIDATES),
    checked(_number_faults),
    checked(look_faults),
]


def read_official(root: Path) -> Dataset:
    """Return all scenes of a checkout. Raises DataError with the problems of all scenes."""
    goals = sorted((root / _GOALS).glob("*.json"))
    if not goals:
        allowed = f"a checkout of the official PhyBlock repository, with {_GOALS.as_posix()}/*.json"
        raise DataError(Problem(str(root), "holds no official scenes", allowed=allowed))

    adapter = TypeAdapter(_Goal)

    def read(goal: Path) -> AssemblyTask:
        name, picture = goal.stem, root / _PICTURES / f"{goal.stem}.png"
        if not re.fullmatch(NAME, name):
            raise DataError(Problem(str(goal), "is not a name", "the file", name, NAME_ALLOWED))
        scene = decode(adapter, read_data(goal), str(goal), _Goal).scene(name)
        path = root / _CANDIDATES / f"{name}_16_cand_blocks.json"
        own = picture if picture.is_file() else None
        return task_of(scene, read_candidates(path), str(path), own)

    tasks = read_each(((str(goal), partial(read, goal)) for goal in goals), lambda task: task.key)
    return Dataset("official", root, tuple(tasks))


def read_candidates(path: Path) -> CandidateSet:
    """Return the candidate set in a file. Raises DataError with all its problems."""
    return candidate_set(decode(TypeAdapter(_CandidateFile), read_data(path), str(path)))


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

    Those recordings have the goal picture and the candidate picture before the text; the markers of
    the pictures are removed. If recordings differ, the prompt of the most models is used. Raises
    DataError if no recording includes one, or none is the most frequent.
    """
    texts: Counter[str] = Counter()
    for folder in recorded_models(root).values():
        path = min(folder.glob("*.json"))
        try:
            raw = load_json(read_data(path))
        except ValueError as error:
            raise DataError(Problem(str(path), f"is not JSON: {error}")) from error
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
    question: Text
    options: Options
    answer: str | tuple[str, ...]


def read_official_questions(folder: Path, scenes: Dataset) -> QuestionSet:
    """Return all questions of a folder, about these scenes. Raises DataError with all problems."""
    files = sorted(folder.glob("*.json"))
    if not files:
        allowed = "question files such as SH.json, one a subtask"
        raise DataError(Problem(str(folder), "holds no question files", allowed=allowed))
    known = {task.scene.id: task.scene for task in scenes.tasks}
    adapter: TypeAdapter[tuple[_Question, ...]] = TypeAdapter(tuple[_Question, ...])
    names = {name: s for s in SUBTASKS for name in (s.lower(), SUBTASK_NAMES[s].replace(" ", ""))}
    entries = []
    for path in files:
        subtask = names.get(re.sub(r"[^a-z]+", "", path.stem.lower()))
        if subtask is None:
            allowed = ", ".join(SUBTASKS)
            raise DataError(Problem(str(path), "names no subtask", "the file", path.stem, allowed))
        lines = decode(adapter, read_data(path), str(path))
        for n, line in enumerate(lines):
            read = partial(_question_task, line, n, f"{path}[{n}]", subtask, folder, known)
            entries.append((f"{path}[{n}]", read))
    return QuestionSet(folder.name, folder, tuple(read_each(entries, lambda task: task.key)))


def _question_task(
    line: _Question,
    n: int,
    where: str,
    subtask: Subtask,
    folder: Path,
    scenes: Mapping[str, Scene],
) -> QuestionTask:
    name = line.id or f"{subtask.lower()}-{n + 1:03d}"
    scene = scene_of(line.scene_id, scenes, where)
    wanted = {"scene": f"images/{scene.id}"}
    for letter, option in zip(LETTERS, line.options, strict=True):
        if is_picture_option(option):
            wanted[letter] = f"images/{name}/{option.strip('<>')}"
    files: dict[str, Path] = {}
    for label, picture in wanted.items():
        paths = [folder / f"{picture}{ending}" for ending in (".png", ".jpg", ".jpeg")]
        path = next((path for path in paths if path.is_file()), None)
        if path is not None:
            files[label] = path
        elif label != "scene":
            report([Fault("the file is missing", str(paths[0]), at=("options",))], where)
    is_order = subtask == "OR"
    parts = [line.answer] if isinstance(line.answer, str) else list(line.answer)
    if is_order and isinstance(line.answer, str):
        parts = [letter for letter in line.answer if letter.isalnum()]
    answer: list[int] = []
    for text in map(str.strip, parts):
        letter = text.strip("().").upper()
        if letter in tuple(LETTERS):
            answer.append(LETTERS.index(letter))
        elif text in line.options:
            answer.append(line.options.index(text))
    if not len(set(answer)) == len(parts) == (len(LETTERS) if is_order else 1):
        allowed = "all four letters or options" if is_order else "a letter or an option"
        fault = Fault("is none of the options", allowed, shown(line.answer), ("answer",))
        report([fault], where)
    drawn = ("scene" not in files and not is_order) * (
        QuestionPicture("scene", scene.blocks, _GOAL_VIEW),
    )
    question = Question(name, subtask, scene, line.question, line.options, tuple(answer), drawn)
    return QuestionTask(question, files)


_PUBLISHED = (
    "Claude-3.5 Haiku", "Claude-3.5 Sonnet", "Claude-3.7 Sonnet", "Claude-3.7 Sonnet-Thinking",
    "GPT-4o-mini", "GPT-4o", "GPT-o1", "Gemini-1.5-flash-8b", "Gemini-1.5-flash",
    "Gemini-2.0-flash-lite", "Gemini-2.0-flash", "Gemini-2.0-flash-thinking-exp", "Qwen-VL-Max",
    "InternVL2.5-1B", "InternVL2.5-8B", "InternVL2.5-78B", "Qwen2.5-VL-3B-Instruct",
    "Qwen2.5-VL-7B-Instruct", "LLaVa-OneVision-0.5B", "LLaVa-OneVision-7B", "Random", "GPT-4.1",
    "GPT-o3", "Qwen2.5-VL-72B-Instruct",
)  # fmt: skip
"""Rows of the paper's Table 1, then those only in Table 2."""
_SPELLINGS = {
    "claude-3-7": "Claude-3.7 Sonnet",
    "claude-3-7-thinking": "Claude-3.7 Sonnet-Thinking",
    "o1": "GPT-o1",
    "o3": "GPT-o3",
    "gemini-2.0-flash-lite-preview": "Gemini-2.0-flash-lite",
    "gemini-2.0-flash-thinking": "Gemini-2.0-flash-thinking-exp",
    **{f"qwen2.5-vl-{size}": f"Qwen2.5-VL-{size.upper()}-Instruct" for size in ("3b", "7b", "72b")},
    **{
        f"llava-onevision-qwen2-{size}{end}": f"LLaVa-OneVision-{size.upper()}"
        for size in ("0.5b", "7b")
        for end in ("", "-ov", "-ov-hf")
    },
}
"""Other spellings of rows."""
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
    return _ROWS.get(_tokens(name))


def _tokens(name: str) -> tuple[str, ...]:
    bare = name.strip().rstrip("/").rpartition("/")[2].lower()
    bare = _DATE.sub(" ", bare).rstrip("-_. @")
    for pattern in (_RELEASE, _SHORT_DATE, _RELEASE):
        bare = pattern.sub("", bare).rstrip("-_. @")
    return tuple(_TOKEN.findall(bare))


_ROWS = {
    **{_tokens(row): row for row in _PUBLISHED},
    **{_tokens(name): row for name, row in _SPELLINGS.items()},
}
