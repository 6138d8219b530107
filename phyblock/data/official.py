"""The official layout: a checkout of the PhyBlock repository, whole or partial, and its questions.

    data/SCENEs_400_Goal_Jsons/NNN.json                 goal scenes
    data/SCENEs_400_Cand_Jsons/NNN_16_cand_blocks.json  candidate sets
    data/SCENEs_400_Goal_and_Cand_Imgs_resized/NNN.png  pictures of both (optional)
    outputs/<model>/NNN.json                            recorded raw replies (optional)

No released file is labelled level 1; the paper's Level-1 columns score the level-2 scenes without
order, so a level-2 scene is read as a scene of levels 1 and 2.

Questions are files in the JSON form of the paper's appendix A.4, in a folder of their own:

    SH.json, CO.json, ...       questions: one file a subtask, a JSON array of objects (or JSON
                                Lines, .jsonl); the name is the subtask's code or its name
    images/<scene_id>.png       the picture of a scene; without it the scene is drawn
    images/<id>/img1.png ...    the pictures <img1> to <img4> of a question (.png or .jpg)

An object holds `scene_id`, `question`, `options` (four texts, or `<img1>` to `<img4>`) and
`answer`, and may hold `id` (else the file's name and the number in the file), `subtask` (which then
counts, not the file's name) and `images`: paths by `scene`, `img1` to `img4`, from the folder.
`answer` is a letter, the text of an option, or an index; for ordering four letters or four
indices. Indices count from 0 in a file in which some answer is 0, from 1 where some answer is 4;
where neither tells, they are refused.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from phyblock.data.base import (
    AssemblyTask,
    Dataset,
    QuestionSet,
    QuestionTask,
    gather,
    lines_of,
    parse_json,
    read_json,
    read_text,
    used_already,
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
_MOST_QUESTIONS = 100_000
_GOAL_VIEW = (45.0, 22.0)
_PICTURE_FILE = "a PNG or JPEG file inside the folder"
_NOT_LETTERS = re.compile(r"[^a-z]+")
_SUBTASKS: Mapping[str, Subtask] = {
    **{code.lower(): code for code in SUBTASKS},
    **{_NOT_LETTERS.sub("", name): code for code, name in SUBTASK_NAMES.items()},
    **{"colour": "CO", "prediction": "PD", "predict": "PD", "dependency": "RD"},
}


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
            str,
            Field(pattern=_PARENTS),
            worded("is not allowed", "base scenes joined by '_'"),
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
    """Return all scenes of a checkout; DataError with everything that is wrong in it."""
    goals = sorted((root / _GOALS).glob("*.json"))
    if not goals:
        allowed = f"a checkout of the official PhyBlock repository, with {_GOALS.as_posix()}/*.json"
        raise DataError(Problem(str(root), "holds no official scenes", allowed=allowed))
    tasks: list[AssemblyTask] = []
    problems: list[Problem] = []
    for path in goals:
        candidates_path = root / _CANDIDATES / f"{path.stem}_16_cand_blocks.json"
        scene, candidates = None, None
        try:
            scene = _read_goal(path)
        except DataError as error:
            gather(problems, error.problems, root)
        try:
            candidates = read_candidates(candidates_path)
            if scene is not None:
                picture = root / _PICTURES / f"{path.stem}.png"
                composite = picture if picture.is_file() else None
                tasks.append(task_of(scene, candidates, str(candidates_path), composite))
        except DataError as error:
            gather(problems, error.problems, root)
    if problems:
        raise DataError(problems)
    return Dataset("official", root, tuple(tasks))


def _read_goal(path: Path) -> Scene:
    if not is_name(path.stem):
        problem = Problem(str(path), "is not a name", "the file's name", path.stem, NAME_ALLOWED)
        raise DataError(problem)
    return validated(_Goal, read_json(path), str(path)).scene(path.stem)


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
    subtask: Any
    scene_id: str
    question: Text
    options: Options
    answer: Any
    images: dict[str, Any] = Field(default_factory=dict)


def read_official_questions(folder: Path, scenes: Dataset) -> QuestionSet:
    """Return all questions of a folder, about these scenes; DataError with all that is wrong."""
    files = sorted(path for path in folder.glob("*") if path.suffix in (".json", ".jsonl"))
    if not files:
        allowed = "question files such as SH.json, one a subtask"
        raise DataError(Problem(str(folder), "holds no question files", allowed=allowed))
    known = {task.scene.id: task.scene for task in scenes.tasks}
    tasks: list[QuestionTask] = []
    problems: list[Problem] = []
    first: dict[str, str] = {}
    for path in files:
        try:
            entries = _entries(path)
        except DataError as error:
            gather(problems, error.problems, folder)
            continue
        base = _index_base([raw for _, raw in entries])
        for number, (where, raw) in enumerate(entries, 1):
            try:
                task = _read_question(raw, where, path, number, known, base)
            except DataError as error:
                gather(problems, error.problems, folder)
                continue
            if (earlier := first.setdefault(task.key, where)) != where:
                gather(problems, [used_already(where, f"at {earlier}", task.key)], folder)
            tasks.append(task)
    if problems:
        raise DataError(problems)
    return QuestionSet(folder.name, folder, tuple(tasks))


def _entries(path: Path) -> list[tuple[str, Any]]:
    """The questions of a file, each with its place: a line, or an index in an array."""
    text = read_text(path)
    if path.suffix == ".jsonl":
        lines = enumerate(lines_of(text), 1)
        return [(f"{path}:{number}", parse_json(line, path, number)) for number, line in lines]
    whole = parse_json(text, path)
    if not isinstance(whole, list):
        raise DataError(Problem(str(path), "is not an array", allowed="an array of questions"))
    if len(whole) > _MOST_QUESTIONS:
        allowed = f"{_MOST_QUESTIONS:,} questions at most"
        raise DataError(Problem(str(path), "is too long an array", "", f"{len(whole):,}", allowed))
    return [(f"{path}[{index}]", raw) for index, raw in enumerate(whole)]


def _index_base(entries: list[Any]) -> int | None:
    """The first index of a file, 0 or 1, or None where its answers do not tell."""
    indices: set[int] = set()
    for raw in entries:
        answer = raw.get("answer") if isinstance(raw, dict) else None
        answers = answer if isinstance(answer, list) else [answer]
        indices.update(index for index in answers if type(index) is int)
    if 0 in indices:
        return 0
    return 1 if len(LETTERS) in indices else None


def _read_question(
    raw: Any, where: str, path: Path, number: int, scenes: Mapping[str, Scene], base: int | None
) -> QuestionTask:
    code = _subtask(path.stem)
    if isinstance(raw, dict):
        stem = code.lower() if code else re.sub(r"[^A-Za-z0-9._-]", "-", path.stem)
        raw = {"id": f"{stem}-{number:03d}", "subtask": path.stem, **raw}
        if type(raw.get("scene_id")) is int:
            # Scene ids are texts of three digits in the official files.
            raw["scene_id"] = f"{raw['scene_id']:03d}"
    line = validated(_Question, raw, where)
    scene = scene_of(line.scene_id, scenes, where)
    subtask = _subtask(line.subtask)
    if subtask is None:
        allowed = f"in the entry or as the file's name: {', '.join(SUBTASKS)}"
        raise DataError(Problem(where, "is not known", "subtask", shown(line.subtask), allowed))
    answer = _answer(line, subtask, base, where)
    files = _files(line, scene, path.parent, where)
    is_drawn = "scene" not in files and subtask != "OR"
    drawn = (QuestionPicture("scene", scene.blocks, _GOAL_VIEW),) if is_drawn else ()
    question = Question(line.id, subtask, scene, line.question, line.options, answer, drawn)
    return QuestionTask(question, files)


def _subtask(named: object) -> Subtask | None:
    return _SUBTASKS.get(_NOT_LETTERS.sub("", named.lower())) if isinstance(named, str) else None


def _answer(line: _Question, subtask: Subtask, base: int | None, where: str) -> tuple[int, ...]:
    """The indices from 0 of the right options."""
    is_order = subtask == "OR"
    parts = line.answer if isinstance(line.answer, list) else [line.answer]
    if is_order and isinstance(line.answer, str):
        parts = [letter for letter in line.answer.upper() if letter.isalnum()]
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
    wanted = len(LETTERS) if is_order else 1
    if not len(set(indices)) == len(parts) == wanted:
        allowed = "a permutation of the options" if is_order else "a letter, option or index"
        if base is None and any(type(part) is int for part in parts):
            allowed = "letters: the indices of this file do not tell whether they begin at 0"
        found = shown(line.answer)
        refuse([Fault("is none of the options", allowed, found, ("answer",))], where)
    return tuple(indices)


def _files(line: _Question, scene: Scene, folder: Path, where: str) -> dict[str, Path]:
    """The picture files by label; that of the scene may be missing, those of options may not."""
    wanted = [("scene", "scene", f"images/{scene.id}")]
    for letter, option in zip(LETTERS, line.options, strict=True):
        if is_picture_option(option):
            key = option.strip("<>")
            wanted.append((letter, key, f"images/{line.id}/{key}"))
    files: dict[str, Path] = {}
    faults: list[Fault] = []
    root = os.path.join(os.path.abspath(folder), "")
    for label, key, usual in wanted:
        endings = (".png", ".jpg", ".jpeg")
        names = [str(line.images[key])] if key in line.images else [usual + e for e in endings]
        paths = (folder / name for name in names)
        # os.path says False of a name that no file can have, where pathlib raises.
        inside = (path for path in paths if os.path.abspath(path).startswith(root))
        path = next((path for path in inside if os.path.isfile(path)), None)
        if path is not None:
            files[label] = path
        elif key in line.images:
            at = ("images", key)
            faults.append(Fault("no such file in the folder", _PICTURE_FILE, shown(names[0]), at))
        elif label != "scene":
            message = f"the picture <{key}> is missing"
            faults.append(Fault(message, _PICTURE_FILE, shown(names[0]), ("images",)))
    refuse(faults, where)
    return files
