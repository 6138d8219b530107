"""Reply text -> the option that was chosen, with the rule that matched.

Strict rules come first: a reply that is nothing but an answer, an answer in tags, a box or JSON, a
line or a sentence that says "the answer is". Then the last or the first line, a letter that the
reply begins with, the one option that is named at all. A rule that finds a statement decides: where
statements contradict each other and nothing says which is the last word, where one names an option
that is not shown, or where the model says that it cannot tell, nothing is read. That is a parse
failure, and no later rule is tried. Nothing raises on any text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from phyblock.parsing.answer_form import FormProblem
from phyblock.parsing.answer_hints import (
    concluded,
    counted,
    first_line,
    last_line,
    leading,
    only_one_named,
    only_order,
    only_text,
)
from phyblock.parsing.answer_order import OrderReader
from phyblock.parsing.answer_patterns import (
    CHOSEN,
    CONFIRMED,
    CORRECTED,
    DENIED,
    DENIED_BEHIND,
    IS_RIGHT,
    JSON,
    LINE,
    NOT_BUT,
    ORDER,
    QUOTED,
    SENTENCE,
    VERDICT,
)
from phyblock.parsing.answer_statements import (
    Reader,
    forward,
    is_conditional,
    settle,
    statements,
    turned,
)
from phyblock.parsing.answer_value import CONTRADICTION, ChoiceReader
from phyblock.parsing.slips import without_letter_slips
from phyblock.parsing.speech import CONDITIONAL, TAKES_BACK, words
from phyblock.parsing.text_forms import BOX, TAG, answer_of

__all__ = ["ParsedAnswer", "parse_answer"]


@dataclass(frozen=True)
class ParsedAnswer:
    """What was read out of a reply: one letter, or for ordering all letters in order.

    `rule` names the rule that matched; both are None where nothing could be read. `problem` says
    why where JSON was asked for and what came is none, or another.
    """

    letters: str | None
    rule: str | None
    problem: FormProblem | None = None


def parse_answer(text: str, options: Sequence[str], is_ordering: bool) -> ParsedAnswer:
    """Read the answer out of a reply to a question that shows `options`, the first one as A."""
    answer = without_letter_slips(QUOTED.sub(" ", answer_of(text) or ""))
    answer = NOT_BUT.sub(r"\g<value>", answer).strip()
    reader = OrderReader(len(options)) if is_ordering else ChoiceReader(options)
    for rule, find in _ORDER_RULES if is_ordering else _CHOICE_RULES:
        found = find(answer, reader)
        if found is not None:
            return ParsedAnswer(found, rule) if found else ParsedAnswer(None, None)
    return ParsedAnswer(None, None)


_WHOLE_CHARS = 300


def _whole(text: str, reader: Reader) -> str | None:
    return reader.exact(text) if len(text) <= _WHOLE_CHARS else None


def _marked(pattern: re.Pattern[str]) -> Callable[[str, Reader], str | None]:
    """A rule for answers in a mark of their own: tags, a box, a field."""

    def find(text: str, reader: Reader) -> str | None:
        return settle(text, list(statements(text, pattern, reader.read, 0)))

    return find


def _stated(text: str, reader: Reader) -> str | None:
    """Lines and sentences that say what the answer is; a line outweighs a sentence."""
    stated = list(statements(text, LINE, reader.read, 1))
    lines = {statement.end for statement in stated}
    for statement in statements(text, SENTENCE, reader.read, 0):
        if statement.end not in lines:
            stated.append(statement)
    stated += statements(text, CORRECTED, reader.read, 2)
    if isinstance(reader, ChoiceReader):
        stated += statements(text, CHOSEN, reader.letter_or_place, 0)
        stated += statements(text, IS_RIGHT, reader.exact, 0)
        stated += statements(text, CONFIRMED, reader.exact, 0)
    else:
        stated += statements(text, ORDER, reader.read, 0)
        stated = [forward(text, statement) for statement in stated]
    firm = [statement for statement in stated if not is_conditional(text, statement)]
    if stated and not firm:
        return CONTRADICTION
    return turned(text, sorted(firm, key=lambda statement: statement.start), reader)


def _verdicts(text: str, reader: ChoiceReader) -> str | None:
    """The one option that is called right, or left, where all others are called right or wrong."""
    found = {match["letter"].upper(): bool(match["yes"]) for match in VERDICT.finditer(text)}
    for match in (*DENIED.finditer(text), *DENIED_BEHIND.finditer(text)):
        found |= dict.fromkeys(
            re.findall("(?<![A-Za-z])[A-Z](?![A-Za-z])", match["letters"]), False
        )
    right = [letter for letter, is_right in found.items() if is_right]
    left = set(reader.letters) - set(found)
    if left and (_WAIT.search(text) or CONDITIONAL.search(text) or not _LEAVES.search(text)):
        return None
    if len(left) > 1 or len(found) + len(left) < _MANY or (right and left):
        return None
    right += left
    return right[0] if len(right) == 1 and right[0] in reader.letters else CONTRADICTION


_LEAVES = words(r"\b(?:leav\w+|left|remain\w*|only|bleibt|reste|queda|rest[ao]|оста\w+)\b|剩|只有")
_MANY = 3


def _outer_line(text: str, reader: Reader) -> str | None:
    """The last or the first line, where it is an answer and nothing else."""
    found = [reader.exact(line) for line in (first_line(text), last_line(text))]
    if isinstance(reader, ChoiceReader) and found == [None, None]:
        last = _LAST_SENTENCE.search(last_line(text))
        found[1] = reader.exact(last["letter"]) if last else None
    named = {letters for letters in found if letters is not None}
    if not named:
        return None
    if found[1] is None and _WAIT.search(text):
        return CONTRADICTION
    return named.pop() if len(named) == 1 else CONTRADICTION


_LAST_SENTENCE = re.compile(
    r"(?:[.!?]|(?:\A|[.;!]\s)\W{0,4}(?i:(?:(?:my|the|your|final|best)\s){0,2}(?:choice|pick"
    r"|selection|selected|chosen|correct|decision|result|solution)):)\s(?P<letter>[A-Z])[.!]?\Z"
)
"""A letter alone behind a sentence, or behind a label that states an answer."""
_WAIT = words(TAKES_BACK)


def _listed(text: str, reader: OrderReader) -> str | None:
    return reader.listed(text) or reader.ranked(text)


_Rule = tuple[str, Callable[[str, Any], str | None]]
_STATED: tuple[_Rule, ...] = (
    ("whole", _whole),
    ("tag", _marked(TAG)),
    ("boxed", _marked(BOX)),
    ("json", _marked(JSON)),
    ("stated", _stated),
)
_CHOICE_RULES: tuple[_Rule, ...] = (
    *_STATED,
    ("verdicts", _verdicts),
    ("outer_line", _outer_line),
    ("concluded", concluded),
    ("leading", leading),
    ("only_one_named", only_one_named),
    ("counted", counted),
    ("only_text", only_text),
)
_ORDER_RULES: tuple[_Rule, ...] = (
    *_STATED,
    ("outer_line", _outer_line),
    ("numbered_list", _listed),
    ("only_order", only_order),
)
