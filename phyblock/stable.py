"""Digests, draws and sums that are the same on every machine and every Python."""

from __future__ import annotations

import functools
import hashlib
import operator
from collections.abc import Iterable
from typing import TypeVar

_N = TypeVar("_N", int, float)


def hex_digest(content: bytes | str) -> str:
    """Return the SHA-256 of bytes, or of a text as UTF-8, in hexadecimal digits."""
    data = content.encode() if isinstance(content, str) else content
    return hashlib.sha256(data).hexdigest()


def drawn_bytes(*words: object) -> bytes:
    """Return evenly spread bytes that depend on the words alone, to sort by or to draw from."""
    return hashlib.sha256("|".join(map(str, words)).encode()).digest()


def plain_sum(values: Iterable[_N]) -> _N:
    """Add one after another to 0, each sum rounded.

    From Python 3.12 on `sum` makes up for what rounding loses, so that its last digits may differ.
    What enters data, records or tables is summed up here.
    """
    return functools.reduce(operator.add, values, 0)
