"""The two parsers on the official recordings: how often they part, and why.

All differences of these six models were read by eye; the default read what the model meant.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from phyblock.parsing import parse_plan
from tests.official_replies import reply_texts

N = 16
BEFORE = "official reads mentions before the plan"
INSIDE = "official reads mentions inside the plan"
MISSES = "official misses steps"
NOTHING = "official reads nothing"
DIFFERENCES = {
    "InternVL2.5-8B": {BEFORE: 15, INSIDE: 1},
    "Qwen-VL-max": {},
    "claude-3-5-haiku": {NOTHING: 33, MISSES: 3, INSIDE: 1},
    "claude-3-7-thinking": {BEFORE: 1},
    "gemini-2.0-flash": {BEFORE: 11, NOTHING: 2},
    "gpt-4o": {BEFORE: 4, MISSES: 3, NOTHING: 1},
}
PARSE_FAILURES = {"InternVL2.5-8B": 1}


def _kind(default: tuple[int, ...], official: tuple[int, ...]) -> str:
    if not official:
        return NOTHING
    if official[-len(default) :] == default:
        return BEFORE
    return MISSES if len(default) > len(official) else INSIDE


def test_the_parsers_differ_on_few_replies_and_in_known_ways(official_checkout: Path) -> None:
    texts = reply_texts(official_checkout)
    found: dict[str, Counter[str]] = {model: Counter() for model, _ in texts}
    for (model, _), text in texts.items():
        default = parse_plan(text, N).plan.steps
        official = parse_plan(text, N, "official").plan.steps
        if default != official:
            found[model][_kind(default, official)] += 1
    known = {model: DIFFERENCES[model] for model in found if model in DIFFERENCES}
    assert {model: dict(found[model]) for model in known} == known


def test_the_default_reads_whatever_the_official_rule_reads(official_checkout: Path) -> None:
    texts = reply_texts(official_checkout)
    failures: Counter[str] = Counter()
    for (model, scene), text in texts.items():
        if not parse_plan(text, N).plan.steps:
            assert not parse_plan(text, N, "official").plan.steps, (model, scene)
            failures[model] += 1
    for model in DIFFERENCES.keys() & {model for model, _ in texts}:
        assert failures[model] == PARSE_FAILURES.get(model, 0), model
