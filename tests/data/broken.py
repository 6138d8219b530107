"""A sound scene in the project's own format, and ways to write it down and break it."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

Raw = dict[str, Any]


def sound_scene() -> Raw:
    """A cube that carries an arch, and three candidates."""
    cube = {"type": "cube", "color": "red", "euler": [0, 0, 0]}
    arch = {"type": "arch", "color": "red", "euler": [0, 0, 90]}
    return {
        "id": "s1",
        "levels": [1, 2],
        "parents": ["s1"],
        "blocks": [
            {"order": 1, "layer": 1, "depend": [0], "position": [0, 0, 0.025], **cube},
            {"order": 2, "layer": 2, "depend": [1], "position": [0, 0, 0.075], **arch},
        ],
        "candidates": [
            {**cube, "required": 1},
            {**arch, "euler": [0, 0, 0], "required": 0},
            {**arch, "required": 1},
        ],
    }


def with_value(scene: Raw, path: str, value: object) -> Raw:
    """A copy of `scene` with the value at a dotted path (`blocks.1.depend`) replaced."""
    changed = copy.deepcopy(scene)
    *parents, last = path.split(".")
    at: Any = changed
    for key in parents:
        at = at[int(key)] if isinstance(at, list) else at[key]
    at[int(last) if isinstance(at, list) else last] = value
    return changed


def without(scene: Raw, path: str) -> Raw:
    """A copy of `scene` without the field at a dotted path."""
    changed = copy.deepcopy(scene)
    *parents, last = path.split(".")
    at: Any = changed
    for key in parents:
        at = at[int(key)] if isinstance(at, list) else at[key]
    del at[last]
    return changed


def write_scenes(folder: Path, *scenes: Raw) -> Path:
    """A data set folder with one scene a line."""
    text = "".join(json.dumps(scene) + "\n" for scene in scenes)
    (folder / "scenes.jsonl").write_text(text, encoding="utf-8")
    return folder


def write_checkout(root: Path, *scenes: Raw) -> Path:
    """The scenes in the official layout, `levels` becoming `level`."""
    goals = root / "data" / "SCENEs_400_Goal_Jsons"
    candidates = root / "data" / "SCENEs_400_Cand_Jsons"
    goals.mkdir(parents=True, exist_ok=True)
    candidates.mkdir(parents=True, exist_ok=True)
    for scene in scenes:
        goal = {"level": max(scene["levels"]), "blocks": scene["blocks"]}
        numbered = [
            {**entry, "position": number} for number, entry in enumerate(scene["candidates"], 1)
        ]
        (goals / f"{scene['id']}.json").write_text(json.dumps(goal), encoding="utf-8")
        path = candidates / f"{scene['id']}_16_cand_blocks.json"
        path.write_text(json.dumps(numbered), encoding="utf-8")
    return root
