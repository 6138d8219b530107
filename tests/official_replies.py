"""The reply texts of the official recordings."""

from __future__ import annotations

import csv
import functools
import json
from pathlib import Path

from phyblock.data import recorded_models
from phyblock.models.raw_replies import read_raw_reply

__all__ = ["GOLD", "gold_readings", "reply_texts"]

GOLD = Path(__file__).parent / "parsing" / "gold.csv"


@functools.cache
def reply_texts(checkout: Path) -> dict[tuple[str, str], str]:
    """Text of every recorded reply by (model folder, scene id)."""
    return {
        (model, path.stem): read_raw_reply(json.loads(path.read_bytes()), str(path)).text
        for model, folder in recorded_models(checkout).items()
        for path in sorted(folder.glob("*.json"))
    }


def gold_readings() -> dict[str, tuple[int, ...]]:
    """What a person read in replies, by the digest of their texts."""
    with GOLD.open(encoding="utf-8", newline="") as file:
        return {row["sha256"]: tuple(map(int, row["plan"].split())) for row in csv.DictReader(file)}
