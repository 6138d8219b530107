"""The forms in which answers are asked for as JSON, one for each kind of answer, and their readers.

A reply without JSON of its form is read as any text is; the rule that is recorded says which.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from phyblock.domain import Plan
from phyblock.parsing.answer import ParsedAnswer, parse_answer
from phyblock.parsing.answer_form import AnswerForm
from phyblock.parsing.answer_order import OrderReader
from phyblock.parsing.answer_value import ChoiceReader
from phyblock.parsing.json_values import LONGEST_NUMBER, Fields, whole_number
from phyblock.parsing.move import ParsedMove, parse_move
from phyblock.parsing.plan import ParsedPlan, kept_plan, parse_plan

__all__ = [
    "choice_form",
    "move_form",
    "parse_asked_answer",
    "parse_asked_move",
    "parse_asked_plan",
    "plan_form",
]

_MOVE = re.compile(r"\s*move\s?\(\s?(?P<number>\d{1,6})\s?\)[\s.]*", re.IGNORECASE)
_DONE = re.compile(r"\s*done\s?(?:\(\s?\))?[\s.]*", re.IGNORECASE)


def plan_form(n_candidates: int) -> AnswerForm[tuple[int, ...]]:
    """A plan: the numbers of candidates 1 to `n_candidates`, in order."""
    number = {"type": "integer", "enum": list(range(1, n_candidates + 1))}
    return AnswerForm("plan", {"type": "array", "items": number}, _plan, "[N, N, ...]")


def move_form(n_candidates: int, *, reasons: bool = True) -> AnswerForm[ParsedMove]:
    """One operation of step planning, in the words of its prompt: `Move(N)` or `Done`."""
    words = [*(f"Move({number})" for number in range(1, n_candidates + 1)), "Done"]
    value = {"type": "string", "enum": words}
    return AnswerForm("operation", value, _move, '"Move(N)"', reasons)


def choice_form(options: Sequence[str], is_ordering: bool) -> AnswerForm[str]:
    """The letter of one of the `options`, or for ordering the letters of all in order."""
    choices = ChoiceReader(options)
    letter = {"type": "string", "enum": list(choices.letters)}
    if not is_ordering:

        def choice(value: Any) -> str | None:
            return (choices.exact(value) or None) if isinstance(value, str) else None

        return AnswerForm("answer", letter, choice, '"X"')

    orders = OrderReader(len(options))

    def order(value: Any) -> str | None:
        if isinstance(value, list) and all(_is_letter(item, orders.letters) for item in value):
            value = ", ".join(value)
        return (orders.exact(value) or None) if isinstance(value, str) else None

    places = ", ".join(f'"{name}"' for name in "WXYZ"[: len(options)])
    return AnswerForm("answer", {"type": "array", "items": letter}, order, f"[{places}]")


def parse_asked_plan(text: str, n_candidates: int) -> ParsedPlan:
    """Read the plan out of a reply that was asked for in `plan_form`."""
    reading = plan_form(n_candidates).read(text)
    if reading is None:
        return parse_plan(text, n_candidates)
    if reading.rule is None or reading.answer is None:
        return ParsedPlan(Plan(), None, problem=reading.problem)
    return kept_plan(reading.rule, reading.answer, n_candidates)


def parse_asked_move(text: str, form: AnswerForm[ParsedMove]) -> ParsedMove:
    """Read the operation out of a reply that was asked for in `form`."""
    reading = form.read(text)
    if reading is None:
        return parse_move(text)
    if reading.answer is None:
        return ParsedMove(problem=reading.problem)
    return ParsedMove(reading.answer.move, reading.answer.is_done, reading.rule)


def parse_asked_answer(text: str, options: Sequence[str], is_ordering: bool) -> ParsedAnswer:
    """Read the answer out of a reply that was asked for in `choice_form`."""
    reading = choice_form(options, is_ordering).read(text)
    if reading is None:
        return parse_answer(text, options, is_ordering)
    return ParsedAnswer(reading.answer, reading.rule, reading.problem)


def _plan(value: Any) -> tuple[int, ...] | None:
    if not isinstance(value, list) or isinstance(value, Fields):
        return None
    found = [whole_number(item) for item in value]
    numbers = tuple(number for number in found if number is not None)
    is_whole = len(numbers) == len(found) and all(map(_is_bounded, numbers))
    return numbers if is_whole else None


def _move(value: Any) -> ParsedMove | None:
    if isinstance(value, str) and _DONE.fullmatch(value):
        return ParsedMove(is_done=True)
    match = _MOVE.fullmatch(value) if isinstance(value, str) else None
    number = int(match["number"]) if match else whole_number(value)
    return ParsedMove(number) if number is not None and _is_bounded(number) else None


def _is_bounded(number: int) -> bool:
    return len(str(abs(number))) <= LONGEST_NUMBER


def _is_letter(value: Any, letters: str) -> bool:
    return isinstance(value, str) and len(value) == 1 and value.upper() in letters
