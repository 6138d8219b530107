"""Reader of the official layout: a checkout of the PhyBlock repository, whole or partial.

    data/SCENEs_400_Goal_Jsons/NNN.json                 goal scenes
    data/SCENEs_400_Cand_Jsons/NNN_16_cand_blocks.json  candidate sets
    data/SCENEs_400_Goal_and_Cand_Imgs_resized/NNN.png  pictures of both (optional)
    outputs/<model>/NNN.json                            recorded raw replies (optional)

No released file is labelled level 1; the paper's Level-1 columns score the level-2 scenes without
order, so a level-2 scene is read as a scene of levels 1 and 2.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import Field

from phyblock.data.base import AssemblyTask, Dataset
from phyblock.data.raw import gather, read_json
from phyblock.domain import MAX_CANDIDATES, CandidateSet, Scene
from phyblock.errors import DataError, Problem
from phyblock.records.data_values import NAME_ALLOWED, Filled, Position, is_name, triple
from phyblock.records.decode import shown
from phyblock.records.faults import Fault, free_of, refuse, validated, worded
from phyblock.records.line import Line
from phyblock.records.scene import (
    SceneBlocks,
    StoredCandidate,
    candidate_set,
    look_faults,
    missing_faults,
)

__all__ = [
    "OfficialGoal",
    "candidates_file",
    "goal_files",
    "official_prompt",
    "read_candidates",
    "read_goal",
    "read_official",
    "recorded_models",
]

_GOALS = Path("data", "SCENEs_400_Goal_Jsons")
_CANDIDATES = Path("data", "SCENEs_400_Cand_Jsons")
_PICTURES = Path("data", "SCENEs_400_Goal_and_Cand_Imgs_resized")
_OUTPUTS = Path("outputs")
# <IMG_CONTEXT> of InternVL, <|image_pad|> of Qwen, <image> of LLaVA
_PICTURE_MARKS = re.compile(r"\A(?:\s*<\|?[A-Za-z_]{1,30}\|?>)+")
_NO_LEVEL = ("is not an allowed number", "an integer 1 to 4")
_PARENTS = r"^[A-Za-z0-9][A-Za-z0-9.-]{0,99}(_[A-Za-z0-9][A-Za-z0-9.-]{0,99})*$"
_NO_PARENTS = ("is not allowed", "base scenes joined by '_'")
_T = TypeVar("_T")
_GoalT = TypeVar("_GoalT", bound=Line)


class OfficialGoal(Line, extra="ignore"):
    """A goal file; other fields are not read."""

    level: Annotated[int, Field(strict=True, ge=1, le=4), worded(*_NO_LEVEL)]
    # Declared layers differ from the longest path in 70 of the 400 released scenes.
    blocks: SceneBlocks
    lookat_pos: Position | None = None
    combined: Annotated[str, Field(pattern=_PARENTS), worded(*_NO_PARENTS)] | None = None

    def scene(self, name: str) -> Scene:
        """The goal structure; a base scene is its own parent."""
        levels = (1, 2) if self.level == 2 else (self.level,)
        parents = self.combined.split("_") if self.combined is not None else [name]
        look_at_m = None if self.lookat_pos is None else triple(self.lookat_pos)
        blocks = tuple(stored.block() for stored in self.blocks)
        return Scene(name, levels, blocks, tuple(parents), look_at_m)


class _Numbered(StoredCandidate, extra="ignore"):
    position: Any = None


def _number_faults(candidates: Sequence[_Numbered]) -> Iterator[Fault]:
    for i, candidate in enumerate(candidates):
        if candidate.position != i + 1:
            allowed = f"{i + 1}: candidates are numbered from 1 in file order"
            yield Fault("is wrong", allowed, shown(candidate.position), (i, "position"))


class _CandidateFile(Line):
    candidates: Annotated[
        tuple[_Numbered, ...], Filled(MAX_CANDIDATES), free_of(_number_faults, look_faults)
    ]
    """In candidate files `position` is the number, from 1, that the picture shows."""


def read_official(root: Path) -> Dataset:
    """All scenes of a checkout; raises DataError with everything that is wrong in it."""
    tasks: list[AssemblyTask] = []
    problems: list[Problem] = []
    for path in goal_files(root):
        try:
            tasks.append(_read_task(root, path))
        except DataError as error:
            gather(problems, error.problems, root)
    if problems:
        raise DataError(problems)
    return Dataset("official", root, tuple(tasks))


def goal_files(root: Path) -> list[Path]:
    """The goal files of a checkout, one at least, by name; DataError when there is none."""
    goals = sorted((root / _GOALS).glob("*.json"))
    if not goals:
        allowed = f"a checkout of the official PhyBlock repository, with {_GOALS.as_posix()}/*.json"
        raise DataError(Problem(str(root), "holds no official scenes", allowed=allowed))
    return goals


def candidates_file(root: Path, goal: Path) -> Path:
    """Where the candidate set of a goal file is."""
    return root / _CANDIDATES / f"{goal.stem}_16_cand_blocks.json"


def recorded_models(root: Path) -> dict[str, Path]:
    """Folders of recorded replies in a checkout, by name, in name order."""
    outputs = root / _OUTPUTS
    paths = sorted(outputs.iterdir()) if outputs.is_dir() else []
    folders = {path.name: path for path in paths if path.is_dir() and any(path.glob("*.json"))}
    if not folders:
        allowed = "a checkout with outputs/<model>/NNN.json"
        raise DataError(Problem(str(outputs), "holds no recorded replies", allowed=allowed))
    return folders


def official_prompt(root: Path) -> str:
    """The exact official text prompt, read out of the recordings that carry it.

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


def _read_task(root: Path, path: Path) -> AssemblyTask:
    candidates_path = candidates_file(root, path)
    goal, problems = _try(partial(read_goal, kind=OfficialGoal), path)
    candidates, more_problems = _try(read_candidates, candidates_path)
    if goal is None or candidates is None:
        raise DataError([*problems, *more_problems])
    scene = goal.scene(path.stem)
    refuse(missing_faults(scene, candidates), str(candidates_path))
    picture = root / _PICTURES / f"{path.stem}.png"
    return AssemblyTask(scene, candidates, picture if picture.is_file() else None)


def _try(read: Callable[[Path], _T], path: Path) -> tuple[_T | None, tuple[Problem, ...]]:
    try:
        return read(path), ()
    except DataError as error:
        return None, error.problems


def read_goal(path: Path, kind: type[_GoalT]) -> _GoalT:
    """A goal file as a `kind`; raises DataError with everything that is wrong in it."""
    if not is_name(path.stem):
        problem = Problem(str(path), "is not a name", "the file's name", path.stem, NAME_ALLOWED)
        raise DataError(problem)
    return validated(kind, read_json(path), str(path))


def read_candidates(path: Path) -> CandidateSet:
    """The candidate set in a file; raises DataError with everything that is wrong in it."""
    file = validated(_CandidateFile, {"candidates": read_json(path)}, str(path))
    return candidate_set(file.candidates)
