"""How replies write one operation of step planning, `Move(3)` or `Done`: in words and as JSON.

A mention counts where its clause means it: not "after Move(3)", not "Move(3)?".
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, Literal

from phyblock.parsing.json_values import Fields, objects

__all__ = [
    "ANSWER_LINE",
    "CALL",
    "DONE",
    "INTEGER",
    "LABEL",
    "MENTION",
    "OPERATION",
    "PHRASE",
    "Operation",
    "is_not_meant",
    "mentions",
    "named",
    "number_of",
    "operation_of",
    "operations_of",
]

Operation = int | Literal["done"]

_LARGEST_DIGITS = 6
_TOO_LARGE = 1_000_000
"""What a longer number is read as: no candidate has either."""

INTEGER = r"(?P<number>[-+\u2212]?[0-9]+)(?![0-9])(?![.,][0-9])"
CALL = (
    rf"move\s{{0,3}}[(\[]\s{{0,9}}(?:(?:id|index|block)\s{{0,3}}[=:]\s{{0,3}})?[\"'#<]?"
    rf"{INTEGER}[\"'>]?\s{{0,9}}[)\]]"
)
PHRASE = (
    rf"move\s{{1,3}}(?:the\s)?(?:block|candidate)\s{{1,3}}(?:with\s)?"
    rf"(?:the\s)?(?:index|number|id)\s{{0,3}}[=:#]?\s{{0,3}}[(\"'\[]?{INTEGER}[)\"'\]]?"
)
DONE = r"(?:done|fertig|terminé|hecho|listo|готово|完成|完了|완료)(?:\s{0,3}\(\s{0,3}\))?"


def named(pattern: str, name: str) -> str:
    """A pattern of one operation with its number under another name."""
    return pattern.replace("?P<number>", f"?P<{name}>")


LABEL = (
    r"(?:(?:my|the|your|final|next|chosen|selected|single|best|nächste[rs]?|siguiente"
    r"|prochaine?)\s{1,3}){0,3}"
    r"(?:plan|best|zug|schritt|paso|acción|step(?:\s{0,2}#?[0-9]{1,3})?|answer|action|operation"
    r"|move|output|decision|choice"
    r"|attempt|next|correction)"
    r"\s{0,3}(?:is|:|=|->|\u2192)\s{0,3}"
)
OPERATION = rf"(?:{named(CALL, 'call')}|{named(PHRASE, 'phrase')}|(?P<done>{DONE}))"
ANSWER_LINE = re.compile(rf"(?:{LABEL}:?\s{{0,3}})?{OPERATION}\s{{0,3}}[.!;]?", re.IGNORECASE)
MENTION = re.compile(
    rf"(?<![\w]){named(CALL, 'call')}|(?<![\w]){named(PHRASE, 'phrase')}", re.IGNORECASE
)
_NOT_MEANT = re.compile(
    r"\b(?:undo|remov\w+|revert\w*|take back|don['\u2019]t|do not|never|cannot|can['\u2019]t|after"
    r"|since|because|last|previous\w*|prior|earlier|instead of|rather than)\b[^.;:,!?]{0,60}\Z",
    re.IGNORECASE,
)
"""What stands before an operation in its clause that is not the one to do now."""
_CLAUSE_CHARS = 100
_ASKED = re.compile(r"[^.!?;\n]{0,80}\?")
_MANY = re.compile(
    r"(?<!\w)move\s{0,3}[(\[]\s{0,9}(?P<list>[0-9]{1,6}"
    r"(?:\s{0,3}(?:[,;/&]|and|or)\s{0,3}[0-9]{1,6}){1,31})(?![0-9])",
    re.IGNORECASE,
)
_INDEX_KEYS = ("index", "block_index", "id", "block_id", "block", "candidate", "number", "n")
_INDEX_ALONE = _INDEX_KEYS[:4]
"""Keys that are enough without an action."""
_ACTION_KEYS = (
    *("action", "operation", "next_plan", "next plan", "plan", "answer", "move", "step", "op"),
    *("name", "function", "tool"),
)


def number_of(digits: str) -> int:
    """The number that digits with or without a sign are."""
    sign = -1 if digits[0] in "-\u2212" else 1
    bare = digits.lstrip("+-\u2212").lstrip("0") or "0"
    return sign * (int(bare) if len(bare) <= _LARGEST_DIGITS else _TOO_LARGE)


def operation_of(match: re.Match[str]) -> Operation:
    """The operation that a match of `OPERATION`, `CALL` or `PHRASE` holds."""
    groups = match.groupdict()
    digits = groups.get("call") or groups.get("phrase")
    return number_of(digits) if digits else "done"


def is_not_meant(text: str, start: int) -> bool:
    """Whether the clause before an operation says that it is not the one to do now."""
    before = text[max(0, start - _CLAUSE_CHARS) : start]
    return bool(_NOT_MEANT.search(before[before.rfind("\n") + 1 :]))


def mentions(line: str) -> list[Operation]:
    """The operations that a line calls by name and means."""
    found = [
        operation_of(match)
        for match in MENTION.finditer(line)
        if not is_not_meant(line, match.start()) and not _ASKED.match(line, match.end())
    ]
    for many in _MANY.finditer(line):
        found += [int(digits) for digits in re.findall("[0-9]+", many["list"])]
    return found


def operations_of(value: Any) -> list[Operation]:
    """The operations that a JSON value names: those of its innermost objects, else its own."""
    inner = value if isinstance(value, list) and not isinstance(value, Fields) else _held(value)
    found = [operation for held in inner for operation in operations_of(held)]
    if found or not isinstance(value, Fields):
        return found
    own = _of_fields(dict(_flat(value)))
    return [] if own is None else [own]


def _held(value: Any) -> list[Any]:
    return [held for _, held in value] if isinstance(value, Fields) else []


def _flat(value: Any) -> Iterator[tuple[str, Any]]:
    """The fields of an object and of those within it, as a call of a function has them."""
    for key, held in value if isinstance(value, Fields) else ():
        yield str(key).strip().lower(), held
        is_text = isinstance(held, str) and held.lstrip().startswith("{")
        for inner in [v for *_, v in objects(held)] if is_text else [held]:
            yield from _flat(inner)


def _of_fields(fields: Mapping[str, Any]) -> Operation | None:
    """The operation that the fields of an object name, or None."""
    index = next((_whole(fields[key]) for key in _INDEX_KEYS if key in fields), None)
    for key in _ACTION_KEYS:
        value = fields.get(key)
        if key == "move" and _whole(value) is not None:
            return _whole(value)
        word = value.strip() if isinstance(value, str) else ""
        if word.lower() == "move" and index is not None:
            return index
        if match := ANSWER_LINE.fullmatch(word):
            return operation_of(match)
    has_action = any(key in fields for key in _ACTION_KEYS)
    is_alone = not has_action and any(key in fields for key in _INDEX_ALONE)
    return index if is_alone else None


def _whole(value: object) -> int | None:
    if isinstance(value, str):
        return number_of(value.strip()) if re.fullmatch("[-+]?[0-9]+", value.strip()) else None
    if isinstance(value, bool) or not isinstance(value, int):
        return None
    return max(-_TOO_LARGE, min(_TOO_LARGE, value))
