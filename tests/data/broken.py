"""A sound scene in the project's own format, and ways to write it down and break it."""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
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


Keys = str | Sequence[str | int]
"""A path in a document; as a text it is dotted: `blocks.1.depend`."""


def with_value(document: Any, path: Keys, value: object) -> Any:
    """A copy of a document with the value at a path replaced."""
    if not path:
        return value
    changed = copy.deepcopy(document)
    holder, last = _holder(changed, path)
    holder[last] = value
    return changed


def without(document: Any, path: Keys) -> Any:
    """A copy of a document without what stands at a path."""
    changed = copy.deepcopy(document)
    holder, last = _holder(changed, path)
    del holder[last]
    return changed


def _holder(document: Any, path: Keys) -> tuple[Any, Any]:
    """What holds the value at a path, and its key there."""
    *above, last = path.split(".") if isinstance(path, str) else path
    for key in above:
        document = document[int(key) if isinstance(document, list) else key]
    return document, int(last) if isinstance(document, list) else last


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
