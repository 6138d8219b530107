"""Parser from reply text to one operation, `Move(3)` or `Done`, with the rule that matched.

The operation is JSON of the requested form, else the last line that is only an operation, else the
text after a label ("Next plan: Move(3)"), else the only one that is mentioned. `Done` counts only
as a whole answer, never as a word in a sentence. The parser never guesses between two operations.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal, get_args

from phyblock.parsing.text import AnswerForm, answer_of, plain_lines, whole_number

MoveProblem = Literal["empty", "thoughts_only", "no_move", "several_moves"]
MOVE_PROBLEMS: tuple[MoveProblem, ...] = get_args(MoveProblem)


@dataclass(frozen=True)
class ParsedMove:
    """A number, even of no candidate, `Done`, or a problem; without a `rule`, nothing was found."""

    move: int | None = None
    is_done: bool = False
    rule: str | None = None
    problem: MoveProblem | None = None


_NUMBER = r"([-+]?\d{1,6})(?!\d|[.,]\d)"
_CALL = (
    r"move ?[(\[] ?(?:(?:id|index|block|candidate|n)? ?[=:#] ?|(?:block|candidate|index) )?"
    rf"[\"'<]?{_NUMBER}[\"'>]? ?[)\]]|move (?:the )?(?:block|candidate) (?:with )?"
    rf"(?:(?:the )?(?:index|number|id) ?[:=#]? ?)?[#(\[\"']?{_NUMBER}[)\]\"']?"
)
_OPERATION = rf"(?:{_CALL}|(done)(?: ?\( ?\))?)"
_LABEL = (
    r"(?:[a-z]{1,12} ){0,3}(?:plan|step|answer|action|operation|move|output|decision|choice)"
    r"(?: ?#?\d{1,3})? ?(?:is|:|=|->|\u2192)\W{0,9}"
)
_LINE = re.compile(
    rf"(?i)\W{{0,20}}(?:{_LABEL})?{_OPERATION}\W{{0,9}}"
    rf"|\W{{0,20}}(?:{_LABEL})?(?:(?:move|block|candidate) ){{0,2}}{_NUMBER}\W{{0,9}}",
)
_LABELED = re.compile(rf"\b{_LABEL}{_OPERATION}(?!\w)", re.I)
_MENTION = re.compile(rf"\b(?:{_CALL})", re.I)


def move_form(n_candidates: int, *, reasons: bool = True) -> AnswerForm[ParsedMove]:
    """Return the JSON form of an operation: `Move(N)` or `Done`."""
    words = [*(f"Move({number})" for number in range(1, n_candidates + 1)), "Done"]
    value = {"type": "string", "enum": words}
    return AnswerForm("operation", value, _meaning, '"Move(N)"', reasons)


def parse_move(text: str) -> ParsedMove:
    """Parse the only operation in a reply."""
    answer = answer_of(text)
    if answer is None:
        return ParsedMove(problem="thoughts_only")
    if stated := move_form(0).read(answer):
        return stated
    lines = [line.strip() for line in plain_lines(answer) if line.strip()]
    if not lines:
        return ParsedMove(problem="empty")
    lines[-1:] = re.split(r"(?<=[.!?]) ", lines[-1])
    whole = [[*run] for is_one, run in groupby(map(_LINE.fullmatch, lines), bool) if is_one]
    labeled = [
        [one, *_MENTION.finditer(one.string, one.end())]
        for one in map(_LABELED.search, lines)
        if one
    ]
    for rule, found in (
        ("line", whole[-1] if whole else []),
        ("label", labeled[-1] if labeled else []),
        ("mention", [*_MENTION.finditer(lines[-1])]),
        ("mention", [*_MENTION.finditer("\n".join(lines))]),
    ):
        if found:
            return _verdict([one for one in found if one], rule)
    return ParsedMove(problem="no_move")


def _verdict(found: Sequence[re.Match[str]], rule: str) -> ParsedMove:
    """Return the operation that all matches agree on, or a problem."""
    said = [next(group for group in match.groups() if group) for match in found]
    operations = {None if word.lower() == "done" else int(word) for word in said}
    if len(operations) > 1:
        return ParsedMove(rule=rule, problem="several_moves")
    (operation,) = operations
    return ParsedMove(operation, operation is None, rule)


def _meaning(value: Any) -> ParsedMove | None:
    if (number := whole_number(value)) is not None:
        return ParsedMove(number, rule="json")
    match = _LINE.fullmatch(value.strip()) if isinstance(value, str) else None
    return None if match is None else _verdict([match], "json")
