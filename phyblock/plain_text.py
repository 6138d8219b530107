"""Text that others wrote (names, replies, paths), made harmless where we show or store it."""

from __future__ import annotations

import re
from collections.abc import Sequence

__all__ = ["counted", "csv_cell", "one_line", "plain_lines", "some_of", "well_formed"]

_SOME = 5
_HALF = re.compile("[\ud800-\udfff]")
_FORMULA = re.compile(r"'*[=+\-@\t\r\n]")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def well_formed(text: str) -> str:
    """The text with U+FFFD in the place of lone surrogates, which cannot be written as UTF-8."""
    return _HALF.sub("\ufffd", text)


def one_line(text: str) -> str:
    """Text on one line: a space for each newline and control character.

    Half a character, as it stands for a byte of a file name that is not UTF-8, becomes U+FFFD.
    Marks that turn the direction of writing go, too: they would change what stands beside them.
    """
    if text.isprintable():
        return text
    text = well_formed(text)
    return "".join(c if c.isprintable() else " " for c in text)


def plain_lines(text: str) -> str:
    """Text whose lines are each as `one_line` makes them."""
    return "\n".join(map(one_line, text.split("\n")))


def counted(number: int, noun: str, several: str = "") -> str:
    """A number with its noun: `1 call`, `2 calls`; `several` is a plural that takes no plain s."""
    return f"{number:,} {noun if number == 1 else several or noun + 's'}"


def some_of(names: Sequence[str]) -> str:
    """The first names of a list that may be long: what errors tell of what is allowed."""
    return ", ".join([*names[:_SOME], *["..."] * (len(names) > _SOME)]) or "none"


def csv_cell(value: object) -> object:
    """A value as a cell of a CSV file that a spreadsheet never takes for a formula.

    Text that begins with `=`, `+`, `-`, `@`, a tab or a line break gets an apostrophe before it;
    so does text that begins with apostrophes and then one of these, so that one apostrophe taken
    away gives back what was there. Numbers, as numbers or as text, stay as they are.
    """
    if isinstance(value, str) and _FORMULA.match(value) and not _NUMBER.fullmatch(value):
        return f"'{value}"
    return value
