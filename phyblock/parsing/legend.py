"""Plans by names that the reply itself gives numbers to: "red cube = 3 ... first the red cube"."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re

__all__ = ["with_numbers"]

_NAME = r"[^\W\d_]+(?:[ -][^\W\d_]+){0,3}"
_SIGN = r"\s?(?:=|->|→|=>|:|–|—|-)\s?"
_CALLED = r"(?:(?:candidate|block|index|no\.|number|kandidat|baustein|#)\s?){1,2}"
_GIVEN = re.compile(
    rf"(?:^[ \t>*+•-]{{0,6}}|(?<=[,;] ))(?P<name>{_NAME}){_SIGN}(?:{_CALLED})?(?P<number>\d{{1,3}})"
    r"(?=\s?(?:[,;.]|$|[x×(]))"
    rf"|(?:^|[.,;]\s|\band\s)(?:the\s)(?P<is>{_NAME})\s(?:is|matches|corresponds to)\s{_CALLED}"
    r"(?P<is_number>\d{1,3})\b"
    rf"|(?:^[ \t>*+•-]{{0,6}}|\bthe\s)(?P<held>{_NAME})\s\({_CALLED}(?P<held_number>\d{{1,3}})\)"
    rf"|\bcandidate\s(?P<calls_number>\d{{1,3}})\s(?:as\s)?the\s(?P<calls>[^\W\d_]+)",
    re.IGNORECASE | re.MULTILINE,
)
_ITEM = re.compile(
    r"^[ \t>*#-]{0,8}(?:step[ _]?\d{1,2}\W|\d{1,2}[.)])|\b\d{1,2} (?:steps|moves|blocks)\b"
    r"|(?<![a-z])[x×] ?\d\b",
    re.IGNORECASE | re.MULTILINE,
)
_SEVERAL = re.compile(rf"{_NAME}{_SIGN}(?:{_CALLED})?\d{{1,3}}\s?(?:,|&|and)\s?\d", re.IGNORECASE)
"""A name of several blocks, which one number cannot take the place of."""
_SHAPE = re.compile(
    r"\b(?:cube|cylinder|arch|cuboid|prism|cone|slab|block|piece|triangle|pyramid|bar"
    r"|brick)(?:e?s)?\b",
    re.IGNORECASE,
)
_NO_NAME = re.compile(
    r"\b(?:steps?|layers?|plan|answer|order|sequence|total|blocks?|candidates?|size|height"
    r"|width|rows?"
    r"|level|index|confidence|number|schritt|ebene)\b",
    re.IGNORECASE,
)


def with_numbers(text: str) -> str | None:
    """What stands behind the last name that is given a number, with the numbers in the place of
    names; None where the reply names fewer than two, or gives a name two numbers.
    """
    numbers: dict[str, str] = {}
    end = 0
    for given in _GIVEN.finditer(text):
        named = {key: value for key, value in given.groupdict().items() if value}
        number = next(named.pop(key) for key in list(named) if key.endswith("number"))
        (name,) = named.values()
        name = name.lower()
        if _NO_NAME.search(name):
            continue
        if numbers.setdefault(name, number) != number:
            return None
        end = given.end()
    if len(numbers) < 2 or _SEVERAL.search(text):
        return None
    longest = sorted(numbers, key=len, reverse=True)
    any_name = re.compile(
        rf"(?<!\w)(?:{'|'.join(map(re.escape, longest))})(?=s?(?!\w))s?", re.IGNORECASE
    )
    rest = text[end:].split("\n", 1)[-1] if "\n" in text[end:] else text[end:]
    if _SHAPE.search(any_name.sub("", rest)):
        return None
    if re.search(r"\d", _ITEM.sub("", any_name.sub("", rest))):
        return None
    return any_name.sub(lambda found: f"block {numbers[_singular(found[0], numbers)]}", rest)


def _singular(name: str, numbers: dict[str, str]) -> str:
    lower = name.lower()
    return lower if lower in numbers else lower.removesuffix("s")
