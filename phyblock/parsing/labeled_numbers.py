"""Numbers behind a label: "Order: 3, 5, 12", or an array somewhere in a line."""

from __future__ import annotations

import re
from dataclasses import dataclass

from phyblock.parsing.chain import chain
from phyblock.parsing.line_patterns import ARRAY, LABELED, NOUN_LABEL, SENTENCE_END
from phyblock.parsing.plan_patterns import FINAL_LABEL, PLAN_WORD
from phyblock.parsing.speech import words
from phyblock.parsing.statement import read_statement
from phyblock.parsing.text_forms import SENTENCES

__all__ = ["LabeledNumbers", "labeled_numbers"]

_NAMED_LIST = re.compile(
    r"\s{0,20}[-#>]{0,4}\s{0,3}(?P<label>[^:\d\n]{1,80}?):\s{1,3}(?P<value>[^\W\d][^:\n]{1,300})"
)
_APART = words(r",?\s(?:and\s)?then\s|,\s(?:and\s)?|;\s|\s(?:→|->|>)\s")
_PIECE = words(
    r"(?!.*\b(?:on|onto|over|under|beside|to|with|at|of|not|no|without|except|steps?|layers?|x"
    r"|two|three|four|twice|times|both|zwei|drei|zweimal|deux|trois|fois|dos|tres|veces)\b)"
    r"[^\W\d][^\d()]{0,30}\s[(\[]?#?(?P<number>\d{1,3})[)\]]?"
)
"""A block by its looks and its number, as "red arch (3)" or "slab 2"."""
_LABEL_CHARS = 30
"""A label is shorter, where words stand beside the numbers behind it."""


@dataclass(frozen=True)
class LabeledNumbers:
    """The numbers of a line, their label, the text that they stand in, and what stands behind."""

    numbers: tuple[int, ...]
    label: str
    value: str
    rest: str


def labeled_numbers(line: str) -> LabeledNumbers | None:
    """The numbers that a line names behind a label, or in an array; None where it names none.

    The label is what the line begins with, or what its last sentence does where it says that it is
    the plan.
    """
    labeled = LABELED.match(line)
    sentences = [] if labeled else SENTENCES.split(line)
    last = LABELED.match(sentences[-1].strip()) if len(sentences) > 1 else None
    if last and FINAL_LABEL.search(last["label"]) and len(chain(last["value"].rstrip(" ."))[0]) > 1:
        labeled = last
    if labeled and (
        labeled["label"].count("(") > labeled["label"].count(")")
        or NOUN_LABEL.fullmatch(labeled["label"])
    ):
        labeled = None
    value, rest = "", ""
    if labeled:
        value, _, rest = SENTENCE_END.sub("\n", labeled["value"], count=1).partition("\n")
        value = value.rstrip(" .}。").removesuffix("です")
        numbers, _ = chain(value)
        is_short = len(labeled["label"]) < _LABEL_CHARS
        if not numbers and is_short and not read_statement(line, is_item=False).has_verb:
            numbers = read_statement(value, is_item=True).numbers
        if numbers:
            return LabeledNumbers(numbers, labeled["label"], value, rest)
    if named := _NAMED_LIST.match(line):
        pieces = _APART.split(named["value"].strip(" ."))
        blocks = [_PIECE.fullmatch(piece.strip()) for piece in pieces]
        if len(blocks) > 1 and PLAN_WORD.search(named["label"]) and None not in blocks:
            numbers = tuple(int(block["number"]) for block in blocks if block)
            return LabeledNumbers(numbers, named["label"], " ".join(map(str, numbers)), "")
    arrays = list(ARRAY.finditer(line))
    if not arrays:
        return None
    start = arrays[-1].start()
    numbers, _ = chain(arrays[-1][0])
    return LabeledNumbers(numbers, line[:start], line[start:], rest)
