"""The plan parser against recorded replies that were read by eye.

`gold.csv` holds digests of texts and readings, never a text. All replies on which two of
the former default, the present and the official parser differ are in it; the others were drawn at
random. `held_out` were read after the rules had been written, before the parser's readings were
seen: it read 109 of 110 rightly. `seen` were read as the rules were written and checked beside what
the parser reads, so that they hold what is read now rather than test it. `second` is what another
reader, who saw neither readings nor parser, read in all of them later.
"""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from phyblock.parsing import parse_plan
from tests.official_replies import GOLD, gold_readings, reply_texts

N = 16


@pytest.fixture(scope="module")
def readings() -> dict[str, tuple[int, ...]]:
    return gold_readings()


def gold_replies(
    checkout: Path, readings: dict[str, tuple[int, ...]]
) -> Iterator[tuple[tuple[str, str], str, tuple[int, ...]]]:
    """Which reply it is, its text, and what a person reads in it."""
    for which, text in reply_texts(checkout).items():
        digest = hashlib.sha256(text.encode()).hexdigest()
        if digest in readings:
            yield which, text, readings[digest]


def test_the_gold_set_is_large_and_of_both_kinds(readings: dict[str, tuple[int, ...]]) -> None:
    assert len(readings) >= 400
    assert sum(not plan for plan in readings.values()) >= 50


def test_two_readers_agree() -> None:
    with GOLD.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    differ = [row for row in rows if _in_range(row["plan"]) != _in_range(row["second"])]
    assert len(differ) <= 0.02 * len(rows)


def _in_range(plan: str) -> list[int]:
    return [number for number in map(int, plan.split()) if number <= N]


def test_every_gold_reply_is_read_as_a_person_reads_it(
    official_checkout: Path, readings: dict[str, tuple[int, ...]]
) -> None:
    misread = {
        which: (parse_plan(text, N).plan.steps, plan)
        for which, text, plan in gold_replies(official_checkout, readings)
        if parse_plan(text, N).plan.steps != plan
    }
    assert misread == {}
