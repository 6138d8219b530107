"""Reply text -> plan with poses, with the rule that matched, or a named problem.

A plan is JSON of the asked form, else the last list of step lines, of items or of table rows: each
says a block, three coordinates and, where a rotation is asked for, three angles. It is read whole
or not at all: what is left of a plan without one of its steps would be another plan.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from phyblock.domain import PoseStep
from phyblock.domain.scene import PosePlan
from phyblock.parsing.plan import chosen_list, item_lists, step_lists
from phyblock.parsing.text import AnswerForm, answer_of, is_open, plain_lines, whole_number

MOST_POSE_STEPS = 100  # Longer plans are not executed: no goal has a quarter of it.
FARTHEST_PLACE_CM = 1000.0  # Coordinates beyond this are no place on a table.
MOST_TURN_DEG = 3600.0

_StepProblem = Literal["unclear_step", "other_unit", "out_of_range", "missing_rotation", "turned"]
PoseProblem = Literal["empty", "thoughts_only", "no_plan", "too_many_steps", _StepProblem]
"""`turned`: a step has a rotation where candidates keep theirs."""
_NAMES = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True)
class ParsedPoses:
    """A plan that was read out of a reply; `problem` says why none was where `rule` is None."""

    plan: PosePlan
    rule: str | None
    problem: PoseProblem | None = None


def pose_form(n_candidates: int, *, free: bool) -> AnswerForm[list[PoseStep | _StepProblem]]:
    """Return the JSON form of a plan with poses; with `free` each step has a rotation as well."""
    names = _NAMES if free else _NAMES[:3]
    number = {"type": "integer", "enum": list(range(1, n_candidates + 1))}
    step = {
        "type": "object",
        "properties": {"block": number, **{name: {"type": "number"} for name in names}},
        "required": ["block", *names],
        "additionalProperties": False,
    }
    shown = ", ".join(f'"{name}": {name.upper()}' for name in names)
    value = {"type": "array", "items": step}

    def meaning(value: Any) -> list[PoseStep | _StepProblem] | None:
        is_list = isinstance(value, list)
        return [_json_step(item, free=free) for item in value] if is_list else None

    return AnswerForm("plan", value, meaning, f'[{{"block": N, {shown}}}, ...]')


def parse_poses(text: str, n_candidates: int, *, free: bool) -> ParsedPoses:
    """Read the plan out of a reply; blocks that no candidate is stay in it."""
    answer = answer_of(text)
    if not answer:
        return ParsedPoses(PosePlan(), None, "empty" if answer == "" else "thoughts_only")
    rule, steps = "json", pose_form(n_candidates, free=free).read(answer) or []
    if not steps:
        lines = plain_lines(answer)
        rule, lists = "steps", step_lists(lines)
        if not lists:
            rule, lists = "list", [one for kind in item_lists(lines) for one in kind]
        for one in lists:
            texts = [" ".join([item.text, *item.more]) for item in one.items]
            one.values = [_step(text, free=free) for text in texts]
        steps, _ = chosen_list(lists, lines, is_open=is_open(answer))
    good = tuple(step for step in steps if isinstance(step, PoseStep))
    bad = [step for step in steps if not isinstance(step, PoseStep)]
    problem: PoseProblem | None = bad[0] if bad else None if good else "no_plan"
    if len(steps) > MOST_POSE_STEPS:
        problem = "too_many_steps"
    return ParsedPoses(PosePlan(), None, problem) if problem else ParsedPoses(PosePlan(good), rule)


_BLOCK = re.compile(
    r"(?i)\b(?:block|candidate|index|number|id)\b[ #:=\"']{0,4}(?:with index )?(-?\d{1,6})(?![.\d])"
    r"|\W{0,9}(-?\d{1,6})(?![.,]?\d)",
)
_OTHERS = re.compile(r"\b(?:block|step|candidate|layer|level)s? ?#?\d{1,6}(?![.\d])", re.I)
_VALUE = re.compile(
    r"(?i)(?:(?<![a-z])(r?[xyz])\"? ?[=:] ?)?(?<![\w.])"
    r"([+-]?(?:\d{1,9}(?:\.\d{0,12})?|\.\d{1,9})(?:e[+-]?\d{1,3})?)(?![\d.])"
    r" ?(?:(?:and|then|turned|rotated|at|by|with|on|is|to)\b|([a-z%\"'\u2032\u2033\u00b0]{1,12}))?",
)
_UNIT = re.compile(
    r"(?i)[)\]] ?(?:in )?([cm]?m|(?:centi|milli)?met(?:er|re)s?|inch(?:es)?|ft|feet|px|units?)\b",
)
_CM = {"": 1.0, "cm": 1.0, "mm": 0.1, "m": 100.0}
_LONG = re.compile(r"(?<=^[cm])(?:enti|illi)|et(?:er|re)s?$")  # What a short unit leaves out.
_DEGREES = {"", "deg", "degree", "\u00b0"}


def _step(text: str, *, free: bool) -> PoseStep | _StepProblem:
    """Read a block, its place and its rotation out of the text of a step."""
    block = _BLOCK.search(text)
    rest = _OTHERS.sub(" ", text[block.end() :]) if block else ""
    found = [(m[1] or "", float(m[2]), (m[3] or "").lower()) for m in _VALUE.finditer(rest)]
    names = [name.lower() for name, *_ in found]
    is_named = names in ([*_NAMES[:3]], [*_NAMES], [*"xyzxyz"])
    if block is None or len(found) not in (3, 6) or (any(names) and not is_named):
        return "unclear_step"
    behind = _UNIT.search(rest)
    units = {unit for *_, unit in found[:3] if unit} or {behind[1].lower() if behind else ""}
    units = {_LONG.sub("", unit) for unit in units}
    turned = {unit.rstrip("s") for *_, unit in found[3:]}
    if len(units) > 1 or not units <= _CM.keys() or not turned <= _DEGREES:
        return "other_unit"
    numbers = [value for _, value, _ in found]
    place = [value * scale for scale in map(_CM.__getitem__, units) for value in numbers[:3]]
    return _checked(int(block[1] or block[2]), place, numbers[3:], free=free)


def _checked(
    block: int, place: Sequence[float], turn: Sequence[float], *, free: bool
) -> PoseStep | _StepProblem:
    """Return a step of finite numbers that a table has room for, turned where that is asked."""
    if not all(map(math.isfinite, (*place, *turn))):
        return "unclear_step"
    if max(map(abs, place)) > FARTHEST_PLACE_CM or max(map(abs, turn), default=0) > MOST_TURN_DEG:
        return "out_of_range"
    x, y, z = place
    if not free:
        return "turned" if any(turn) else PoseStep(block, (x, y, z))
    return PoseStep(block, (x, y, z), (turn[0], turn[1], turn[2])) if turn else "missing_rotation"


def _json_step(item: Any, *, free: bool) -> PoseStep | _StepProblem:
    block = whole_number(item.get("block")) if isinstance(item, dict) else None
    found = [] if block is None else [item[name] for name in _NAMES if name in item]
    is_whole = len(found) in (3, 6) and {"block", *_NAMES[: len(found)]} == {*item}
    if block is None or not is_whole or any(type(one) not in (int, float) for one in found):
        return "unclear_step"
    numbers = [float(max(-(10**9), min(one, 10**9))) for one in found]
    return _checked(block, numbers[:3], numbers[3:], free=free)
