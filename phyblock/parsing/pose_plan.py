"""Reply text -> plan with poses, with the rule that matched, or a named failure.

A plan is a list of step lines, numbered from 1, or one unbroken list without numbers; or JSON in
the form that was asked for. It is read whole or not at all: a step that cannot be read is the
failure of the plan, because what is left of it would be another plan. Nothing here raises on any
text.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any, Literal, get_args

from phyblock.domain import PosePlan, PoseStep
from phyblock.parsing.answer_form import AnswerForm, FormProblem
from phyblock.parsing.json_values import Fields
from phyblock.parsing.pose_step import (
    OTHER_UNIT,
    StepProblem,
    checked_step,
    read_step,
    step_label,
)
from phyblock.parsing.text_forms import BOX, TAG, answer_of, plain_line

__all__ = [
    "MOST_POSE_STEPS",
    "POSE_PROBLEMS",
    "ParsedPoses",
    "PoseProblem",
    "parse_poses",
    "pose_form",
]

MOST_POSE_STEPS = 100
"""Longer plans are not carried out: no goal has a quarter of it."""

PoseProblem = Literal[
    "empty",
    "thoughts_only",
    "no_plan",
    "two_plans",
    "broken_list",
    "too_many_steps",
    "unknown_key",
    StepProblem,
    FormProblem,
]
POSE_PROBLEMS: tuple[PoseProblem, ...] = get_args(PoseProblem)

_PLACE = ("x", "y", "z")
_TURN = ("rx", "ry", "rz")
_FINAL = re.compile(r"\bfinal\b|\banswer\b\W*\Z|\bcorrected\b", re.IGNORECASE)
_MINUS = "\u2212"
_MOST_LINES = 20_000


@dataclass(frozen=True)
class ParsedPoses:
    """What was read out of a reply; `problem` says why nothing was where `rule` is None."""

    plan: PosePlan
    rule: str | None
    problem: PoseProblem | None = None


@dataclass(frozen=True)
class _Entry:
    """A line that is a step: its number, if it has one, and where it stands."""

    line: int
    number: int | None
    step: PoseStep | StepProblem


def pose_form(n_candidates: int, *, free: bool) -> AnswerForm[PosePlan | PoseProblem]:
    """A plan with poses as JSON; with `free` each step has a rotation as well."""
    names = (*_PLACE, *(_TURN if free else ()))
    number = {"type": "integer", "enum": list(range(1, n_candidates + 1))}
    step = {
        "type": "object",
        "properties": {"block": number, **{name: {"type": "number"} for name in names}},
        "required": ["block", *names],
        "additionalProperties": False,
    }
    shown = ", ".join(f'"{name}": {name.upper()}' for name in names)
    example = f'[{{"block": N, {shown}}}, ...]'
    schema = {"type": "array", "items": step}
    return AnswerForm("plan", schema, lambda value: _of_json(value, free=free), example)


def parse_poses(text: str, n_candidates: int, *, free: bool) -> ParsedPoses:
    """Read the plan out of a reply; blocks that no candidate is stay in it."""
    reading = pose_form(n_candidates, free=free).read(text) if "{" in text else None
    if reading is None:
        return _of_text(text, free=free)
    if reading.answer is None:
        return ParsedPoses(PosePlan(), None, reading.problem or "wrong_json")
    if isinstance(reading.answer, str):
        return ParsedPoses(PosePlan(), None, reading.answer)
    if OTHER_UNIT.search(text):
        return ParsedPoses(PosePlan(), None, "other_unit")
    return ParsedPoses(reading.answer, reading.rule)


def _of_json(value: Any, *, free: bool) -> PosePlan | PoseProblem:
    if not isinstance(value, list) or isinstance(value, Fields):
        return "wrong_json"
    if len(value) > MOST_POSE_STEPS:
        return "too_many_steps"
    steps = []
    for item in value:
        step = _json_step(item, free=free)
        if isinstance(step, str):
            return step
        steps.append(step)
    return PosePlan(tuple(steps))


def _json_step(item: Any, *, free: bool) -> PoseStep | PoseProblem:
    if not isinstance(item, Fields):
        return "no_place"
    found = dict(item)
    if len(found) < len(item):
        return "wrong_json"
    block = found.get("block")
    if type(block) is not int or abs(block) > 10**6:
        return "unclear_step"
    if unknown := set(found) - {"block", *_PLACE, *_TURN}:
        return "turned" if any("rot" in str(key).lower() for key in unknown) else "unknown_key"
    if any(name not in found for name in _PLACE):
        return "missing_coordinate"
    has_turn = any(name in found for name in _TURN)
    if has_turn and any(name not in found for name in _TURN):
        return "missing_rotation"
    place = [_float(found[name]) for name in _PLACE]
    turn = [_float(found[name]) for name in _TURN] if has_turn else None
    return checked_step(block, place, turn, free=free)


def _float(value: Any) -> float:
    """A JSON number; NaN for what is none."""
    if type(value) not in (int, float):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _of_text(text: str, *, free: bool) -> ParsedPoses:
    answer = answer_of(text)
    if answer is None:
        return ParsedPoses(PosePlan(), None, "thoughts_only")
    if not answer.strip():
        return ParsedPoses(PosePlan(), None, "empty")
    for frame in (TAG, BOX):
        answer = frame.sub(r"\n\g<value>\n", answer)
    lines = answer.replace(_MINUS, "-").splitlines()[:_MOST_LINES]
    entries = _entries(lines, free=free)
    if not entries:
        return ParsedPoses(PosePlan(), None, "no_plan")
    read = _chosen(entries, lines)
    if isinstance(read, str):
        return ParsedPoses(PosePlan(), None, read)
    for entry in read:
        if isinstance(entry.step, str):
            return ParsedPoses(PosePlan(), None, entry.step)
    if len(read) > MOST_POSE_STEPS:
        return ParsedPoses(PosePlan(), None, "too_many_steps")
    if OTHER_UNIT.search(answer):
        return ParsedPoses(PosePlan(), None, "other_unit")
    rule = "steps" if read[0].number is not None else "lines"
    steps = tuple(entry.step for entry in read if isinstance(entry.step, PoseStep))
    return ParsedPoses(PosePlan(steps), rule)


def _entries(lines: list[str], *, free: bool) -> list[_Entry]:
    found = []
    for place, raw in enumerate(lines):
        if not any(character.isdigit() for character in raw):
            continue
        number, rest = step_label(plain_line(raw[:2000]))
        step = read_step(rest, raw, labeled=number is not None, free=free)
        if step is not None:
            found.append(_Entry(place, number, step))
    return found


def _chosen(entries: list[_Entry], lines: list[str]) -> list[_Entry] | PoseProblem:
    """The one list among the steps of an answer: of several that differ, one called final."""
    numbered = [entry for entry in entries if entry.number is not None]
    lists = _numbered(numbered) if numbered else _unbroken(entries, lines)
    if len({tuple(entry.step for entry in one) for one in lists}) > 1:
        between = lines[lists[-2][-1].line + 1 : lists[-1][0].line]
        if not any(_FINAL.search(line) for line in between):
            return "two_plans"
    last = lists[-1]
    if numbered and [entry.number for entry in last] != list(range(1, len(last) + 1)):
        return "broken_list"
    return last


def _numbered(entries: list[_Entry]) -> list[list[_Entry]]:
    lists: list[list[_Entry]] = []
    for entry in entries:
        before = lists[-1][-1].number if lists else None
        if before is None or entry.number is None or entry.number <= before:
            lists.append([])
        lists[-1].append(entry)
    return lists


def _unbroken(entries: list[_Entry], lines: list[str]) -> list[list[_Entry]]:
    lists: list[list[_Entry]] = []
    for entry in entries:
        between = lines[lists[-1][-1].line + 1 : entry.line] if lists else ["-"]
        if any(line.strip() for line in between):
            lists.append([])
        lists[-1].append(entry)
    return lists
