"""The two parsers on the official recordings: how often they part, and why.

All differences are in `gold.csv`. `test_plan_gold.py` says how it was read, and holds that the
default parser reads the same.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from pathlib import Path

import pytest

from phyblock.parsing import parse_plan
from tests.official_replies import gold_readings, reply_texts

N = 16
Steps = tuple[int, ...]
Readings = dict[tuple[str, str], tuple[Steps, Steps]]
BEFORE = "official reads mentions before the plan"
INSIDE = "official reads mentions inside the plan"
MISSES = "official misses steps"
NOTHING = "official reads nothing"
DIFFERENCES = {
    "InternVL2.5-4B": {BEFORE: 12, INSIDE: 7},
    "InternVL2.5-8B": {BEFORE: 15, INSIDE: 1},
    "Qwen-VL-max": {MISSES: 1},
    "Qwen2.5-VL-3B-Instruct": {BEFORE: 8, INSIDE: 8},
    "claude-3-5-haiku": {NOTHING: 33, MISSES: 5, INSIDE: 1},
    "claude-3-7-thinking": {BEFORE: 1},
    "gemini-2.0-flash": {BEFORE: 11, NOTHING: 2},
    "gpt-4o": {BEFORE: 4, MISSES: 4, NOTHING: 1},
}
PARSE_FAILURES = {"InternVL2.5-4B": 1, "InternVL2.5-8B": 1, "Qwen2.5-VL-3B-Instruct": 78}


def _kind(default: tuple[int, ...], official: tuple[int, ...]) -> str:
    if not official:
        return NOTHING
    if official[-len(default) :] == default:
        return BEFORE
    return MISSES if len(default) > len(official) else INSIDE


@pytest.fixture(scope="module", params=[5, pytest.param(1, marks=pytest.mark.slow)])
def readings(official_checkout: Path, request: pytest.FixtureRequest) -> Readings:
    """What the default and the official parser read in all replies that a person read, in all in
    which the official rule reads nothing, and in every so-manieth of the others.
    """
    gold, readings = gold_readings(), {}
    for place, (which, text) in enumerate(reply_texts(official_checkout).items()):
        official = parse_plan(text, N, "official").plan.steps
        digest = hashlib.sha256(text.encode()).hexdigest()
        if digest in gold:
            readings[which] = gold[digest], official
        elif not official or place % request.param == 0:
            readings[which] = parse_plan(text, N).plan.steps, official
    return readings


def test_the_parsers_differ_on_few_replies_and_in_known_ways(readings: Readings) -> None:
    found: dict[str, Counter[str]] = {model: Counter() for model, _ in readings}
    for (model, _), (default, official) in readings.items():
        if default != official:
            found[model][_kind(default, official)] += 1
    known = {model: DIFFERENCES[model] for model in found if model in DIFFERENCES}
    assert {model: dict(found[model]) for model in known} == known


def test_the_default_reads_whatever_the_official_rule_reads(readings: Readings) -> None:
    failures: Counter[str] = Counter()
    for (model, scene), (default, official) in readings.items():
        if not default:
            assert not official, (model, scene)
            failures[model] += 1
    for model in DIFFERENCES.keys() & {model for model, _ in readings}:
        assert failures[model] == PARSE_FAILURES.get(model, 0), model
