"""Parser from reply text to a plan with poses, with the rule that matched, or a named problem.

A plan is JSON of the requested form, else the last list of step lines, items or table rows, each
with a block and three coordinates. It is read as a whole or not at all: a plan with a step missing
would be another plan.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

from phyblock.domain.scene import PoseStep
from phyblock.parsing.plan import chosen_list, item_lists, step_lists
from phyblock.parsing.text import AnswerForm, answer_of, is_open, plain_lines, whole_number

MOST_POSE_STEPS = 100  # Longer plans are not executed: no goal has a quarter of it.
FARTHEST_PLACE_CM = 1000.0  # Coordinates beyond this are no place on a table.

_StepProblem = Literal["unclear_step", "other_unit", "out_of_range"]
PoseProblem = Literal["empty", "thoughts_only", "no_plan", "too_many_steps", _StepProblem]
_NAMES = ("x", "y", "z")


@dataclass(frozen=True)
class ParsedPoses:
    """A plan that was parsed from a reply; if `rule` is None, `problem` is the reason."""

    steps: tuple[PoseStep, ...]
    rule: str | None
    problem: PoseProblem | None = None


def pose_form(n_candidates: int) -> AnswerForm[list[PoseStep | _StepProblem]]:
    """Return the JSON form of a plan with poses."""
    number = {"type": "integer", "enum": list(range(1, n_candidates + 1))}
    step = {
        "type": "object",
        "properties": {"block": number, **{name: {"type": "number"} for name in _NAMES}},
        "required": ["block", *_NAMES],
        "additionalProperties": False,
    }
    shown = ", ".join(f'"{name}": {name.upper()}' for name in _NAMES)
    value = {"type": "array", "items": step}

    def meaning(value: Any) -> list[PoseStep | _StepProblem] | None:
        is_list = isinstance(value, list)
        return [_json_step(item) for item in value] if is_list else None

    return AnswerForm("plan", value, meaning, f'[{{"block": N, {shown}}}, ...]')


def parse_poses(text: str, n_candidates: int) -> ParsedPoses:
    """Parse the plan from a reply; numbers that no candidate has stay in it."""
    answer = answer_of(text)
    if not answer:
        return ParsedPoses((), None, "empty" if answer == "" else "thoughts_only")
    rule, steps = "json", pose_form(n_candidates).read(answer) or []
    if not steps:
        lines = plain_lines(answer)
        rule, lists = "steps", step_lists(lines)
        if not lists:
            rule, lists = "list", [one for kind in item_lists(lines) for one in kind]
        for one in lists:
            one.values = [_step(" ".join([item.text, *item.more])) for item in one.items]
        steps, _ = chosen_list(lists, lines, is_open=is_open(answer))
    good = tuple(step for step in steps if isinstance(step, PoseStep))
    bad = [step for step in steps if not isinstance(step, PoseStep)]
    problem: PoseProblem | None = bad[0] if bad else None if good else "no_plan"
    if len(steps) > MOST_POSE_STEPS:
        problem = "too_many_steps"
    return ParsedPoses((), None, problem) if problem else ParsedPoses(good, rule)


_BLOCK = re.compile(
    r"(?i)\b(?:block|candidate|index|number|id)\b[ #:=\"']{0,4}(?:with index )?(-?\d{1,6})(?![.\d])"
    r"|\W{0,9}(-?\d{1,6})(?![.,]?\d)",
)
_OTHERS = re.compile(r"\b(?:block|step|candidate|layer|level)s? ?#?\d{1,6}(?![.\d])", re.I)
_VALUE = re.compile(
    r"(?i)(?:(?<![a-z])([xyz])\"? ?[=:] ?)?(?<![\w.])"
    r"([+-]?(?:\d{1,9}(?:\.\d{0,12})?|\.\d{1,9})(?:e[+-]?\d{1,3})?)(?![\d.])"
    r" ?(?:(?:and|then|at|by|with|on|is|to)\b|([a-z%\"'\u2032\u2033]{1,12}))?",
)
_UNIT = re.compile(
    r"(?i)[)\]] ?(?:in )?([cm]?m|(?:centi|milli)?met(?:er|re)s?|inch(?:es)?|ft|feet|px|units?)\b",
)
_CM = {"": 1.0, "cm": 1.0, "mm": 0.1, "m": 100.0}
_LONG = re.compile(r"(?<=^[cm])(?:enti|illi)|et(?:er|re)s?$")  # What a short unit leaves out.


def _step(text: str) -> PoseStep | _StepProblem:
    """Parse a block and its place from the text of a step."""
    block = _BLOCK.search(text)
    rest = _OTHERS.sub(" ", text[block.end() :]) if block else ""
    found = [(m[1] or "", float(m[2]), (m[3] or "").lower()) for m in _VALUE.finditer(rest)]
    names = [name.lower() for name, *_ in found]
    if block is None or len(found) != 3 or (any(names) and names != [*_NAMES]):
        return "unclear_step"
    behind = _UNIT.search(rest)
    units = {unit for *_, unit in found if unit} or {behind[1].lower() if behind else ""}
    units = {_LONG.sub("", unit) for unit in units}
    if len(units) > 1 or not units <= _CM.keys():
        return "other_unit"
    place = [value * _CM[unit] for unit in units for _, value, _ in found]
    return _checked(int(block[1] or block[2]), place)


def _checked(block: int, place: Sequence[float]) -> PoseStep | _StepProblem:
    """Return the step, or a problem if its numbers are not finite or too large."""
    if not all(map(math.isfinite, place)):
        return "unclear_step"
    if max(map(abs, place)) > FARTHEST_PLACE_CM:
        return "out_of_range"
    x, y, z = place
    return PoseStep(block, (x, y, z))


def _json_step(item: Any) -> PoseStep | _StepProblem:
    block = whole_number(item.get("block")) if isinstance(item, dict) else None
    found = [] if block is None else [item.get(name) for name in _NAMES]
    is_whole = block is not None and {"block", *_NAMES} == {*item}
    if block is None or not is_whole or any(type(one) not in (int, float) for one in found):
        return "unclear_step"
    return _checked(block, [float(max(-(10**9), min(one, 10**9))) for one in found])
