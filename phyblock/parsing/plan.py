"""Reply text -> Plan, with the rule that matched.

`official` is the released code's rule: every `block with index N` of the whole reply, in order.
`steps`, the default, reads the last well-formed step list first and grows lenient after that.
Both drop numbers that no candidate has and report them. Neither raises on any text, and every
index of a plan is a number that stands in the text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, get_args

from phyblock.domain import Plan

__all__ = ["PLAN_PARSERS", "ParsedPlan", "PlanParser", "parse_plan"]

PlanParser = Literal["steps", "official"]
PLAN_PARSERS: tuple[PlanParser, ...] = get_args(PlanParser)


@dataclass(frozen=True)
class ParsedPlan:
    """What was read out of a reply.

    `rule` names the rule that matched, None when nothing could be read (a parse failure);
    `dropped` are the numbers that were read but name no candidate, in order.
    """

    plan: Plan
    rule: str | None
    dropped: tuple[int, ...] = ()


def parse_plan(text: str, n_candidates: int, parser: PlanParser = "steps") -> ParsedPlan:
    """Read the plan out of a reply to a question with candidates 1..n_candidates."""
    for rule, find in _RULES[parser]:
        numbers = find(text)
        if numbers:
            kept = tuple(n for n in numbers if 1 <= n <= n_candidates)
            dropped = tuple(n for n in numbers if not 1 <= n <= n_candidates)
            return ParsedPlan(Plan(kept), rule, dropped)
    return ParsedPlan(Plan(), None)


# Longer runs of digits are no block numbers, and int() refuses thousands of digits.
_NUMBER = r"(\d{1,6})(?!\d)"
_OFFICIAL = re.compile(r"block with index " + _NUMBER)
_THINKING_ENDS = re.compile(r"</think(?:ing)?>", re.IGNORECASE)
_STEP_HEAD = re.compile(
    r"(?:^[ \t>*+\-\"'`_#({]{0,16}|[{,;][\s\"'*]{0,16}|[\"'][^\"'\n:]{1,40}[ _-])"
    r"(?P<at>)step[\s_#]{0,3}(\d{1,3})(?!\d)[\"'*`_ ]{0,6}(?:[:.)=\-\u2013\u2014]|(?=\s))",
    re.IGNORECASE | re.MULTILINE,
)
_LIST_HEAD = re.compile(r"^[ \t>*+\-]{0,8}(?P<at>)(\d{1,3})[.):]", re.MULTILINE)
_NUMBERS = _NUMBER + r"((?:\s{0,3}(?:,|&|and)\s{0,3}\d{1,6}(?!\d)){0,15})(?!\s{0,3},?\s{0,3}or\b)"
_INDEX = r"\bind(?:ex(?:es)?|ices)\b[^\w\n]{0,6}" + _NUMBERS
_ANY_INDEX = re.compile(_INDEX, re.IGNORECASE)
_MOVE_INDEX = re.compile(
    r"\b(?:move|place|put|add|stack|position|use)\b[^\n]{0,120}?" + _INDEX, re.IGNORECASE
)
_LOOSE = re.compile(
    r"\b(?:move|place|put|use|add|block|index|id)s?\b[^\w\n]{0,6}"
    r"(?:(?:the|block|with|index|number|no\.?) ){0,4}[^\w\n]{0,6}" + _NUMBERS,
    re.IGNORECASE,
)
_ARRAY = re.compile(
    r"\[\s{0,9}(?:[\"']?\d{1,6}[\"']?\s{0,9},\s{0,9}){0,63}[\"']?\d{1,6}[\"']?\s{0,9}\]"
)
_DIGITS = re.compile(r"\d{1,6}(?!\d)")
_ITEM_CHARS = 400

# Between two lists: a short heading that names a part ("Right structure:") means that both belong
# to one plan, unless it announces another version of that plan.
_HEADING_CHARS = 80
_MARKUP = re.compile(r"`{3}\w*|[^\w\s]|^\s*(?:json|plaintext|text)\s*$", re.MULTILINE)
_PART = re.compile(
    r"structure|\b(?:left|right|cent(?:er|re)|middle|part|section|component|side|tower|building"
    r"|house|second|third|[2-9])\b",
    re.IGNORECASE,
)
_REVISION = re.compile(
    r"final|correct|revis|updat|actual|alternat|summar|option|complete|overall|optimi|improv"
    r"|\b(?:instead|answer|again|better|so|thus|therefore|wait|or)\b",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class _List:
    """A numbered list that names blocks: where it stands in the text, and the numbers."""

    start: int
    end: int
    numbers: list[int]


def _answer(text: str) -> str:
    """What follows the last closing tag of a reasoning section, or the whole text."""
    ends = list(_THINKING_ENDS.finditer(text))
    tail = text[ends[-1].end() :] if ends else ""
    return tail if tail.strip() else text


def _numbers(match: re.Match[str]) -> list[int]:
    return [int(match.group(1)), *(int(digits) for digits in _DIGITS.findall(match.group(2)))]


def _lists(text: str, head: re.Pattern[str], item: re.Pattern[str]) -> Iterator[_List]:
    """Runs of items numbered 0 or 1, 2, 3, ... of which at least one names a block."""
    heads = list(head.finditer(text))
    starts = [match.start() for match in heads] + [len(text)]
    run: _List | None = None
    expected = 0
    for match, start, following in zip(heads, starts, starts[1:], strict=False):
        number = int(match.group(2))
        named = item.search(text, match.end(), min(following, match.end() + _ITEM_CHARS))
        if run is None or number != expected:
            if run is not None and run.numbers:
                yield run
            run = _List(match.start("at"), start, []) if number <= 1 else None
        if run is not None:
            line_end = text.find("\n", match.end(), following)
            end = line_end if line_end >= 0 else following
            run = _List(run.start, end, run.numbers + (_numbers(named) if named else []))
        expected = number + 1
    if run is not None and run.numbers:
        yield run


def _last_list(text: str, head: re.Pattern[str], item: re.Pattern[str]) -> list[int]:
    """Numbers of the last list, with those right before it that are parts of the same plan."""
    text = _answer(text)
    numbers: list[int] = []
    end = 0
    for found in _lists(text, head, item):
        joined = numbers and _are_parts(text[end : found.start])
        numbers = [*numbers, *found.numbers] if joined else found.numbers
        end = found.end
    return numbers


def _are_parts(between: str) -> bool:
    if len(between) > 4 * _HEADING_CHARS:
        return False
    heading = [line for line in _MARKUP.sub(" ", between).splitlines() if line.strip()]
    short = len(heading) == 1 and len(heading[0].strip()) <= _HEADING_CHARS
    named = short and _PART.search(heading[0]) is not None
    return named and not _REVISION.search(heading[0])


def _step_list(text: str) -> list[int]:
    return _last_list(text, _STEP_HEAD, _ANY_INDEX)


def _loose_steps(text: str) -> list[int]:
    return _last_list(text, _STEP_HEAD, _LOOSE)


def _numbered_list(text: str) -> list[int]:
    return _last_list(text, _LIST_HEAD, _MOVE_INDEX)


def _loose_numbered(text: str) -> list[int]:
    return _last_list(text, _LIST_HEAD, _LOOSE)


def _moves(text: str) -> list[int]:
    return [n for match in _MOVE_INDEX.finditer(_answer(text)) for n in _numbers(match)]


def _array(text: str) -> list[int]:
    arrays = list(_ARRAY.finditer(_answer(text)))
    return [int(digits) for digits in _DIGITS.findall(arrays[-1].group())] if arrays else []


def _official(text: str) -> list[int]:
    return [int(match.group(1)) for match in _OFFICIAL.finditer(text)]


_Rule = tuple[str, Callable[[str], list[int]]]
_RULES: dict[PlanParser, tuple[_Rule, ...]] = {
    "steps": (
        ("step_list", _step_list),
        ("loose_step_list", _loose_steps),
        ("numbered_list", _numbered_list),
        ("moves", _moves),
        ("loose_numbered_list", _loose_numbered),
        ("array", _array),
    ),
    "official": (("block_with_index", _official),),
}
