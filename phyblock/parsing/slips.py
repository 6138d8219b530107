"""What a reply corrects in the same breath: "7 - no wait, 5" says 5."""

from __future__ import annotations

import re

from phyblock.parsing.speech import SLIPS, words

__all__ = ["without_letter_slips", "without_slips"]

_SLIP = rf"(?:no,? wait|wait,? no|{SLIPS}|or rather|rather|make that|no|nein|better|besser)"
_CALLED = r"(?:(?:it['\u2019]s|it is|make that|should be|that['\u2019]s|to|zu)\s)?"
_BLOCK = r"(?:(?:the|block|index|candidate|number|no\.|with|#|move\(|kandidat|der|den)\s?){0,4}"
_LEADS = r"[^\w\n,;]{0,2}(?:\.{2,3}|[,;(\u2013\u2014\-\u2192]|->|[.)]\s)[^\w\n]{0,3}"
_LIST = r"\d{1,3}(?:(?:\s?(?:,|->|\u2192|>|\u2013|-)\s?|\s)\d{1,3}){1,40}"
_LIST_AGAIN = words(
    rf"(?<![\w.])(?P<old>{_LIST}){_LEADS}{_SLIP}\b[\s,.:!]{{1,3}}{_CALLED}(?P<new>{_LIST})(?![\w])"
)
_ONE_AGAIN = words(
    rf"(?<![\w.])(?P<old>\d{{1,3}})s?\)?{_LEADS}(?:{_SLIP}\b(?<!\bno)|no(?=,))[\s,.:!]{{1,3}}"
    rf"{_CALLED}{_BLOCK}(?P<new>\d{{1,3}})(?=\s?(?:[).;!(\n]|,\s?\D|\Z|instead\b))(?P<end>\)?)"
)
_STEP_AGAIN = re.compile(
    r"^(?P<head>[ \t>*_#-]{0,8}step\s?(?P<n>\d{1,2}))\s?\((?:corrected|correction|revised|fixed"
    r"|updated)\)",
    re.IGNORECASE | re.MULTILINE,
)


_LETTER_AGAIN = words(
    r"(?<![\w'])[A-Z][.,;?]?\s?(?:[\u2013\u2014(\u2192-]\s?)?"
    rf"(?:(?:{SLIPS}|no|actually|rather)[,.:]?\s){{1,3}}"
    r"(?:it is\s|it['\u2019]s\s)?(?P<new>(?-i:[A-Z]))(?=\)?[.!]?(?:\s|\Z))"
)


def without_letter_slips(text: str) -> str:
    """A text in which a letter that is taken back at once ("C. Actually no, B.") is the other."""
    return _LETTER_AGAIN.sub(lambda slip: f"{slip['new']}", text)


def without_slips(text: str) -> str:
    """A text in which what a line corrects at once is said rightly."""
    text = _ONE_AGAIN.sub(_second, _LIST_AGAIN.sub(r"\g<new>", text))
    for again in list(_STEP_AGAIN.finditer(text))[:8]:
        first = re.compile(
            rf"^[ \t>*_#-]{{0,8}}step\s?{again['n']}\b(?!\s?\()[^\n]*\n", re.I | re.M
        )
        text = first.sub("", text, count=1)
    return _STEP_AGAIN.sub(r"\g<head>", text)


def _second(slip: re.Match[str]) -> str:
    """The number that is meant, with the brackets that the text before it has opened."""
    return slip["new"] + ")" * max(0, slip[0].count(")") - slip[0].count("("))
