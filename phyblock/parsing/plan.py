"""Reply text -> Plan, with the rule that matched.

`official` is the released code's rule: every `block with index N` of the whole reply, in order.
`steps`, the default, reads the last well-formed step list first and grows lenient after that.
Both drop numbers that no candidate has and report them. Neither raises on any text, and every
index of a plan is a number that stands in the text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

from phyblock.domain import Plan
from phyblock.parsing.text_forms import after_reasoning
from phyblock.words import PlanParser

__all__ = ["ParsedPlan", "parse_plan"]


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
    answer = text if parser == "official" else after_reasoning(text)
    for rule, find in _RULES[parser]:
        numbers = find(answer)
        if numbers:
            kept = tuple(n for n in numbers if 1 <= n <= n_candidates)
            dropped = tuple(n for n in numbers if not 1 <= n <= n_candidates)
            return ParsedPlan(Plan(kept), rule, dropped)
    return ParsedPlan(Plan(), None)


# Longer runs of digits are no block numbers, and int() refuses thousands of digits.
_NUMBER = r"(\d{1,6})(?!\d)"
_OFFICIAL = re.compile(r"block with index " + _NUMBER)
# A head inside a line (one-line JSON) needs a colon or the like after it: "on top of block 3,
# step 2 being done" holds none. "Step 2 & 3:" is a head for two steps.
_STEP_HEAD = re.compile(
    r"(?:(?P<line>^[ \t>*+\-\"'`_#({]{0,16})"
    r"|[{,;][\s\"'*]{0,16}|[\"'][^\"'\n:]{1,40}:?[ _-])"
    r"(?P<at>)step[\s_#]{0,3}(?P<number>\d{1,3})(?!\d)"
    r"(?: ?(?:&|and|to|-|\u2013) ?(?P<last>\d{1,3})(?![\w.]))?"
    r"[\"'*`_ ]{0,6}(?:[:.)=\-\u2013\u2014\uff1a]|(?(line)(?=\s)|(?!)))",
    re.IGNORECASE | re.MULTILINE,
)
_LIST_HEAD = re.compile(r"^[ \t>*+\-]{0,8}(?P<at>)(?P<number>\d{1,3})[.):\uff1a]", re.MULTILINE)
# "1, 2 and 3" are three numbers; of alternatives ("1, 2 or 3", "1/2/3") the first one counts.
_MORE = r"(?:\s{0,3}(?:, and|,|&|and)\s{0,3}\d{1,6}(?!\d)){0,15}"
_NUMBERS = _NUMBER + rf"((?!{_MORE}\s{{0,3}},?\s{{0,3}}or\b){_MORE})?"
_INDEX = r"\bind(?:ex(?:es)?|ices)\b[^\w\n]{0,6}" + _NUMBERS
_ANY_INDEX = re.compile(_INDEX, re.IGNORECASE)
_MOVE_INDEX = re.compile(
    r"\b(?:move|place|put|add|stack|position|use)\b[^\n]{0,120}?" + _INDEX, re.IGNORECASE
)
# "Move 4 blue cubes" counts blocks and names none.
_LOOSE = re.compile(
    r"\b(?:move|place|put|use|add|block|index|id)s?\b[^\w\n]{0,6}"
    r"(?:(?:the|block|with|index|number|no\.?) ){0,4}[^\w\n]{0,6}"
    + _NUMBERS
    + r"(?!\s{1,3}(?:\w{1,20}\s){0,2}(?:block|cube|cuboid|cylinder|arche|prism|triangle|piece)s\b)",
    re.IGNORECASE,
)
_JSON_INDEX = re.compile(
    r"[\"'](?:(?:block|candidate)[_ -]?)?(?:index|idx|id|number|block|candidate)[\"']"
    r"\s{0,9}:\s{0,9}[\"']?" + _NUMBER,
    re.IGNORECASE,
)
_ARRAY = re.compile(
    r"\[\s{0,9}(?:[\"']?\d{1,6}[\"']?\s{0,9},\s{0,9}){0,63}[\"']?\d{1,6}[\"']?\s{0,9}\]"
)
_DIGITS = re.compile(r"\d{1,6}(?!\d)")
_ITEM_CHARS = 400
_MOST_STEPS_AT_ONCE = 22

# Between two lists: a short heading that names a part ("Right structure:"), or none, means that
# both belong to one plan, unless it announces another version of that plan.
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
_EXPLANATION = re.compile(r"expla(?:in|nation)|rationale|reasoning|justif", re.IGNORECASE)
_Relation = Literal["part", "explanation", "other"]


@dataclass
class _List:
    """A numbered list: where it stands, the block numbers it names, and those of its last item."""

    start: int
    end: int
    numbers: list[int]
    last: list[int]


def _numbers(match: re.Match[str]) -> list[int]:
    more = _DIGITS.findall(match.group(2) or "")
    return [int(match.group(1)), *(int(digits) for digits in more)]


def _lists(text: str, head: re.Pattern[str], item: re.Pattern[str]) -> Iterator[_List]:
    """Runs of items numbered 0 or 1, 2, 3, ... of which at least one names a block."""
    heads = list(head.finditer(text))
    starts = [match.start() for match in heads] + [len(text)]
    run: _List | None = None
    expected = 0
    for match, following in zip(heads, starts[1:], strict=True):
        number, steps = _steps_of(match)
        if run is None or number != expected:
            if run is not None and run.numbers:
                yield run
            run = _List(match.start("at"), 0, [], []) if number <= 1 else None
        if run is not None:
            line_end = text.find("\n", match.end(), following)
            run.end = line_end if line_end >= 0 else following
            named = item.search(text, match.end(), min(following, match.end() + _ITEM_CHARS))
            run.last = _numbers(named) if named else []
            run.numbers += run.last * (steps if len(run.last) == 1 else 1)
        expected = number + steps
    if run is not None and run.numbers:
        yield run


def _steps_of(head: re.Match[str]) -> tuple[int, int]:
    """Number of the first step that a head stands for, and of how many steps it is the head."""
    first = int(head["number"])
    last = int(head.groupdict().get("last") or first)
    return first, last - first + 1 if 0 <= last - first < _MOST_STEPS_AT_ONCE else 1


def _last_list(text: str, head: re.Pattern[str], item: re.Pattern[str]) -> _List | None:
    """The last list, with those right before it that are parts of the same plan."""
    plan: _List | None = None
    before: _List | None = None
    explains = False
    for found in _lists(text, head, item):
        relation = _relation(text, before, found) if before else "other"
        if plan is None or relation == "other":
            plan, explains = replace(found, numbers=list(found.numbers)), False
        elif relation == "explanation":
            explains = True
        elif not explains:
            plan.numbers += found.numbers
        before = found
    return plan


def _relation(text: str, before: _List, found: _List) -> _Relation:
    """What a list is to the one before it, by the text between them."""
    between = _MARKUP.sub(" ", text[before.end : found.start])
    heading = [line for line in between.splitlines() if line.strip()]
    title = heading[0].strip() if len(heading) == 1 else ""
    if len(heading) > 1 or len(title) > _HEADING_CHARS or _REVISION.search(title):
        return "other"
    if _EXPLANATION.search(title):
        return "explanation"
    # "Step 3: Determine the order" above a list names no block: it is a heading, not a part.
    part = _PART.search(title) if title else before.numbers != found.numbers
    return "part" if part and before.last else "other"


def _step_list(text: str) -> list[int]:
    steps = _last_list(text, _STEP_HEAD, _ANY_INDEX)
    if steps is None:
        return []
    # Headings such as "Step 3: Determine the order" can stand above the list that is meant.
    below = _last_list(text[steps.start :], _LIST_HEAD, _MOVE_INDEX)
    return [] if below and len(below.numbers) > len(steps.numbers) else steps.numbers


def _list_rule(head: re.Pattern[str], item: re.Pattern[str]) -> Callable[[str], list[int]]:
    def find(text: str) -> list[int]:
        found = _last_list(text, head, item)
        return found.numbers if found else []

    return find


def _moves(text: str) -> list[int]:
    return [n for match in _MOVE_INDEX.finditer(text) for n in _numbers(match)]


def _json_fields(text: str) -> list[int]:
    return [int(match.group(1)) for match in _JSON_INDEX.finditer(text)]


def _array(text: str) -> list[int]:
    arrays = list(_ARRAY.finditer(text))
    return [int(digits) for digits in _DIGITS.findall(arrays[-1].group())] if arrays else []


def _official(text: str) -> list[int]:
    return [int(match.group(1)) for match in _OFFICIAL.finditer(text)]


_Rule = tuple[str, Callable[[str], list[int]]]
_RULES: dict[PlanParser, tuple[_Rule, ...]] = {
    "steps": (
        ("step_list", _step_list),
        ("numbered_list", _list_rule(_LIST_HEAD, _MOVE_INDEX)),
        ("loose_step_list", _list_rule(_STEP_HEAD, _LOOSE)),
        ("moves", _moves),
        ("loose_numbered_list", _list_rule(_LIST_HEAD, _LOOSE)),
        ("json_fields", _json_fields),
        ("array", _array),
    ),
    "official": (("block_with_index", _official),),
}
