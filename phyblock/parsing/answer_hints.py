"""What a reply that nowhere states its answer still names: one letter, one option, one order."""

from __future__ import annotations

import re

from phyblock.parsing.answer_order import OrderReader
from phyblock.parsing.answer_patterns import (
    BRANDED,
    CONCLUDED,
    COUNTED,
    DANGLES,
    IS_REJECTED,
    LABEL,
    LEADING,
    MAKES,
    REJECTS,
    SO,
)
from phyblock.parsing.answer_value import CONTRADICTION, ChoiceReader
from phyblock.parsing.speech import CONDITIONAL, TURNED_ROUND, UNSURE

__all__ = [
    "concluded",
    "counted",
    "first_line",
    "last_line",
    "leading",
    "only_one_named",
    "only_order",
    "only_text",
]

_SENTENCE_CHARS = 240
_CUT_OFF_CHARS = 12
_LINE_CHARS = 240


def leading(text: str, reader: ChoiceReader) -> str | None:
    """A letter that the reply begins with, when no other option is labeled so."""
    head = LEADING.match(text)
    if head is None:
        return None
    if head["letter"] == "I" and "I" not in reader.letters:
        return None
    if IS_REJECTED.match(text, head.end("letter")):
        return None
    first = first_line(text)
    if CONDITIONAL.search(first) or first.count("%") > 1:
        return CONTRADICTION
    found = reader.letter(first)
    labels = {match["letter"] for match in LABEL.finditer(text)} & set(reader.letters)
    if _SAYS.match(text, head.end()):
        labels |= set(_SUBJECT.findall(text)) & set(reader.letters)
    return found if found is None or labels <= {found} else None


_SAYS = re.compile(r" (?:is|has|shows|lies|stands|looks|seems|would|does|can)\b")
_SUBJECT = re.compile(rf"(?<![\w'])[A-Z](?={_SAYS.pattern})")
"""A letter of which a sentence says something: where several are, the first is no answer."""


def concluded(text: str, reader: ChoiceReader) -> str | None:
    """The letter that the last clause of a conclusion is."""
    found = list(CONCLUDED.finditer(text))
    if not found or UNSURE.search(text) or CONDITIONAL.search(_sentence_of(text, found[-1])):
        return None
    return reader.exact(found[-1]["value"])


def _is_open(text: str) -> bool:
    """Whether a reply says that it cannot tell, or only under conditions."""
    return bool(UNSURE.search(text) or CONDITIONAL.search(text))


def only_one_named(text: str, reader: ChoiceReader) -> str | None:
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


def only_text(text: str, reader: ChoiceReader) -> str | None:
    """The one option whose words a short reply, or the last line of a long one, holds."""
    if _is_open(text):
        return None
    last = last_line(text)
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


def counted(text: str, reader: ChoiceReader) -> str | None:
    """The number of which a reply says that it is the total, where the options are numbers."""
    if _is_open(text):
        return None
    named = {reader.option_text(match["a"] or match["b"]) for match in COUNTED.finditer(text)}
    return (named.pop() if len(named) == 1 else CONTRADICTION) if named - {None} else None


def only_order(text: str, reader: OrderReader) -> str | None:
    """The one order in the text; listing the pictures as they were shown is none."""
    if _is_open(text) or TURNED_ROUND.search(text):
        return None
    for piece in (last_line(text), text):
        named = set(reader.orders(piece)) - {reader.letters}
        if len(named) == 1:
            return named.pop()
    return None


def first_line(text: str) -> str:
    """The first line, as far as an answer can reach."""
    return text[:_LINE_CHARS].split("\n", 1)[0]


def last_line(text: str) -> str:
    """The last line, as far as an answer can reach."""
    return text[-_LINE_CHARS:].rstrip().rsplit("\n", 1)[-1]
