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
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar, cast

from phyblock.datasets.base import AssemblyTask, Dataset
from phyblock.datasets.checks import SceneReader
from phyblock.datasets.raw import gather, is_name, read_json
from phyblock.domain import CandidateSet, Scene
from phyblock.errors import DataError, Problem

__all__ = [
    "candidates_file",
    "goal_files",
    "official_prompt",
    "read_candidates",
    "read_official",
    "read_scene",
    "recorded_models",
]

_GOALS = Path("data", "SCENEs_400_Goal_Jsons")
_CANDIDATES = Path("data", "SCENEs_400_Cand_Jsons")
_PICTURES = Path("data", "SCENEs_400_Goal_and_Cand_Imgs_resized")
_OUTPUTS = Path("outputs")
# <IMG_CONTEXT> of InternVL, <|image_pad|> of Qwen, <image> of LLaVA
_PICTURE_MARKS = re.compile(r"\A(?:\s*<\|?[A-Za-z_]{1,30}\|?>)+")
_T = TypeVar("_T")


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
    found = sorted(outputs.iterdir()) if outputs.is_dir() else []
    folders = {path.name: path for path in found if path.is_dir() and any(path.glob("*.json"))}
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
    found: dict[str, list[str]] = {}
    for name, folder in recorded_models(root).items():
        raw = read_json(min(folder.glob("*.json")))
        instruction = raw.get("instruction") if isinstance(raw, dict) else None
        if isinstance(instruction, str):
            found.setdefault(_PICTURE_MARKS.sub("", instruction), []).append(name)
    where = str(root / _OUTPUTS)
    if not found:
        message = "no recording carries the official prompt"
        allowed = "recordings with a field 'instruction', such as those of the InternVL models"
        raise DataError(Problem(where, message, "instruction", allowed=allowed))
    ranked = sorted(found, key=lambda text: -len(found[text]))
    if len(ranked) > 1 and len(found[ranked[0]]) == len(found[ranked[1]]):
        names = "; ".join(", ".join(models) for models in found.values())
        message = "the recordings carry different prompts, none more often than the others"
        raise DataError(Problem(where, message, "instruction", names))
    return ranked[0]


def _read_task(root: Path, path: Path) -> AssemblyTask:
    candidates_path = candidates_file(root, path)
    scene, problems = _try(read_scene, path)
    candidates, more_problems = _try(read_candidates, candidates_path)
    if scene is None or candidates is None:
        raise DataError([*problems, *more_problems])
    reader = SceneReader(str(candidates_path))
    reader.check_solvable(scene, candidates)
    reader.raise_if_broken()
    picture = root / _PICTURES / f"{path.stem}.png"
    return AssemblyTask(scene, candidates, picture if picture.is_file() else None)


def _try(read: Callable[[Path], _T], path: Path) -> tuple[_T | None, tuple[Problem, ...]]:
    try:
        return read(path), ()
    except DataError as error:
        return None, error.problems


def read_scene(path: Path, reader: SceneReader | None = None) -> Scene:
    """The scene in a goal file; raises DataError with everything that `reader` finds wrong."""
    reader = reader or SceneReader(str(path))
    raw = reader.mapping(read_json(path))
    level = reader.integer(reader.get(raw, "level"), "level", 1, 4)
    # Declared layers differ from the longest path in 70 of the 400 released scenes.
    blocks = reader.blocks(reader.get(raw, "blocks"), strict_layers=False)
    optional = raw if isinstance(raw, dict) else {}
    look_at = optional.get("lookat_pos")
    look_at_m = None if look_at is None else reader.position(look_at, "lookat_pos")
    parents = [reader.name(path.stem, "the file's name")]
    if (combined := optional.get("combined")) is not None:
        parents = combined.split("_") if isinstance(combined, str) else []
        if not parents or not all(map(is_name, parents)):
            reader.complain("combined", "is not allowed", combined, "base scenes joined by '_'")
    reader.raise_if_broken()
    levels = (1, 2) if level == 2 else (cast(int, level),)
    return Scene(path.stem, levels, blocks, tuple(parents), look_at_m)


def read_candidates(path: Path) -> CandidateSet:
    """The candidate set in a file; raises DataError with everything that is wrong in it."""
    raw = read_json(path)
    reader = SceneReader(str(path))
    candidates = reader.candidates(raw)
    for i, entry in enumerate(raw if isinstance(raw, list) else []):
        # In candidate files `position` is the 1-based number that the picture shows.
        number = entry.get("position") if isinstance(entry, dict) else i + 1
        if number != i + 1:
            allowed = f"{i + 1}: candidates are numbered from 1 in file order"
            reader.complain(f"candidates[{i}].position", "is wrong", number, allowed)
    reader.raise_if_broken()
    return candidates
