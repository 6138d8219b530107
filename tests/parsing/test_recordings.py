"""Readings of the official recordings, pinned by counts a model."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

from phyblock.parsing.plan import parse_plan
from tests.official_replies import reply_texts

COUNTS = Path(__file__).with_name("recordings.csv")


def test_every_recorded_reply_is_read_as_counted(official_checkout: Path) -> None:
    found: dict[str, Counter[str]] = {}
    for (model, _), text in reply_texts(official_checkout).items():
        parsed = parse_plan(text, 16)
        official = parse_plan(text, 16, "official").plan
        counts = found.setdefault(model, Counter())
        counts["replies"] += 1
        counts[parsed.rule or "unread"] += 1
        counts["truncated"] += parsed.truncated
        counts["blocks"] += len(parsed.plan.steps)
        counts["dropped"] += len(parsed.dropped)
        counts["as_official"] += parsed.plan == official
    with COUNTS.open(encoding="utf-8", newline="") as file:
        known = {row.pop("model"): row for row in csv.DictReader(file)}
    for model, counts in found.items():
        assert {name: str(counts[name]) for name in known[model]} == known[model], model
    assert found
