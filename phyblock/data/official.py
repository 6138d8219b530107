"""The official layout: a checkout of the PhyBlock repository, whole or partial, and its questions.

    data/SCENEs_400_Goal_Jsons/NNN.json                 goal scenes
    data/SCENEs_400_Cand_Jsons/NNN_16_cand_blocks.json  candidate sets
    data/SCENEs_400_Goal_and_Cand_Imgs_resized/NNN.png  pictures of both (optional)
    outputs/<model>/NNN.json                            recorded raw replies (optional)

No released file is labelled level 1; the paper's Level-1 columns score the level-2 scenes without
order, so a level-2 scene is read as a scene of levels 1 and 2. Question files in the JSON form of
the paper's appendix A.4 lie in a folder of their own; docs/vqa.md describes them. Names of models
are matched to the rows of the paper's Tables 1 and 2.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from phyblock.data.base import (
    AssemblyTask,
    Dataset,
    QuestionSet,
    QuestionTask,
    read_each,
    read_json,
)
from phyblock.data.questions import Options, scene_of
from phyblock.data.scenes import (
    NAME_ALLOWED,
    Name,
    Position,
    SceneBlocks,
    StoredCandidate,
    Text,
    candidate_set,
    is_name,
    look_faults,
    task_of,
    triple,
)
from phyblock.domain import (
    LETTERS,
    MAX_CANDIDATES,
    SUBTASK_NAMES,
    SUBTASKS,
    CandidateSet,
    Question,
    QuestionPicture,
    Scene,
    Subtask,
    is_picture_option,
)
from phyblock.errors import DataError, Problem
from phyblock.records.line import Fault, Line, checked, refuse, shown, validated, worded

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

    level: Annotated[
        int,
        Field(strict=True, ge=1, le=4),
        worded("is not an allowed number", "an integer 1 to 4"),
    ]
    # Declared layers differ from the longest path in 70 of the 400 released scenes.
    blocks: SceneBlocks
    lookat_pos: Position | None = None
    combined: (
        Annotated[
            str, Field(pattern=_PARENTS), worded("is not allowed", "base scenes joined by '_'")
        ]
        | None
    ) = None

    def scene(self, name: str) -> Scene:
        """Return the goal structure; a base scene is its own parent."""
        levels = (1, 2) if self.level == 2 else (self.level,)
        parents = self.combined.split("_") if self.combined is not None else [name]
        blocks = tuple(stored.block() for stored in self.blocks)
        look_at_m = None if self.lookat_pos is None else triple(self.lookat_pos)
        return Scene(name, levels, blocks, tuple(parents), look_at_m)


class _Numbered(StoredCandidate):
    position: Any = None


def _number_faults(candidates: Sequence[_Numbered]) -> Iterator[Fault]:
    for i, candidate in enumerate(candidates):
        if candidate.position != i + 1:
            allowed = f"{i + 1}: candidates are numbered from 1 in file order"
            yield Fault("is wrong", allowed, shown(candidate.position), (i, "position"))


class _CandidateFile(Line):
    # `position` is the number, from 1, that the picture shows.
    candidates: Annotated[
        tuple[_Numbered, ...],
        Field(min_length=1, max_length=MAX_CANDIDATES),
        checked(_number_faults, look_faults),
    ]


def read_official(root: Path) -> Dataset:
    """Return all scenes of a checkout; DataError with all scenes in which something is wrong."""
    goals = sorted((root / _GOALS).glob("*.json"))
    if not goals:
        allowed = f"a checkout of the official PhyBlock repository, with {_GOALS.as_posix()}/*.json"
        raise DataError(Problem(str(root), "holds no official scenes", allowed=allowed))

    def read(goal: Path) -> AssemblyTask:
        name = goal.stem
        if not is_name(name):
            raise DataError(Problem(str(goal), "is not a name", "the file", name, NAME_ALLOWED))
        path, picture = root / _CANDIDATES / f"{name}_16_cand_blocks.json", root / _PICTURES
        scene = validated(_Goal, read_json(goal), str(goal)).scene(name)
        own = picture / f"{name}.png"
        return task_of(scene, read_candidates(path), str(path), own if own.is_file() else None)

    tasks = read_each(((str(goal), partial(read, goal)) for goal in goals), lambda task: task.key)
    return Dataset("official", root, tuple(tasks))


def read_candidates(path: Path) -> CandidateSet:
    """Return the candidate set in a file; DataError with everything that is wrong in it."""
    file = validated(_CandidateFile, {"candidates": read_json(path)}, str(path))
    return candidate_set(file.candidates)


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
    """Return the exact official text prompt, read out of the recordings that carry it.

    Those recordings show the goal picture and the candidate picture apart, before the text; the
    marks that stood for the pictures are taken off. Where recordings differ, the prompt of most
    models is taken. Raises DataError when no recording carries one, or when there is no most.
    """
    models_by_text: dict[str, list[str]] = {}
    for name, folder in recorded_models(root).items():
        raw = read_json(min(folder.glob("*.json")))
        instruction = raw.get("instruction") if isinstance(raw, dict) else None
        if isinstance(instruction, str):
            models_by_text.setdefault(_PICTURE_MARKS.sub("", instruction), []).append(name)
    where = str(root / _OUTPUTS)
    if not models_by_text:
        message = "no recording carries the official prompt"
        allowed = "recordings with a field 'instruction', such as those of the InternVL models"
        raise DataError(Problem(where, message, "instruction", allowed=allowed))
    ranked = sorted(models_by_text, key=lambda text: -len(models_by_text[text]))
    if len(ranked) > 1 and len(models_by_text[ranked[0]]) == len(models_by_text[ranked[1]]):
        names = "; ".join(", ".join(models) for models in models_by_text.values())
        message = "the recordings carry different prompts, none more often than the others"
        raise DataError(Problem(where, message, "instruction", names))
    return ranked[0]


class _Question(Line, extra="ignore"):
    id: Name
    scene_id: str
    question: Text
    options: Options
    answer: Any


def read_official_questions(folder: Path, scenes: Dataset) -> QuestionSet:
    """Return all questions of a folder, about these scenes; DataError with all that is wrong."""
    files = sorted(folder.glob("*.json"))
    if not files:
        allowed = "question files such as SH.json, one a subtask"
        raise DataError(Problem(str(folder), "holds no question files", allowed=allowed))
    known = {task.scene.id: task.scene for task in scenes.tasks}
    entries = [entry for path in files for entry in _entries(path, known)]
    return QuestionSet(folder.name, folder, tuple(read_each(entries, lambda task: task.key)))


def _entries(path: Path, scenes: Mapping[str, Scene]) -> Iterator[tuple[str, Any]]:
    """Yield the place of each question of a file, and the function that reads it."""
    name = re.sub(r"[^a-z]+", "", path.stem.lower())
    subtask = next((s for s in SUBTASKS if name in (s.lower(), SUBTASK_NAMES[s].replace(" ", ""))),
                   None)  # fmt: skip
    if subtask is None:
        allowed = ", ".join(SUBTASKS)
        raise DataError(Problem(str(path), "names no subtask", "the file", path.stem, allowed))
    raws = read_json(path)
    if not isinstance(raws, list):
        raise DataError(Problem(str(path), "is not an array", allowed="an array of questions"))
    answers = [raw.get("answer") for raw in raws if isinstance(raw, dict)]
    flat = [part for one in answers for part in (one if isinstance(one, list) else [one])]
    indices = {part for part in flat if type(part) is int}
    # Indices count from 0 where some answer is 0, from 1 where some answer is 4.
    base = 0 if 0 in indices else 1 if len(LETTERS) in indices else None
    for number, raw in enumerate(raws):
        where = f"{path}[{number}]"
        if isinstance(raw, dict):
            raw = {"id": f"{subtask.lower()}-{number + 1:03d}", **raw}
        yield where, partial(_read_question, raw, where, subtask, path.parent, scenes, base)


def _read_question(
    raw: Any,
    where: str,
    subtask: Subtask,
    folder: Path,
    scenes: Mapping[str, Scene],
    base: int | None,
) -> QuestionTask:
    line = validated(_Question, raw, where)
    scene = scene_of(line.scene_id, scenes, where)
    wanted = {"scene": f"images/{scene.id}"}
    for letter, option in zip(LETTERS, line.options, strict=True):
        if is_picture_option(option):
            wanted[letter] = f"images/{line.id}/{option.strip('<>')}"
    files: dict[str, Path] = {}
    for label, name in wanted.items():
        paths = [folder / f"{name}{ending}" for ending in (".png", ".jpg", ".jpeg")]
        path = next((path for path in paths if path.is_file()), None)
        if path is not None:
            files[label] = path
        elif label != "scene":
            refuse([Fault("the file is missing", str(paths[0]), "", ("options",))], where)
    drawn = ("scene" not in files and subtask != "OR") * (
        QuestionPicture("scene", scene.blocks, _GOAL_VIEW),
    )
    answer = _answer(line, subtask, base, where)
    question = Question(line.id, subtask, scene, line.question, line.options, answer, drawn)
    return QuestionTask(question, files)


def _answer(line: _Question, subtask: Subtask, base: int | None, where: str) -> tuple[int, ...]:
    """Return the indices from 0 of the right options: letters, texts or indices in the file."""
    is_order = subtask == "OR"
    parts = line.answer if isinstance(line.answer, list) else [line.answer]
    if is_order and isinstance(line.answer, str):
        parts = [letter for letter in line.answer if letter.isalnum()]
    indices: list[int] = []
    for part in parts:
        text = part.strip() if isinstance(part, str) else ""
        letter = text.strip("().").upper()
        if type(part) is int and base is not None and 0 <= part - base < len(LETTERS):
            indices.append(part - base)
        elif letter and letter in tuple(LETTERS):
            indices.append(LETTERS.index(letter))
        elif text in line.options:
            indices.append(line.options.index(text))
    if not len(set(indices)) == len(parts) == (len(LETTERS) if is_order else 1):
        allowed = "a permutation of the options" if is_order else "a letter, option or index"
        if base is None and any(type(part) is int for part in parts):
            allowed = "letters: the indices of this file do not tell whether they begin at 0"
        fault = Fault("is none of the options", allowed, shown(line.answer), ("answer",))
        refuse([fault], where)
    return tuple(indices)


_SPELLINGS: dict[str, tuple[str, ...]] = {
    "Claude-3.5 Haiku": (),
    "Claude-3.5 Sonnet": (),
    "Claude-3.7 Sonnet": ("claude-3-7",),
    "Claude-3.7 Sonnet-Thinking": ("claude-3-7-thinking",),
    "GPT-4o-mini": (),
    "GPT-4o": (),
    "GPT-o1": ("o1",),
    "Gemini-1.5-flash-8b": (),
    "Gemini-1.5-flash": (),
    "Gemini-2.0-flash-lite": ("gemini-2.0-flash-lite-preview",),
    "Gemini-2.0-flash": (),
    "Gemini-2.0-flash-thinking-exp": ("gemini-2.0-flash-thinking",),
    "Qwen-VL-Max": (),
    "InternVL2.5-1B": (),
    "InternVL2.5-8B": (),
    "InternVL2.5-78B": (),
    "Qwen2.5-VL-3B-Instruct": ("qwen2.5-vl-3b",),
    "Qwen2.5-VL-7B-Instruct": ("qwen2.5-vl-7b",),
    "LLaVa-OneVision-0.5B": tuple(
        f"llava-onevision-qwen2-0.5b{end}" for end in ("", "-ov", "-ov-hf")
    ),
    "LLaVa-OneVision-7B": tuple(f"llava-onevision-qwen2-7b{end}" for end in ("", "-ov", "-ov-hf")),
    "Random": (),
    "GPT-4.1": (),
    "GPT-o3": ("o3",),
    "Qwen2.5-VL-72B-Instruct": ("qwen2.5-vl-72b",),
}
"""Rows of the paper's Table 1, then those that Table 2 has beside them; other spellings of each."""
_TOKEN = re.compile(r"[a-z]+|[0-9]+|[^\W_]+")
_MONTH, _DAY = "(?:0[1-9]|1[0-2])", "(?:0[1-9]|[12][0-9]|3[01])"
_DATE = re.compile(rf"(?<![0-9])20[0-9]{{2}}[-_./ ]?{_MONTH}(?:[-_./ ]?{_DAY})?(?![0-9])")
_SHORT_DATE = re.compile(rf"(?<=[-_./ @]){_MONTH}[-_./ ]?{_DAY}$")
_RELEASE = re.compile(r"(?<=[-_./ @])(?:latest|00[0-9])$")


def match_published(name: str) -> str | None:
    """Return the row of Table 1 or 2 that a folder of recordings or a model name stands for.

    Case, separators, release dates and folders before the last slash make no difference; else all
    tokens (runs of letters and of digits) must be those of a known spelling. None where the name is
    unknown or could mean more than one row: "claude-3-5" names two models, "gemini-2.0" four.
    """
    return _ROWS.get(_tokens(name))


def _tokens(name: str) -> tuple[str, ...]:
    bare = name.strip().rstrip("/").rpartition("/")[2].lower()
    bare = _DATE.sub(" ", bare).rstrip("-_. @")
    for pattern in (_RELEASE, _SHORT_DATE, _RELEASE):
        bare = pattern.sub("", bare).rstrip("-_. @")
    return tuple(_TOKEN.findall(bare))


_ROWS = {_tokens(one): row for row, more in _SPELLINGS.items() for one in (row, *more)}
