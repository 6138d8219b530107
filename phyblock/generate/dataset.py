"""Writing a data set: designs to scenes, scenes to JSON Lines, and the card that goes with them."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Scene
from phyblock.errors import DataError, Problem, StoreError
from phyblock.generate.acceptance import accept
from phyblock.generate.candidates import make_candidates
from phyblock.generate.card import card
from phyblock.generate.large_designs import LEVEL_4
from phyblock.generate.medium_designs import LEVEL_3
from phyblock.generate.sketch import Design, Sketch, make_scene
from phyblock.generate.small_designs import LEVEL_1, LEVEL_2

__all__ = ["designed_scenes", "scene_line", "write_dataset"]

_BOTH_LEVELS = ("l1-cottage", "l1-dolmen")
_DESIGNS: dict[int, dict[str, Design]] = {1: LEVEL_1, 2: LEVEL_2, 3: LEVEL_3, 4: LEVEL_4}


def designed_scenes() -> tuple[Scene, ...]:
    """The scenes of the hand-made designs, sorted by id; two are counted in levels 1 and 2."""
    scenes = []
    for level, designs in _DESIGNS.items():
        for name, design in designs.items():
            sketch = Sketch()
            design(sketch)
            levels = (1, 2) if name in _BOTH_LEVELS else (level,)
            scenes.append(make_scene(name, levels, sketch.blocks))
    return tuple(sorted(scenes, key=lambda scene: scene.id))


def scene_line(scene: Scene, candidates: CandidateSet) -> str:
    """A scene and its candidates as one line of JSON, no newline at its end."""
    looks = {block.look for block in scene.blocks}
    record = {
        "id": scene.id,
        "levels": list(scene.levels),
        "parents": list(scene.parents),
        "blocks": [
            {
                "order": block.order,
                "type": block.type,
                "color": block.color,
                "layer": block.layer,
                "depend": list(block.depend) or [0],
                "position": [round(c, 6) + 0.0 for c in block.position_m],
                "euler": [_plain(angle) for angle in block.euler_deg],
            }
            for block in scene.blocks
        ],
        "candidates": [
            {
                "type": candidate.type,
                "color": candidate.color,
                "euler": [_plain(angle) for angle in candidate.euler_deg],
                "required": candidate.look in looks,
            }
            for candidate in candidates.candidates
        ],
    }
    return json.dumps(record, allow_nan=False)


def write_dataset(folder: Path, scenes: Iterable[Scene], check: bool = True) -> int:
    """Write `scenes.jsonl` and `README.md` into a folder; returns the number of scenes.

    Raises DataError with all that is wrong when `check` finds a scene unsound, before anything
    is written, and StoreError when the folder cannot be written.
    """
    chosen = sorted(scenes, key=lambda scene: scene.id)
    if check:
        _accept_all(chosen)
    sets = [make_candidates(scene) for scene in chosen]
    lines = [scene_line(scene, candidates) for scene, candidates in zip(chosen, sets, strict=True)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write(folder / "scenes.jsonl", "".join(f"{line}\n" for line in lines))
        _write(folder / "README.md", card(folder.name, chosen, sets))
    except OSError as error:
        raise StoreError(Problem(str(folder), f"cannot be written: {error.strerror}")) from error
    return len(chosen)


def _accept_all(scenes: Iterable[Scene]) -> None:
    problems: list[Problem] = []
    for scene in scenes:
        try:
            accept(scene)
        except DataError as error:
            problems += error.problems
    if problems:
        raise DataError(problems)


def _write(path: Path, text: str) -> None:
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(text)


def _plain(angle_deg: float) -> float | int:
    """Whole degrees as an integer, which reads better in a file."""
    return int(angle_deg) if float(angle_deg).is_integer() else angle_deg
