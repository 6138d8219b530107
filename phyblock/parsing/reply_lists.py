"""The lists of a reply in order: JSON and tables as they stand, the rest line by line."""

from __future__ import annotations

import re
from bisect import bisect_left

from phyblock.parsing.line_patterns import INLINE_STEP, TAG
from phyblock.parsing.line_reader import LineReader
from phyblock.parsing.listing import Listing
from phyblock.parsing.structured import Found, find_json
from phyblock.parsing.text_tables import find_tables

__all__ = ["listings"]


def listings(text: str) -> tuple[list[Listing], list[str]]:
    """The lists of a text in order, and the lines that stand below the last one."""
    text = INLINE_STEP.sub("\n", TAG.sub(_of_tag, _ROWS.sub(_in_line, text)))
    reader = LineReader()
    forms = sorted(_apart(text), key=lambda found: found.start)
    starts = [found.start for found in forms]
    at = 0
    for number, line in enumerate(text.splitlines(keepends=True)):
        here = bisect_left(starts, at + len(line))
        inside = next((f for f in forms[max(0, here - 1) : here] if f.end > at), None)
        if inside is None:
            reader.read(number, line)
        else:
            if at <= inside.start:
                reader.read(number, line[: inside.start - at])
                reader.take(number, inside)
            if inside.end < at + len(line):
                reader.read(number, line[inside.end - at :])
        at += len(line)
    return reader.done, reader.above


_ROWS = re.compile(r"\[\s{0,9}(?:\d{1,6},?[ \t]{0,9}(?:(?:#|//)[^\n]{0,200})?\n\s{0,40}){1,63}\]")
_ROW = re.compile(r"^\W{0,40}(\d{1,6})", re.MULTILINE)


def _in_line(rows: re.Match[str]) -> str:
    """An array of numbers without its line ends and comments."""
    return f"[{', '.join(_ROW.findall(rows[0]))}]"


def _of_tag(tag: re.Match[str]) -> str:
    """The move that an empty element holds in its attributes; of others, that a line ends."""
    return f"\nMove block {tag['block']}\n" if tag["block"] else "\n"


def _apart(text: str) -> list[Found]:
    """JSON and tables of a text; JSON of a few words within a line is left to the line."""
    tables = find_tables(text)
    values = [
        f for f in find_json(text) if not any(t.start < f.end and f.start < t.end for t in tables)
    ]
    return tables + values
