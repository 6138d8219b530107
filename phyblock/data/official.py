"""The official layout: a checkout of the PhyBlock repository, whole or partial.

    data/SCENEs_400_Goal_Jsons/NNN.json                 goal scenes
    data/SCENEs_400_Cand_Jsons/NNN_16_cand_blocks.json  candidate sets
    data/SCENEs_400_Goal_and_Cand_Imgs_resized/NNN.png  pictures of both (optional)
    outputs/<model>/NNN.json                            recorded raw replies (optional)

No released file is labelled level 1; the paper's Level-1 columns score the level-2 scenes without
order, so a level-2 scene is read as a scene of levels 1 and 2. Names of models are matched to the
rows of the paper's Tables 1 and 2.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter

from phyblock.config.validation import Fault, checked, form
from phyblock.data.base import Dataset, read_data, read_each
from phyblock.data.scenes import (
    NAME,
    NAME_ALLOWED,
    Order,
    Position,
    SceneBlocks,
    StoredCandidate,
    candidate_set,
    look_faults,
    task_of,
    triple,
)
from phyblock.domain.scene import MAX_CANDIDATES, AssemblyTask, CandidateSet, Scene
from phyblock.errors import DataError, Problem
from phyblock.records.record import Line, decode
from phyblock.text import counted

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
    the pictures are removed. Raises DataError if no recording includes one, or if they differ.
    """
    texts: set[str] = set()
    for folder in recorded_models(root).values():
        path = min(folder.glob("*.json"))
        raw = decode(TypeAdapter(Any), read_data(path), str(path))
        instruction = raw.get("instruction") if isinstance(raw, dict) else None
        if isinstance(instruction, str):
            texts.add(_PICTURE_MARKS.sub("", instruction))
    if len(texts) == 1:
        return texts.pop()
    message = f"recordings carry {counted(len(texts), 'official prompt')}"
    allowed = "one text, in the field 'instruction', as recordings of the InternVL models have it"
    raise DataError(Problem(str(root / _OUTPUTS), message, "instruction", allowed=allowed))


_PUBLISHED = (
    "Claude-3.5 Haiku", "Claude-3.5 Sonnet", "Claude-3.7 Sonnet", "Claude-3.7 Sonnet-Thinking",
    "GPT-4o-mini", "GPT-4o", "GPT-o1", "Gemini-1.5-flash-8b", "Gemini-1.5-flash",
    "Gemini-2.0-flash-lite", "Gemini-2.0-flash", "Gemini-2.0-flash-thinking-exp", "Qwen-VL-Max",
    "InternVL2.5-1B", "InternVL2.5-8B", "InternVL2.5-78B", "Qwen2.5-VL-3B-Instruct",
    "Qwen2.5-VL-7B-Instruct", "LLaVa-OneVision-0.5B", "LLaVa-OneVision-7B", "Random", "GPT-4.1",
    "GPT-o3", "Qwen2.5-VL-72B-Instruct",
)  # fmt: skip
"""Rows of the paper's Table 1, then those only in Table 2."""
_ROWS = {
    **{row.lower(): row for row in _PUBLISHED},
    "claude-3-5-haiku": "Claude-3.5 Haiku",
    "claude-3-5-sonnet": "Claude-3.5 Sonnet",
    "claude-3-7-sonnet": "Claude-3.7 Sonnet",
    "claude-3-7-thinking": "Claude-3.7 Sonnet-Thinking",
}
"""The rows by their names, and by those of folders of recordings, in lower case."""


def match_published(name: str) -> str | None:
    """Return the row of Table 1 or 2 for a folder of recordings, in any letter case, or None."""
    return _ROWS.get(name.lower())
