"""Parsers from reply text to the answer to a question, or to one operation of step planning.

Both return the rule that matched. An answer has the requested form: JSON, else the last line
"Answer: X" (or a box or a tag). Otherwise it is the last stated choice, then a single letter in the
last or first line, then the only named option. An order is the last with every letter once.

An operation, `Move(3)` or `Done`, is JSON of the requested form, else the last line that is only an
operation, else the text after a label ("Next plan: Move(3)"), else the only one that is mentioned.
`Done` counts only as a whole answer. The parser never guesses between two operations.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Literal, get_args

from phyblock.parsing.text import AnswerForm, answer_of, plain_lines, whole_number

AnswerProblem = Literal["empty", "thoughts_only", "no_answer"]
LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


@dataclass(frozen=True)
class ParsedAnswer:
    """One letter, or for ordering all letters in order; `problem` is the reason for no answer."""

    letters: str | None
    rule: str | None
    problem: AnswerProblem | None = None


def choice_form(options: Sequence[str], is_ordering: bool) -> AnswerForm[str]:
    """Return the JSON form of one option's letter, or of an order of all."""
    letters = LETTERS[: len(options)]
    letter = {"type": "string", "enum": list(letters)}
    if not is_ordering:
        return AnswerForm("answer", letter, lambda value: _named(str(value), options), '"X"')
    places = ", ".join(f'"{name}"' for name in "WXYZ"[: len(options)])
    value = {"type": "array", "items": letter}
    return AnswerForm("answer", value, lambda value: _json_order(value, letters), f"[{places}]")


def parse_answer(text: str, options: Sequence[str], is_ordering: bool) -> ParsedAnswer:
    """Parse the answer from a reply to a question with these `options`, the first one as A."""
    if not (answer := answer_of(text)):
        return ParsedAnswer(None, None, "empty" if answer == "" else "thoughts_only")
    if "{" in answer and (stated := choice_form(options, is_ordering).read(answer)):
        return ParsedAnswer(stated, "json")
    plain = "\n".join(line.strip() for line in plain_lines(answer) if line.strip())
    rule, letters = (_order if is_ordering else _choice)(plain, options)
    return ParsedAnswer(letters, rule) if letters else ParsedAnswer(None, None, "no_answer")


_ANSWER = re.compile(
    r"(?i)\banswer\b(?: to [^:\n]{1,60})? ?(?:is|(?:must|has to|should) be|:|=)\W{0,3}(?:is )?"
    r"([^\n]{0,300})",
)
_NOUN = r"(?:option|choice|answer|letter|picture|image|figure)"
_HEAD = re.compile(
    rf"(?si)\W{{0,9}}(?:(?:the|correct|right|best|probably) ){{0,4}}(?:{_NOUN} ?)?(?:is |: ?)?"
    r"[(\[\"']{0,3}([A-Za-z])(?![\w'-])(.*)",
)
_CLOSED = re.compile(r"\s?[)\]}\"'.:,;!-]|\s?\Z|\s(?:because|since|as|\()", re.I)
_ALSO = re.compile(
    rf"[)\]\"']{{0,2}}(?:\s?[,/&+]\s?|\s(?:or|and)\s)(?:{_NOUN}\s)?[(\[]?(?-i:[A-Z])(?![\w'])", re.I
)
_STATED = re.compile(
    r"(?i)\b(?:choose|chose|pick|select|go(?:ing)? with|choice is|(?:must|would|has to) be|so|thus"
    rf"|therefore|I'd say)\b[:,]? (?:(?!between)[a-z]{{2,10}} ){{0,3}}(?:{_NOUN} )?"
    r"\(?((?-i:[A-Z]))\)?(?![\w'-])"
    r"|\b((?-i:[A-Z]))\)? (?:is|seems|looks|matches|fits)(?: [a-z]{2,10}){0,3} "
    r"(?:correct|right|best|answer|goal|question)\b",
)
_NOT = re.compile(r"\b(?:not|never|\w{1,5}n't|cannot|wrong|incorrect)\b", re.I)
_LETTER = re.compile(rf"\b(?i:{_NOUN}) \(?([A-Z])(?![\w'])|\(([A-Z])\)|^([A-Z])[).:]", re.M)
_CLAUSE = re.compile(r"[.,;:(\n]\s|\s-")
_AMOUNT = re.compile(r"(?<![\d.])\d{1,6}(?:\.\d{1,6})?(?![\d.])")


def _choice(plain: str, options: Sequence[str]) -> tuple[str, str | None]:
    letters, lines = LETTERS[: len(options)], plain.split("\n")
    if answers := _ANSWER.findall(plain):
        return "answer_line", _named(answers[-1], options)
    stated = [one[1] or one[2] for one in _STATED.finditer(plain) if not _NOT.search(one[0])]
    if stated and stated[-1] in letters:
        return "stated", stated[-1]
    alone = {one for line in (lines[0], lines[-1]) if (one := _named(line, options))}
    named = {next(filter(None, one)) for one in _LETTER.findall(plain)} & {*letters}
    if alone or named:
        one, *others = alone or named
        return "line" if alone else "only_named", None if others else one
    texts = [_folded(option) for option in options]
    longest = sorted(filter(None, texts), key=len, reverse=True)
    pattern = rf"(?<![\w.])(?:{'|'.join(map(re.escape, longest)) or '(?!)'})(?!\w|\.\d)"
    found = {*re.findall(pattern, _folded(plain))}
    return "only_named", letters[texts.index(found.pop())] if len(found) == 1 else None


def _named(value: str, options: Sequence[str]) -> str | None:
    """Return the letter of the only option that a short text names, by text, letter or number."""
    letters, texts = LETTERS[: len(options)], [_folded(option) for option in options]
    if texts.count(_folded(value)) == 1:
        return letters[texts.index(_folded(value))]
    head = _HEAD.match(value)
    if head and (letter := head[1].upper()) in letters:
        rest = head[2]
        is_said = _CLOSED.match(rest) and (head[1].isupper() or not re.search(r"\w", rest))
        has_its_text = _folded(_CLAUSE.split(rest, 1)[0]) == (texts[letters.index(letter)] or None)
        if is_said or has_its_text:
            return None if _ALSO.match(rest) else letter
    said = _AMOUNT.findall(_folded(value.split(". ")[0]))
    same = [at for at, text in enumerate(texts) if len(said) == 1 and _AMOUNT.findall(text) == said]
    return letters[same[0]] if len(same) == 1 else None


def _folded(text: str) -> str:
    """Return a text normalized for comparison: without case, edges, articles or double blanks."""
    folded = " ".join(text.casefold().split()).strip(" .,:;!?()[]{}<>\"'*-")
    return re.sub(r"^(?:the|an|a) ", "", folded)


_BETWEEN = (
    r"(?:[\s,;:>|/.()\[\]\u2192=-]|\d(?=[.)])|\b(?:then|and|to|picture|image|option)\b){0,12}"
)


def _order(plain: str, options: Sequence[str]) -> tuple[str, str | None]:
    letters = LETTERS[: len(options)]
    one = f"([{letters}])"
    pattern = re.compile(rf"(?<![\w']){_BETWEEN.join([one] * len(letters))}(?![\w'])")
    for rule, texts in (("answer_line", _ANSWER.findall(plain)), ("order", [plain])):
        found = ["".join(groups) for text in texts for groups in pattern.findall(text)]
        if whole := [order for order in found if set(order) == set(letters)]:
            return rule, whole[-1]
    return "order", None


def _json_order(value: Any, letters: str) -> str | None:
    said = "".join(map(str, value)) if isinstance(value, list) else str(value)
    order = re.sub(r"[\s,;>-]", "", said).upper()
    return order if sorted(order) == sorted(letters) else None


MoveProblem = Literal["empty", "thoughts_only", "no_move", "several_moves"]
MOVE_PROBLEMS: tuple[MoveProblem, ...] = get_args(MoveProblem)


@dataclass(frozen=True)
class ParsedMove:
    """A number, even of no candidate, `Done`, or a problem; without a `rule`, nothing was found."""

    move: int | None = None
    is_done: bool = False
    rule: str | None = None
    problem: MoveProblem | None = None


_INDEX = r"([-+]?\d{1,6})(?!\d|[.,]\d)"
_CALL = (
    r"move ?[(\[] ?(?:(?:id|index|block|candidate|n)? ?[=:#] ?|(?:block|candidate|index) )?"
    rf"[\"'<]?{_INDEX}[\"'>]? ?[)\]]|move (?:the )?(?:block|candidate) (?:with )?"
    rf"(?:(?:the )?(?:index|number|id) ?[:=#]? ?)?[#(\[\"']?{_INDEX}[)\]\"']?"
)
_OPERATION = rf"(?:{_CALL}|(done)(?: ?\( ?\))?)"
_LABEL = (
    r"(?:[a-z]{1,12} ){0,3}(?:plan|step|answer|action|operation|move|output|decision|choice)"
    r"(?: ?#?\d{1,3})? ?(?:is|:|=|->|\u2192)\W{0,9}"
)
_LINE = re.compile(
    rf"(?i)\W{{0,20}}(?:{_LABEL})?{_OPERATION}\W{{0,9}}"
    rf"|\W{{0,20}}(?:{_LABEL})?(?:(?:move|block|candidate) ){{0,2}}{_INDEX}\W{{0,9}}",
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
    if (answer := answer_of(text)) is None:
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
