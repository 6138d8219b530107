"""Foreign text made safe to show and store; digests, draws and sums equal on every machine."""

from __future__ import annotations

import difflib
import functools
import hashlib
import operator
import re
from collections.abc import Iterable, Sequence
from typing import TypeVar

_N = TypeVar("_N", int, float)

_SOME = 5
_HALF = re.compile("[\ud800-\udfff]")
_FORMULA = re.compile(r"'*[=+\-@\t\r\n]")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def well_formed(text: str) -> str:
    """Return the text with U+FFFD for lone surrogates, which cannot be written as UTF-8."""
    return text if text.isascii() else _HALF.sub("\ufffd", text)


def one_line(text: str) -> str:
    """Return the text on one line: a space for each newline and control character.

    A lone surrogate, which stands for a byte of a file name that is not UTF-8, becomes U+FFFD.
    Marks that change the writing direction are removed: they would affect the text beside them.
    """
    if text.isprintable():
        return text
    text = well_formed(text)
    return "".join(c if c.isprintable() else " " for c in text)


def plain_lines(text: str) -> str:
    """Return the text with each line as `one_line` makes it."""
    return "\n".join(map(one_line, text.split("\n")))


def counted(number: int, noun: str, several: str = "") -> str:
    """Return a number with its noun, `1 call`, `2 calls`; `several` is an irregular plural."""
    return f"{number:,} {noun if number == 1 else several or noun + 's'}"


def some_of(names: Sequence[str]) -> str:
    """Return the first names of a list that may be long, for the `allowed` of an error."""
    return ", ".join([*names[:_SOME], *["..."] * (len(names) > _SOME)]) or "none"


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return a hint at the known word most like `word`, ignoring case; "" if none is close."""
    folded = {name.casefold(): name for name in known}
    matches = difflib.get_close_matches(word.casefold(), folded, n=1)
    return f"did you mean {folded[matches[0]]}?" if matches else ""


def csv_cell(value: object) -> object:
    """Return a value as a cell of a CSV file that a spreadsheet never takes for a formula.

    Text that begins with `=`, `+`, `-`, `@`, a tab or a line break, even after apostrophes, gets an
    apostrophe before it, so that removing one restores it. Numbers, also as text, stay as they are.
    """
    if isinstance(value, str) and _FORMULA.match(value) and not _NUMBER.fullmatch(value):
        return f"'{value}"
    return value


def hex_digest(content: bytes | str) -> str:
    """Return the SHA-256 of bytes, or of a text as UTF-8, in hexadecimal digits."""
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()


def drawn_bytes(*words: object) -> bytes:
    """Return evenly spread bytes that depend only on the words, to sort by or to draw from."""
    return hashlib.sha256("|".join(map(str, words)).encode()).digest()


def plain_sum(values: Iterable[_N]) -> _N:
    """Return the sum of values, added one after another and rounded each time.

    From Python 3.12 on, `sum` compensates for rounding: last digits of data or tables would differ.
    """
    return functools.reduce(operator.add, values, 0)
