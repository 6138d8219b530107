"""Chains: texts of block numbers and signs alone, as "3, 5, 12" or "3 → 5 → 12"."""

from __future__ import annotations

import re

__all__ = ["chain"]

_CHAIN = re.compile(
    r"[\s(\[{<]{0,4}(?:(?:blocks?|index|indices|candidates?|积木|#)[\s:#]{0,3})?(?P<list>\d{1,6}(?:\s{0,3}"
    r"(?P<sign>,|、|;|·|\||->|→|>|=>|-|\u2013|/|then|and|dann|und|puis|luego|\s)(?:\s?(?:and|then|dann|puis|luego|block|index"
    r"|#)){0,2}[\s#]{0,3}\d{1,6}){0,63})"
    r"[\s)\]}>.]{0,4}\Z",
    re.IGNORECASE,
)
_REMARKS = re.compile(
    r"(?<=\d)[号號番]|\b(?:zuerst|first|d'abord|primero)\b|"
    r"\s{0,3}\([^()\d\n]{0,80}\)|\s(?:→|->|=>|\u2014|\u2013)\s[^\d\n]{1,200}\Z"
    r"|(?:(?<=[→>] \d)|(?<=[→>] \d\d))\.\s[^\d\n]{1,120}\Z",
    re.IGNORECASE,
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
