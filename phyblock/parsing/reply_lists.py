"""The lists of a reply in order: JSON and tables as they stand, the rest line by line."""

from __future__ import annotations

import re
from bisect import bisect_left
from dataclasses import dataclass

from phyblock.parsing.line_patterns import INLINE_STEP, TAG
from phyblock.parsing.line_reader import LineReader
from phyblock.parsing.listing import Listing
from phyblock.parsing.plain_layout import plain_layout
from phyblock.parsing.slips import without_slips
from phyblock.parsing.structured import Found, find_json
from phyblock.parsing.text_tables import find_tables
from phyblock.parsing.tier_lists import find_tier_lists

__all__ = ["ReplyLists", "reply_lists"]


@dataclass(frozen=True)
class ReplyLists:
    """The lists of a text in order, its lines, and those of them that stand below the last list."""

    lists: list[Listing]
    below: list[str]
    lines: list[str]


def reply_lists(text: str) -> ReplyLists:
    """The lists of a text."""
    text = INLINE_STEP.sub(
        "\n", TAG.sub(_of_tag, _ROWS.sub(_in_line, plain_layout(without_slips(text))))
    )
    reader = LineReader()
    forms = sorted(_apart(text), key=lambda found: found.start)
    starts = [found.start for found in forms]
    at = 0
    lines = text.splitlines(keepends=True)
    for number, line in enumerate(lines):
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
    return ReplyLists(reader.done, reader.above, lines)


_ROWS = re.compile(r"\[\s{0,9}(?:\d{1,6},?[ \t]{0,9}(?:(?:#|//)[^\n]{0,200})?\n\s{0,40}){1,63}\]")
_ROW = re.compile(r"^\W{0,40}(\d{1,6})", re.MULTILINE)


def _in_line(rows: re.Match[str]) -> str:
    """An array of numbers without its line ends and comments."""
    return f"[{', '.join(_ROW.findall(rows[0]))}]"


def _of_tag(tag: re.Match[str]) -> str:
    """The move that an empty element holds in its attributes; of others, that a line ends."""
    return f"\nMove block {tag['block']}\n" if tag["block"] else "\n"


def _apart(text: str) -> list[Found]:
    """Tables, JSON and layers of a text; JSON of a few words within a line is left to the line."""
    found = find_tables(text)
    for others in (find_json(text), find_tier_lists(text)):
        found += [f for f in others if not any(g.start < f.end and f.start < g.end for g in found)]
    return found
