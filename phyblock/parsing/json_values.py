"""JSON in a text: its outermost values, and one that the end of the text cuts off."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

__all__ = ["LONGEST_NUMBER", "Fields", "cut_off", "decoded", "objects", "whole_number"]

LONGEST_NUMBER = 6
"""Digits of a number that can be one of a block."""

_MOST_VALUES = 100
"""JSON values that are tried, from the end: a reply that opens brackets for pages is still read."""
_VALUE_CHARS = 20_000
_OPENS = re.compile(r"\{|\[(?=\s{0,20}[\[{\"'\d])")
_BRACKET = re.compile(r"\"(?:[^\"\\\n]|\\.){0,2000}\"|[\[\]{}]")
_PART = re.compile(r"\"(?:[^\"\\\n]|\\.){0,2000}\"|[\[\]{},]")
_MOST_PARTS = 8
"""Places at which a broken value is tried to be closed, from the end."""
_TRAILING_COMMA = re.compile(r",(?=\s{0,20}[}\]])")
_COMMENT = re.compile(r"(?<![:\"'\w])//[^\n\"]{0,200}$", re.MULTILINE)


class Fields(list[tuple[str, Any]]):
    """The fields of a JSON object in order, keys that occur twice included."""


def objects(text: str) -> Iterator[tuple[int, int, Any]]:
    """The outermost JSON values of a text; objects are lists of fields."""
    done = 0
    for opens in list(_OPENS.finditer(text))[-_MOST_VALUES:]:
        if opens.start() < done:
            continue
        end = _closing(text, opens.start())
        value = decoded(text[opens.start() : end]) if end else None
        if value is not None:
            done = end
            yield opens.start(), end, value


def cut_off(text: str, done: int) -> tuple[int, int, Any] | None:
    """The outermost value that the text breaks off in, closed behind the last whole part of it."""
    opens = _OPENS.search(text, max(done, len(text) - _VALUE_CHARS))
    if text.rstrip()[-1:].isdigit():  # More digits may have followed.
        return None
    if opens is None or _closing(text, opens.start()):
        return None
    open_brackets, ends = [], []
    for mark in _PART.finditer(text, opens.start()):
        if mark[0] in "[{":
            open_brackets.append("]" if mark[0] == "[" else "}")
        elif mark[0] in "]}" and open_brackets:
            open_brackets.pop()
        if mark[0] in "]}" or (mark[0] == "," and open_brackets[-1:] == ["]"]):
            at = mark.start() if mark[0] == "," else mark.end()
            ends.append((at, "".join(reversed(open_brackets))))
    for at, closers in ends[:-_MOST_PARTS:-1]:
        value = decoded(text[opens.start() : at] + closers) if closers else None
        if value is not None:
            return opens.start(), len(text), value
    return None


def whole_number(value: object) -> int | None:
    """A JSON value that is a number of a block, also as text; None for others."""
    if isinstance(value, str) and re.fullmatch(r"\s{0,9}#?\d{1,6}\s{0,9}", value):
        return int(value.strip().lstrip("#"))
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def _closing(text: str, start: int) -> int:
    """Where the bracket at `start` is closed; 0 where it is not, or too late."""
    depth = 0
    for mark in _BRACKET.finditer(text, start, min(len(text), start + _VALUE_CHARS)):
        if mark[0] in "[{":
            depth += 1
        elif mark[0] in "]}":
            depth -= 1
            if not depth:
                return mark.end()
    return 0


def decoded(piece: str) -> Any:
    """The value of a piece of text, comments, last commas and single quotes allowed; None: none."""
    usual = _TRAILING_COMMA.sub("", _COMMENT.sub("", piece))
    for way in (piece, usual, usual.replace("'", '"')):
        try:
            return json.loads(way, object_pairs_hook=Fields)
        except (ValueError, RecursionError):
            continue
    return None
