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

from phyblock.parsing.answer_form import FormProblem
from phyblock.parsing.answer_order import OrderReader
from phyblock.parsing.answer_patterns import (
    BOX,
    BRANDED,
    CHOSEN,
    CONCLUDED,
    CONDITIONAL,
    CONFIRMED,
    CORRECTED,
    COUNTED,
    DANGLES,
    IS_REJECTED,
    IS_RIGHT,
    JSON,
    LABEL,
    LEADING,
    LINE,
    MAKES,
    NOT_BUT,
    ORDER,
    QUOTED,
    REJECTS,
    SENTENCE,
    SO,
    TAG,
    UNSURE,
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
from phyblock.parsing.text_forms import answer_of

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


_SENTENCE_CHARS = 240
_CUT_OFF_CHARS = 12
_WHOLE_CHARS = 300
_LINE_CHARS = 240


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
        stated += statements(text, CHOSEN, reader.letter, 0)
        stated += statements(text, IS_RIGHT, reader.exact, 0)
        stated += statements(text, CONFIRMED, reader.exact, 0)
    else:
        stated += statements(text, ORDER, reader.read, 0)
        stated = [forward(text, statement) for statement in stated]
    firm = [statement for statement in stated if not is_conditional(text, statement)]
    if stated and not firm:
        return CONTRADICTION
    return turned(text, sorted(firm, key=lambda statement: statement.start), reader)


def _verdicts(text: str, reader: Reader) -> str | None:
    """The one option that is called right where every option is called right or wrong."""
    found = {match["letter"].upper(): bool(match["yes"]) for match in VERDICT.finditer(text)}
    if (
        not isinstance(reader, ChoiceReader)
        or len(found) < len(reader.letters)
        or len(found) < _MANY
    ):
        return None
    right = [letter for letter, is_right in found.items() if is_right]
    return right[0] if len(right) == 1 and right[0] in reader.letters else CONTRADICTION


_MANY = 3


def _outer_line(text: str, reader: Reader) -> str | None:
    """The last or the first line, where it is an answer and nothing else."""
    found = [reader.exact(line) for line in (_first_line(text), _last_line(text))]
    if isinstance(reader, ChoiceReader) and found == [None, None]:
        last = _LAST_SENTENCE.search(_last_line(text))
        found[1] = reader.exact(last["letter"]) if last else None
    named = {letters for letters in found if letters is not None}
    if not named:
        return None
    if found[1] is None and _WAIT.search(text):
        return CONTRADICTION
    return named.pop() if len(named) == 1 else CONTRADICTION


_LAST_SENTENCE = re.compile(r"[.!?]\s(?P<letter>[A-Z])[.!]?\Z")
_WAIT = re.compile(r"\b(?:wait|correction|on second thought|mistake)\b", re.IGNORECASE)


def _leading(text: str, reader: Reader) -> str | None:
    """A letter that the reply begins with, when no other option is labeled so."""
    head = LEADING.match(text)
    if head is None or not isinstance(reader, ChoiceReader):
        return None
    if head["letter"] == "I" and "I" not in reader.letters:
        return None
    if IS_REJECTED.match(text, head.end("letter")):
        return None
    first = _first_line(text)
    if CONDITIONAL.search(first) or first.count("%") > 1:
        return CONTRADICTION
    found = reader.letter(_first_line(text))
    labels = {match["letter"] for match in LABEL.finditer(text)} & set(reader.letters)
    return found if found is None or labels <= {found} else None


def _concluded(text: str, reader: Reader) -> str | None:
    found = [reader.exact(match["value"]) for match in CONCLUDED.finditer(text)]
    return found[-1] if found and not _is_open(text) else None


def _is_open(text: str) -> bool:
    """Whether a reply says that it cannot tell, or only under conditions."""
    return bool(UNSURE.search(text) or CONDITIONAL.search(text))


def _only_one_named(text: str, reader: Reader) -> str | None:
    """The one option that is named by a marked letter anywhere.

    Unless that is to turn it down, or the reply was cut off before it came to the others.
    """
    if _is_open(text):
        return None
    found = [(match, match["a"] or match["b"] or match["c"]) for match in BRANDED.finditer(text)]
    named = {letter for _, letter in found} & set(reader.letters)
    if len(named) != 1 or _is_cut_off(text, found[-1][0].end()):
        return None
    sentences = (_sentence_of(text, match) for match, letter in found if letter in named)
    return None if all(map(REJECTS.search, sentences)) else named.pop()


def _is_cut_off(text: str, named_until: int) -> bool:
    """Whether a reply ends in the middle of a sentence, well after what it named last."""
    rest = text[named_until:].rstrip()
    return len(rest) > _CUT_OFF_CHARS and (rest[-1].isalnum() or bool(DANGLES.search(rest)))


def _sentence_of(text: str, match: re.Match[str]) -> str:
    """What stands round a match up to the next full stops or line ends."""
    start = max(0, match.start() - _SENTENCE_CHARS)
    before = re.split(r"[.!?\n]", text[start : match.start()])[-1]
    after = re.split(r"[.!?\n]", text[match.end() : match.end() + _SENTENCE_CHARS], maxsplit=1)[0]
    return f"{before}{match.group()}{after}"


def _only_text(text: str, reader: Reader) -> str | None:
    """The one option whose words a short reply, or the last line of a long one, holds."""
    if not isinstance(reader, ChoiceReader) or _is_open(text):
        return None
    last = _last_line(text)
    if DANGLES.search(last):
        return None
    so = [match["value"] for match in SO.finditer(last)]
    if so and (found := reader.option_text(so[-1])):
        return found
    last = _ASIDE.sub(" ", last).strip() or last
    makes = MAKES.search(last.rstrip(" ."))
    if makes and (found := reader.option_text(makes["value"], exact=True)):
        return found
    for piece in (last, text[:_LINE_CHARS]) if len(text) <= _LINE_CHARS else (last,):
        found = CONTRADICTION if reader.letter(piece) == CONTRADICTION else None
        found = reader.option_text(piece) if found is None else found
        if found is not None:
            return found
    return reader.number(last)


_ASIDE = re.compile(r"\([^()\n]{0,120}\)")


def _counted(text: str, reader: Reader) -> str | None:
    """The number of which a reply says that it is the total, where the options are numbers."""
    if not isinstance(reader, ChoiceReader) or _is_open(text):
        return None
    named = {reader.option_text(match["a"] or match["b"]) for match in COUNTED.finditer(text)}
    return (named.pop() if len(named) == 1 else CONTRADICTION) if named - {None} else None


def _only_order(text: str, reader: Reader) -> str | None:
    """The one order in the text; listing the pictures as they were shown is none."""
    if not isinstance(reader, OrderReader) or _is_open(text):
        return None
    for piece in (_last_line(text), text):
        named = set(reader.orders(piece)) - {reader.letters}
        if len(named) == 1:
            return named.pop()
    return None


def _first_line(text: str) -> str:
    return text[:_LINE_CHARS].split("\n", 1)[0]


def _last_line(text: str) -> str:
    return text[-_LINE_CHARS:].rstrip().rsplit("\n", 1)[-1]


def _list(text: str, reader: Reader) -> str | None:
    if not isinstance(reader, OrderReader):
        return None
    return reader.listed(text) or reader.ranked(text)


_Rule = tuple[str, Callable[[str, Reader], str | None]]
_STRICT: tuple[_Rule, ...] = (
    ("whole", _whole),
    ("tag", _marked(TAG)),
    ("boxed", _marked(BOX)),
    ("json", _marked(JSON)),
    ("stated", _stated),
    ("verdicts", _verdicts),
    ("outer_line", _outer_line),
)
_CHOICE_RULES: tuple[_Rule, ...] = (
    *_STRICT,
    ("leading", _leading),
    ("concluded", _concluded),
    ("only_one_named", _only_one_named),
    ("counted", _counted),
    ("only_text", _only_text),
)
_ORDER_RULES: tuple[_Rule, ...] = (
    *_STRICT,
    ("numbered_list", _list),
    ("only_order", _only_order),
)
