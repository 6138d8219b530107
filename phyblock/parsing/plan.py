"""Parsers from reply text to a plan, with the rule that matched, or a named problem.

`official` is the released code's rule: every `block with index N` of the whole reply, in order.
`steps`, the default, reads the requested form with any decoration: JSON, else step lines, else a
list whose items each name a block, else a bracketed list of numbers after a word like "plan". The
last complete list counts, and text around it changes nothing. Both parsers drop numbers that no
candidate has and report them. `parse_poses` reads plans with poses. None raises on any text.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, Literal

from phyblock.domain.scene import Plan, PoseStep
from phyblock.parsing.text import AnswerForm, answer_of, is_open, plain_lines, whole_number
from phyblock.types import PlanParser

_REPLIES_KEPT = 1024  # Cached replies: rules, and models at several seeds, often give the same one.

PlanProblem = Literal["empty", "thoughts_only", "no_plan"]


@dataclass(frozen=True)
class ParsedPlan:
    """A plan that was parsed from a reply.

    `rule` names its form; if nothing could be parsed it is None, and `problem` is the reason.
    `dropped` are numbers without a candidate; `truncated` is true if the text breaks off.
    """

    plan: Plan
    rule: str | None
    dropped: tuple[int, ...] = ()
    problem: PlanProblem | None = None
    truncated: bool = False


@lru_cache(_REPLIES_KEPT)
def parse_plan(text: str, n_candidates: int, parser: PlanParser = "steps") -> ParsedPlan:
    """Parse the plan from a reply to a question with candidates 1..n_candidates."""
    if parser == "official":
        numbers = [int(match[1]) for match in _OFFICIAL.finditer(text)]
        rule, is_cut = "block_with_index", False
    else:
        if (answer := answer_of(text)) is None:
            return ParsedPlan(Plan(), None, problem="thoughts_only")
        rule, numbers, is_cut = _steps(answer, n_candidates)
    if not numbers:
        return ParsedPlan(Plan(), None, problem="no_plan" if text.strip() else "empty")
    kept = tuple(n for n in numbers if 1 <= n <= n_candidates)
    dropped = tuple(n for n in numbers if not 1 <= n <= n_candidates)
    return ParsedPlan(Plan(kept), rule, dropped, truncated=is_cut)


def plan_form(n_candidates: int) -> AnswerForm[list[int]]:
    """Return the JSON form of a plan: numbers of candidates 1 to `n_candidates`, in order."""
    number = {"type": "integer", "enum": list(range(1, n_candidates + 1))}
    return AnswerForm("plan", {"type": "array", "items": number}, _json_plan, "[N, N, ...]")


# Longer runs of digits are not block numbers, and int() refuses thousands of digits.
_OFFICIAL = re.compile(r"block with index (\d{1,6})(?!\d)")
_KEYS = ("block", "index", "block_index", "candidate", "id")


def _json_plan(value: Any) -> list[int] | None:
    items = value if isinstance(value, list) else [None]
    named = [
        next((item[key] for key in _KEYS if key in item), None) if isinstance(item, dict) else item
        for item in items
    ]
    numbers = [number for number in map(whole_number, named) if number is not None]
    return numbers if len(numbers) == len(items) else None


def _steps(answer: str, n_candidates: int) -> tuple[str, list[int], bool]:
    """Return the rule, the numbers of the plan, and True if the text breaks off in it."""
    if "{" in answer and (stated := plan_form(n_candidates).read(answer)):
        return "json", stated, False
    lines, is_cut = plain_lines(answer), is_open(answer)
    can_grow = is_cut and answer.rstrip()[-1:].isdigit()
    found: list[tuple[str, list[int], bool]] = []
    for rule, lists in _forms(lines):
        for one in lists:
            one.values = [number for item in one.items for number in item.blocks]
        if can_grow and lists and lists[-1].ends_text(lines):
            _drop_growing(lists[-1].values, n_candidates)
        numbers, is_begun = chosen_list(lists, lines, is_open=is_cut)
        found += [(rule, numbers, is_begun)] * bool(numbers)
        if numbers and not is_begun:
            break
    if found:  # A list that was started again in another form may be complete above.
        goes_on = not found[-1][2] and found[-1][1][: len(found[0][1])] == found[0][1]
        return found[-1] if goes_on else found[0]
    numbers = _numbers(lines)
    if can_grow:
        _drop_growing(numbers, n_candidates)
    return "numbers", numbers, is_cut


def _forms(lines: list[str]) -> Iterator[tuple[str, list[StepList]]]:
    yield "steps", step_lists(lines)
    for lists in item_lists(lines):
        yield "list", lists


def _drop_growing(numbers: list[int], n_candidates: int) -> None:
    """Drop the last number if another digit may have followed."""
    if numbers and 10 * numbers[-1] <= n_candidates:
        numbers.pop()


_WORDS = r"\b(?:block|candidate|piece|index(?:es)?|indices|idx|number|no|id)s?\.?"
_NAMED = re.compile(rf"(?:{_WORDS}[ :=#\"'(\[{{<-]{{0,6}}|#)(\d{{1,6}})(?!\w|\.\d)", re.I)
_MORE = re.compile(
    r"(?i) ?(?:\([^()\n]{0,80}\) ?)?(?:, ?and |, ?|& ?|\+ ?|and )(?:(?:the|another) )?"
    rf"(?:(?:{_WORDS}|#) ?){{0,3}}(\d{{1,6}})(?![\w/]|\.\d| [a-z]+s\b)"
)
_VERB = r"(?:move|place|put|add|set|position|stack|insert|use|take|attach|lay|pick)\b"
_BARE = re.compile(
    rf"(?i)\W{{0,9}}(?:{_VERB})?[^\w\n]{{0,9}}(\d{{1,6}})(?!\w|\.\d)\W{{0,3}}(?:[(|].{{0,200}})?\Z"
    r"|[^\d\n]{1,200}[(\[{]#?(\d{1,6})[)\]}][^\d\n]{0,200}\Z"
)
_TIMES = re.compile(
    r"(?i)\btwice\b|(?<!\w)(?<![\d.] )[x\u00d7] ?([2-9])(?=\)|\W{0,9}\Z)"
    rf"|([2-9]) ?[x\u00d7] ?(?={_WORDS}|#)"
)


@dataclass
class Item:
    """A step or an item of a list; `span` is the number of steps that it stands for."""

    number: int | None
    span: int
    text: str
    line: int
    more: list[str] = field(default_factory=list)  # Lines under it that belong to it.

    @cached_property
    def blocks(self) -> list[int]:
        """The numbers of the blocks that it places, in order."""
        if not (found := _blocks(self.text)):
            below = _ACTS.match if _WORD.search(self.text) else _WORD.search
            found = [number for line in filter(below, self.more) for number in _blocks(line)]
        return found * self.span if len(found) == 1 else found


def _blocks(text: str) -> list[int]:
    if (first := _NAMED.search(text)) is None:
        bare = _BARE.match(text)
        return [int(bare[1] or bare[2])] if bare else []
    found, end = [int(first[1])], first.end()
    while more := _MORE.match(text, end):
        found.append(int(more[1]))
        end = more.end()
    times = _TIMES.search(text) if len(found) == 1 else None
    return found * int(times[1] or times[2] or 2) if times else found


# --- lists of steps ---

_LABEL = re.compile(r"(?<![\w\n])(?=steps?[ #-]{0,3}\d{1,4}[\"')\]]{0,2} ?[:=])", re.I)
_STEP = re.compile(
    r"(?i)[^\w\n]{0,20}(?:\d{1,3}[.)]\W{0,9})?steps?[ #-]{0,3}(\d{1,4})"
    r"((?: ?(?:, ?and|&|and|to|,|[-\u2013]) ?(?:step ?)?\d{1,4}){0,9})(?!\w)"
    r"[\"')\]]{0,3}\s{0,9}[:.)=|>,\u2013-]{0,3}(.*)"
)
_ITEM = re.compile(
    r"(?i)[\s>]{0,40}(?:[-*\u2022+|]\s{0,9})?\(?(\d{1,3})\s?[.):|\]]\s{0,9}(.*)"
    rf"|[\s>]{{0,40}}[-*\u2022+]\s{{1,9}}(.*)|[\s>]{{0,40}}({_VERB}.*)"
)
_ACTS = re.compile(rf"[\W\d]{{0,20}}{_VERB}", re.I)
_WORD = re.compile(r"[^\W\d]")
_BLANK = re.compile(r"[\W\d]*+(?:json|plaintext|text|yaml)?[\W\d]*+\Z")
_NEAR = 40  # Lines that are examined under an item and above a list.


@dataclass
class StepList:
    """Consecutive items, the titles above them, and their parsed values."""

    items: list[Item]
    titles: list[str]
    values: list[Any] = field(default_factory=list)

    @property
    def title(self) -> str:
        """The last line of text above."""
        return self.titles[0] if self.titles else ""

    def ends_text(self, lines: Sequence[str]) -> bool:
        """True if nothing follows the last item."""
        last = self.items[-1]
        return all(map(_BLANK.match, lines[last.line + 1 + len(last.more) :]))


def step_lists(lines: list[str]) -> list[StepList]:
    """Return the runs of step lines with continuous numbering, whatever is between them."""
    lines[:] = _LABEL.sub("\n", "\n".join(lines)).split("\n")
    runs: list[list[Item]] = []
    end = 0
    for at, line in enumerate(lines):
        if step := _STEP.match(line):
            number, *others = map(int, (step[1], *re.findall(r"\d+", step[2])))
            if not runs or number <= end:
                runs.append([])
            end = max([number, *others[-1:]])
            runs[-1].append(Item(number, min(end - number + 1, 20), step[3], at))
    for run in runs:
        ends = [item.line for item in run[1:]] + [len(lines)]
        for item, end in zip(run, ends, strict=True):
            for line in lines[item.line + 1 : min(end, item.line + _NEAR)]:
                if line.startswith("#") or (_WORD.match(line) and _WORD.search(item.text)):
                    break
                item.more.append(line)
    return _with_titles(runs, lines)


def item_lists(lines: list[str]) -> tuple[list[StepList], list[StepList]]:
    """Return the numbered lists and the lists without numbers that place blocks."""
    numbered: list[list[Item]] = []
    others: list[list[Item]] = []
    for at, line in enumerate(lines):
        if (match := _ITEM.match(line)) is None:
            continue
        item = Item(int(match[1] or 0) or None, 1, match[2] or match[3] or match[4] or "", at)
        runs = numbered if item.number else others
        last = runs[-1][-1] if runs else None
        if not last or (
            item.number != last.number + 1
            if item.number and last.number
            else any(map(_WORD.search, lines[last.line + 1 : at]))
        ):
            runs.append([])
        runs[-1].append(item)
    counted, bare = (
        [
            one
            for one in _with_titles(runs, lines)
            if not one.title
            or _PLAN.search(one.title)
            or all(_ACTS.match(item.text) for item in one.items)
        ]
        for runs in (numbered, others)
    )
    return counted, [one for one in bare if len(one.items) > 1 or _HEADING.search(one.title)]


def _with_titles(runs: list[list[Item]], lines: list[str]) -> list[StepList]:
    """Return the lists in which at least half the items name a block, with up to three titles."""
    found: list[StepList] = []
    for items in runs:
        if sum(bool(item.blocks) for item in items) * 2 >= len(items):
            first = found[-1].items[-1].line + 1 if found else 0
            above = lines[max(first, items[0].line - _NEAR) : items[0].line]
            titles = [line.strip() for line in reversed(above) if not _BLANK.match(line)]
            found.append(StepList(items, titles[:3]))
    return found


# --- the plan among lists ---

_PART = re.compile(
    r"(?i)\b(?:left|right|structure|construction|configuration|layer|level|part|section|side|stage)\b"
)
_WHOLE = re.compile(
    r"(?i)\b(?:final|correct|revis|updat|improv|optimi|alternat|option|instead|again|whole|complete"
    r"|full|overall|combined|entire|summary|both)"
)
_PLAN = re.compile(
    r"\b(?:plan|order|sequence|assembl|steps?|instruction|answer|solution|output|result)", re.I
)
_EXPLAINS = re.compile(r"\b(?:expla|reason|rational|justif|note|verif|check)", re.I)
_HEADING = re.compile(r"\A#|\A[^,.!?]{1,60}:\W{0,9}\Z")
_FOR = re.compile(r"\bfor\b", re.I)


def chosen_list(
    lists: Sequence[StepList], lines: Sequence[str], *, is_open: bool
) -> tuple[list[Any], bool]:
    """Return the values of the last complete plan, and True if the text breaks off in it.

    Lists that restart under titles of parts (a structure, a layer) are one plan. A list that breaks
    off is ignored if it repeats the beginning of the plan before it.
    """
    plans: list[list[StepList]] = []
    goes_on, end = True, 0
    for one in lists:
        is_apart = goes_on or one.items[0].line > end + 1
        goes_on, end = is_apart and one.items[0].number in (None, 0, 1), one.items[-1].line
        if goes_on and plans and _is_part(one, plans[-1]):
            plans[-1].append(one)
        elif goes_on and not (plans and _EXPLAINS.search(one.title)):
            plans.append([one])
    plans = plans or [[one] for one in lists[-1:]]
    if not plans:
        return [], False
    *before, values = [[value for one in plan for value in one.values] for plan in plans]
    last = plans[-1][-1]
    is_begun = not any(map(str.strip, lines[last.items[-1].line + 1 :]))
    is_cut = (is_open and last.ends_text(lines)) or (is_begun and not last.items[-1].blocks)
    if is_cut and before and values == before[-1][: len(values)]:
        return before[-1], False
    return values, is_cut


def _is_part(one: StepList, plan: list[StepList]) -> bool:
    """True if a list that restarts continues a plan, since it builds something else."""
    titles = [part.title for part in plan]
    is_anew = any(_WHOLE.search(title) or _EXPLAINS.search(title) for title in one.titles)
    if is_anew or len(one.title) > 80 or (one.title and one.title in titles):
        return False
    if _PART.search(one.title) or (_FOR.search(one.title) and _FOR.search(titles[-1])):
        return len(plan) == 1 or plan[0].values != one.values
    if one.title and (_PLAN.search(one.title) or not _HEADING.search(one.title)):
        return False
    if not one.title and ('"' in one.items[0].text) != ('"' in plan[-1].items[0].text):
        return False  # The same plan again, in another form.
    n_same = min(len(plan[0].values), len(one.values))
    return plan[0].values[:n_same] != one.values[:n_same]


_SEQUENCE = r"(\d{1,6}+(?:(?:[\s,;\"'#>\u2192-]|block|index){1,9}+\d{1,6}+){1,64}+)[\s)\]\"'.,}]*+"
_NUMBERS = re.compile(
    r"(?i)\b(?:plan|order|sequence|steps|answer|solution|assembly)\b([^\d\n]{0,60}+)"
    rf"{_SEQUENCE}(?:\(.*)?\Z"
)
_ALONE = re.compile(rf"\W{{0,9}}+{_SEQUENCE}\Z")


def _numbers(lines: list[str]) -> list[int]:
    """Return the last list of numbers after a word for a plan, or that is the whole reply."""
    with_digits = [line for line in lines if re.search(r"\d", line)]
    for line in reversed(with_digits):
        found = _NUMBERS.search(line)
        if found and re.search(r"(?:[:=>\[(]|\bis)\W*\Z", found[1]):
            return [int(digits) for digits in re.findall(r"\d+", found[2])]
    alone = _ALONE.match(with_digits[0]) if len(with_digits) == 1 else None
    return [int(digits) for digits in re.findall(r"\d+", alone[1])] if alone else []


# --- plans with poses ---

MOST_POSE_STEPS = 100  # Longer plans are not executed: no goal has a quarter of it.
FARTHEST_PLACE_CM = 1000.0  # Coordinates beyond this are no place on a table.

_StepProblem = Literal["unclear_step", "other_unit", "out_of_range"]
PoseProblem = Literal["empty", "thoughts_only", "no_plan", "too_many_steps", _StepProblem]
_AXES = ("x", "y", "z")


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
        "properties": {"block": number, **{name: {"type": "number"} for name in _AXES}},
        "required": ["block", *_AXES],
        "additionalProperties": False,
    }
    shown = ", ".join(f'"{name}": {name.upper()}' for name in _AXES)
    value = {"type": "array", "items": step}

    def meaning(value: Any) -> list[PoseStep | _StepProblem] | None:
        return [_json_step(item) for item in value] if isinstance(value, list) else None

    return AnswerForm("plan", value, meaning, f'[{{"block": N, {shown}}}, ...]')


def parse_poses(text: str, n_candidates: int) -> ParsedPoses:
    """Parse the plan with poses from a reply; numbers that no candidate has stay in it.

    It is JSON of the requested form, else the last list of step lines, items or table rows, each
    with a block and coordinates. It is read whole or not at all: without a step it is another plan.
    """
    if not (answer := answer_of(text)):
        return ParsedPoses((), None, "empty" if answer == "" else "thoughts_only")
    rule, steps = "json", pose_form(n_candidates).read(answer) or []
    if not steps:
        lines = plain_lines(answer)
        rule, lists = "steps", step_lists(lines)
        if not lists:
            rule, lists = "list", [one for kind in item_lists(lines) for one in kind]
        for one in lists:
            one.values = [_pose_step(" ".join([item.text, *item.more])) for item in one.items]
        steps, _ = chosen_list(lists, lines, is_open=is_open(answer))
    good = tuple(step for step in steps if isinstance(step, PoseStep))
    bad = [step for step in steps if not isinstance(step, PoseStep)]
    problem: PoseProblem | None = bad[0] if bad else None if good else "no_plan"
    if len(steps) > MOST_POSE_STEPS:
        problem = "too_many_steps"
    return ParsedPoses((), None, problem) if problem else ParsedPoses(good, rule)


_BLOCK = re.compile(
    r"(?i)\b(?:block|candidate|index|number|id)\b[ #:=\"']{0,4}(?:with index )?(-?\d{1,6})(?![.\d])"
    r"|\W{0,9}(-?\d{1,6})(?![.,]?\d)"
)
_OTHERS = re.compile(r"\b(?:block|step|candidate|layer|level)s? ?#?\d{1,6}(?![.\d])", re.I)
_VALUE = re.compile(
    r"(?i)(?:(?<![a-z])([xyz])\"? ?[=:] ?)?(?<![\w.])"
    r"([+-]?(?:\d{1,9}(?:\.\d{0,12})?|\.\d{1,9})(?:e[+-]?\d{1,3})?)(?![\d.])"
    r" ?(?:(?:and|then|at|by|with|on|is|to)\b|([a-z%\"'\u2032\u2033]{1,12}))?"
)
_UNIT = re.compile(
    r"(?i)[)\]] ?(?:in )?([cm]?m|(?:centi|milli)?met(?:er|re)s?|inch(?:es)?|ft|feet|px|units?)\b"
)
_CM = {"": 1.0, "cm": 1.0, "mm": 0.1, "m": 100.0}
_LONG = re.compile(r"(?<=^[cm])(?:enti|illi)|et(?:er|re)s?$")  # What a short unit leaves out.


def _pose_step(text: str) -> PoseStep | _StepProblem:
    """Parse a block and its place from the text of a step."""
    block = _BLOCK.search(text)
    rest = _OTHERS.sub(" ", text[block.end() :]) if block else ""
    found = [(m[1] or "", float(m[2]), (m[3] or "").lower()) for m in _VALUE.finditer(rest)]
    names = [name.lower() for name, *_ in found]
    if block is None or len(found) != 3 or (any(names) and names != [*_AXES]):
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
    found = [] if block is None else [item.get(name) for name in _AXES]
    is_whole = block is not None and {"block", *_AXES} == {*item}
    if block is None or not is_whole or any(type(one) not in (int, float) for one in found):
        return "unclear_step"
    return _checked(block, [float(max(-(10**9), min(one, 10**9))) for one in found])
