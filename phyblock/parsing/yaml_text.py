"""YAML in a reply, written as JSON: lists and mappings by indentation, and flow forms within them.

Only what replies hold is known: no anchors, no tags, no texts over several lines.
"""

from __future__ import annotations

import json
import re
from typing import Any

__all__ = ["yaml_as_json"]

_FENCED = re.compile(r"```ya?ml[ \t]*\n(?P<held>.{1,20000}?)(?:\n[ \t]*```|\Z)", re.I | re.S)
_KEYS = r"(?:step|seq|block|candidate|piece|index|idx|id|action|move|number)(?:[ _]?\w{1,9})?"
_BLOCK = re.compile(
    r"(?:^(?:---|[ \t]{0,20}(?:- )?[\w\"']{1,30}:(?: [^\n]{0,300})?)[ \t]*\n){0,20}"
    rf"(?:^[ \t]{{0,20}}- (?:\{{[ \t]*)?{_KEYS}:[ \t][^\n]{{1,300}}(?:\n|\Z)"
    r"(?:^[ \t]{1,20}(?!- )[\w\"']{1,30}:[ \t][^\n]{0,300}(?:\n|\Z)){0,20}){2,200}"
    rf"|^[\w]{{1,30}}:[ \t]*\n(?:^[ \t]{{1,20}}[\w]{{0,20}}\d{{1,2}}:[ \t][^\n]{{1,300}}(?:\n"
    rf"|\Z)){{2,100}}",
    re.MULTILINE,
)
_PAIR = re.compile(
    r"(?P<key>[\w.\-]{1,40}|\"[^\"\n]{1,40}\"|'[^'\n]{1,40}'):(?:\s+(?P<value>.*))?\Z"
)
_COMMENT = re.compile(r"\s#\s?[^\"'\n]{0,200}\Z")
_BARE_KEY = re.compile(r"(?<=[{,])\s{0,9}([A-Za-z_]\w{0,30})\s{0,3}:")
_MOST_DEPTH = 12
_Lines = list[tuple[int, str]]


def yaml_as_json(text: str) -> str:
    """A text with its YAML, fenced or as steps line by line, as JSON in a line."""
    if "yaml" in text or "yml" in text.lower():
        text = _FENCED.sub(lambda found: _json_of(found["held"]) or found[0], text)
    return _BLOCK.sub(lambda found: _json_of(found[0]) or found[0], text) if ":" in text else text


def _json_of(text: str) -> str:
    lines: _Lines = []
    for line in text.splitlines():
        plain = _COMMENT.sub("", line).rstrip()
        if plain.strip() and plain.strip() not in ("---", "..."):
            lines.append((len(plain) - len(plain.lstrip()), plain.strip()))
    value, rest = _value(lines, 0) if lines else (None, [])
    is_text = isinstance(value, list) and all(isinstance(item, str) for item in value)
    is_whole = isinstance(value, (dict, list)) and value and not rest and not is_text
    return f"\n{json.dumps(value, ensure_ascii=False)}\n" if is_whole else ""


def _value(lines: _Lines, depth: int) -> tuple[Any, _Lines]:
    """The value that lines begin with, and the lines behind it; None where they are no YAML."""
    if depth > _MOST_DEPTH:
        return None, lines
    return _list(lines, depth) if lines[0][1].startswith("- ") else _mapping(lines, depth)


def _list(lines: _Lines, depth: int) -> tuple[Any, _Lines]:
    indent, items = lines[0][0], []
    while lines and lines[0][0] == indent and lines[0][1].startswith("- "):
        held = lines[0][1][2:].strip()
        if _PAIR.match(held) and not held.startswith("{"):
            item, lines = _value([(indent + 2, held), *lines[1:]], depth + 1)
        else:
            item, lines = _scalar(held), lines[1:]
        if item is None:
            return None, lines
        items.append(item)
    return items, lines


def _mapping(lines: _Lines, depth: int) -> tuple[Any, _Lines]:
    indent, fields = lines[0][0], {}
    while lines and lines[0][0] == indent and (pair := _PAIR.match(lines[0][1])):
        key, held = pair["key"].strip("\"'"), (pair["value"] or "").strip()
        lines = lines[1:]
        below = lines and (
            lines[0][0] > indent or (lines[0] >= (indent, "- ") and lines[0][1][:2] == "- ")
        )
        if held:
            fields[key] = _scalar(held)
        elif below:
            fields[key], lines = _value(lines, depth + 1)
        else:
            fields[key] = ""
        if fields[key] is None:
            return None, lines
    return fields or None, lines


def _scalar(held: str) -> Any:
    if held[:1] in "[{":
        try:
            return json.loads(_BARE_KEY.sub(r' "\1":', held))
        except (ValueError, RecursionError):
            return held
    return int(held) if re.fullmatch(r"\d{1,6}", held) else held.strip("\"'")
