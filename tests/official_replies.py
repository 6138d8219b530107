"""The reply texts of the official recordings."""

from __future__ import annotations

import functools
import json
from pathlib import Path

from phyblock.data.official import recorded_models
from phyblock.models.client import read_raw_reply


@functools.cache
def reply_texts(checkout: Path) -> dict[tuple[str, str], str]:
    """Text of every recorded reply by (model folder, scene id)."""
    return {
        (model, path.stem): read_raw_reply(json.loads(path.read_bytes()), str(path)).text
        for model, folder in recorded_models(checkout).items()
        for path in sorted(folder.glob("*.json"))
    }
