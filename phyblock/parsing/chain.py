"""Chains: texts of block numbers and signs alone, as "3, 5, 12" or "3 → 5 → 12"."""

from __future__ import annotations

import re

from phyblock.parsing.speech import words

__all__ = ["chain"]

_CHAIN = words(
    r"[\s(\[{<]{0,4}(?:(?:maybe|probably|perhaps|vermutlich|quizás)\s)?(?:(?:blocks?|index|indices"
    r"|candidates?|积木|#)[\s:#]{0,3})?(?P<list>\d{1,6}(?:\s{0,3}(?P<sign>,|、|;|·|\||->|→|>|=>|-"
    r"|\u2013|/|then|and|dann|und|puis|luego|\s)(?:\s?(?:and|then|dann|puis|luego|another|block"
    r"|index|#)){0,2}[\s#]{0,3}\d{1,6}){0,63})[\s)\]}>.]{0,4}\Z"
)
_REMARKS = words(
    r"(?<=\d)[号號番]|,? in (?:this|that) order\b|\b(?:zuerst|first|d'abord|primero)\b"
    r"|\s{0,3}\((?![^()\n]{0,40}\b(?:twice|thrice|times|two|three|zwei\w*|drei\w*|mal|fois"
    r"|veces)\b)[^()\d\n]{0,80}\)|\s(?:→|->|=>|\u2014|\u2013)\s[^\d\n]{1,200}\Z|(?:(?<=[→>] \d)"
    r"|(?<=[→>] \d\d))\.\s[^\d\n]{1,120}\Z"
)
"""What a list says of its blocks, or behind its end, without a number."""
_NUMBER = re.compile(r"\d{1,6}")


def chain(text: str) -> tuple[tuple[int, ...], bool]:
    """The numbers of a text of numbers alone ("3, 5, 12"), and whether arrows say the order."""
    found = _CHAIN.match(_REMARKS.sub(" ", text))
    if found is None:
        return (), False
    return tuple(map(int, _NUMBER.findall(found["list"]))), (found["sign"] or "") in (
        "->",
        "→",
        ">",
        "=>",
        "then",
    )
