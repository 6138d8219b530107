"""Places of a reply that state an answer, and what they come to together."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from phyblock.parsing.answer_order import OrderReader
from phyblock.parsing.answer_patterns import TURNED
from phyblock.parsing.answer_value import CONTRADICTION, ChoiceReader
from phyblock.parsing.speech import BACKWARD, CONDITIONAL, REVISED, TAKES_BACK, TURNED_ROUND

__all__ = ["Reader", "Stated", "forward", "is_conditional", "settle", "statements", "turned"]

Reader = ChoiceReader | OrderReader


@dataclass(frozen=True)
class Stated:
    """A place that states an answer: where it begins and ends, what it names, how firmly."""

    start: int
    end: int
    letters: str
    weight: int


_SENTENCE_CHARS = 240
_AFTERTHOUGHT = re.compile(rf"(?i:{TAKES_BACK})[^\n]{{0,40}}?\b(?P<letter>[B-Z])\b")
_PART_OF_LINE = re.compile(r"\u2192|=>|;|\.\s")
_ASKS = re.compile(r"[^.!?。！\n]{1,120}[?？]")  # noqa: RUF001
_REVISION_CHARS = 4000
_MOST_STATEMENTS = 100
"""Of each kind, from the end: a reply that repeats itself for pages is still read at once."""


def statements(
    text: str, pattern: re.Pattern[str], read: Callable[[str], str | None], weight: int
) -> Iterator[Stated]:
    """The statements that a pattern finds in a text, the last hundred of them."""
    for match in deque(pattern.finditer(text), maxlen=_MOST_STATEMENTS):
        if _ASKS.match(match["value"]):
            continue
        letters = read(match["value"])
        if letters is not None:
            lead = match.groupdict().get("lead") or ""
            firm = weight + ("final" in lead.lower())
            yield Stated(match.start(), match.end(), letters, firm)


def settle(text: str, stated: Sequence[Stated]) -> str | None:
    """The last word: what all say, or what the last says where it outweighs or revises others."""
    if not stated:
        return None
    last = stated[-1]
    for other in reversed(stated):
        if other.letters != last.letters and other.weight >= last.weight:
            between = text[max(other.end, last.start - _REVISION_CHARS) : last.end]
            return last.letters if REVISED.search(between) else CONTRADICTION
    return last.letters


def is_conditional(text: str, stated: Stated) -> bool:
    """Whether a statement holds only under a condition, said before it or right behind it."""
    start = max(0, stated.start - _SENTENCE_CHARS)
    before = re.split(r"[.!?\n](?=\s|\Z)", text[start : stated.start])[-1]
    after = re.split(r"[.!?\n]", text[stated.end : stated.end + _SENTENCE_CHARS], maxsplit=1)[0]
    return bool(CONDITIONAL.search(before) or CONDITIONAL.search(after))


def forward(text: str, stated: Stated) -> Stated:
    """An order from first to last, where its line says that it goes from last to first."""
    line = text[
        max(text.rfind("\n", 0, stated.start) + 1, stated.end - _SENTENCE_CHARS) : stated.end
    ]
    line = _PART_OF_LINE.split(line)[-1]
    return replace(stated, letters=stated.letters[::-1]) if BACKWARD.search(line) else stated


def turned(text: str, stated: Sequence[Stated], reader: Reader) -> str | None:
    """What statements come to, unless the text turns to another option behind the last of them."""
    settled = settle(text, stated)
    if settled and len(settled) > 1 and TURNED_ROUND.search(text, stated[-1].end):
        return CONTRADICTION
    after = _AFTERTHOUGHT.search(text, stated[-1].end) if stated else None
    if settled and after and after["letter"] != settled and len(settled) == 1:
        return CONTRADICTION
    turn = TURNED.search(text, stated[-1].end) if stated else None
    if not settled or turn is None or turn["value"].upper() in ("", settled):
        return settled
    letter = turn["value"].upper()
    is_firm = (
        stated[-1].weight or not isinstance(reader, ChoiceReader) or letter not in reader.letters
    )
    return CONTRADICTION if is_firm else letter
