"""Lists in a form of their own: JSON, read by its keys."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from phyblock.parsing.chain import chain
from phyblock.parsing.mention import MOST_AT_ONCE
from phyblock.parsing.statement import read_statement
from phyblock.parsing.text_forms import BACKWARD, plain_line

__all__ = [
    "LONGEST_NUMBER",
    "TIMES_KEY",
    "Fields",
    "Found",
    "find_json",
    "line_numbers",
    "objects",
    "whole_number",
]

LONGEST_NUMBER = 6
"""Digits of a number that can be one of a block."""

_MOST_VALUES = 100
"""JSON values that are tried, from the end: a reply that opens brackets for pages is still read."""
_VALUE_CHARS = 20_000
_OPENS = re.compile(r"\{|\[(?=\s{0,20}[\[{\"'\d])")
_BRACKET = re.compile(r"\"(?:[^\"\\\n]|\\.){0,2000}\"|[\[\]{}]")
_TRAILING_COMMA = re.compile(r",(?=\s{0,20}[}\]])")
_COMMENT = re.compile(r"(?<![:\"'\w])//[^\n\"]{0,200}$", re.MULTILINE)

_PLAN_KEY = re.compile(
    r"(?:(?:final|assembly|build(?:ing)?|placement|block|construction|my|the|ordered|move|proposed"
    r"|correct)[ _-]?){0,3}"
    r"(?:plan|steps?|sequence|order(?:ing)?|answer|solution|actions?|moves|instructions|result"
    r"|output|layers"
    r"|assembly|reihenfolge|schritte|antwort|orden|pasos|respuesta|ordre|étapes|顺序|步骤|答案|计划|搭建顺序)",
    re.IGNORECASE,
)
_STEP_KEY = re.compile(
    r"(?:.{0,40}[ _:-])?(?:step|layer|level|schritt|paso|étape|phase|stage|ebene|move|第|步骤"
    r"|层)[ _#-]{0,2}(?P<n>\d{1,3})\D{0,3}"
    r"|(?P<bare>\d{1,3})",
    re.IGNORECASE,
)
_TIERS = ("ground", "base", "bottom", "lower", "middle", "mid", "upper", "top", "roof")
_OPPOSITE_KEY = re.compile(
    r"(?:un|not[ _-]?|non[ _-]?)(?:used|needed|required|necessary|selected|placed)|distract|exclud"
    r"|reject|discard"
    r"|remain|left[ _-]?over|spare|available|candidate(?:s|_list)|ignor|skip|avoid|wrong|draft"
    r"|example|attempt"
    r"|alternativ|initial|previous|old|count|total|number_of|num_|confidence|layers?_count|reason"
    r"|thought|analysis|^(?:to|onto?|target|under|location|destination|next[ _]to)$"
    r"|explanation|descri|comment|note|supports?$|depend|on[ _]?top|below|position|coord|rotation"
    r"|orient|size"
    r"|color|colour|shape|type|blocks?[ _](?:needed|required|used)|required|needed|selected"
    r"|inventory|dictionary"
    r"|unbenutzt|übrig|未使用|多余|干扰|剩余",
    re.IGNORECASE,
)
_INDEX_KEY = re.compile(
    r"(?:(?:block|candidate|piece)[ _-]?)?(?:index|idx|id|number|no)|block|candidate|piece|move"
    r"|place|baustein|积木|编号",
    re.IGNORECASE,
)
_BLOCK_KEY = re.compile(
    r"(?:block|candidate|piece)(?:[ _-]?(?:index|idx|id|number|no))?|积木", re.IGNORECASE
)
"""Keys that outweigh an `id` or `number`, which may be that of the step."""
_ACTION_KEY = re.compile(
    r"action|instruction|operation|description|move|text|do|command", re.IGNORECASE
)
TIMES_KEY = re.compile(r"count|times|quantity|qty|repeat|copies|anzahl|数量", re.IGNORECASE)
_PLACE_KEY = re.compile(
    r"step|order|sequence|layer|level|position_in_order|schritt|步骤", re.IGNORECASE
)
_MANY_KEY = re.compile(
    r"blocks|indices|indexes|ids|candidates|pieces|block_ids|block_indices|积木", re.IGNORECASE
)
_LOOKS_KEY = re.compile(r"shape|color|colour|orientation|type|形状|颜色", re.IGNORECASE)
_BACKWARD_KEY = re.compile(
    r"revers|backward|top[ _-](?:to[ _-]bottom|down)|last[ _-]to[ _-]first", re.I
)
_CHOICE_KEY = re.compile(
    r"(?:plan|option|alternative|variant)[ _-]?(?P<which>[a-d1-4])", re.IGNORECASE
)


@dataclass(frozen=True)
class Found:
    """A list in a form of its own: where it stands, the blocks it names, and whether it is a plan.

    What is no plan (a catalogue of the candidates) stands there all the same, with no numbers.
    """

    start: int
    end: int
    form: str
    numbers: tuple[int, ...]


class Fields(list[tuple[str, Any]]):
    """The fields of a JSON object in order, keys that occur twice included."""


def objects(text: str) -> Iterator[tuple[int, int, Any]]:
    """The outermost JSON values of a text; objects are lists of fields."""
    done = 0
    for opens in list(_OPENS.finditer(text))[-_MOST_VALUES:]:
        if opens.start() < done:
            continue
        end = _closing(text, opens.start())
        value = _decoded(text[opens.start() : end]) if end else None
        if value is not None:
            done = end
            yield opens.start(), end, value


def find_json(text: str) -> list[Found]:
    """The plans and catalogues that stand in a text as JSON."""
    found = []
    for start, end, value in objects(text):
        is_array = isinstance(value, list) and not isinstance(value, Fields)
        if is_array and not any(isinstance(item, (list, str)) for item in value):
            # An array of numbers is what its line says that it is.
            continue
        found.append(Found(start, end, "json", tuple(_read(value, is_plan=is_array))))
    return found


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


def _decoded(piece: str) -> Any:
    usual = _TRAILING_COMMA.sub("", _COMMENT.sub("", piece))
    for way in (piece, usual, usual.replace("'", '"')):
        try:
            return json.loads(way, object_pairs_hook=Fields)
        except (ValueError, RecursionError):
            continue
    return None


def _read(value: Any, *, is_plan: bool) -> list[int]:
    """The blocks of a value; `is_plan`: a key said that it is one, so that numbers are blocks."""
    if isinstance(value, Fields):
        return _object(value, is_plan=is_plan)
    if isinstance(value, list):
        return _items(value)
    if isinstance(value, str):
        return (
            [number for line in value.splitlines() for number in line_numbers(line)]
            if is_plan
            else []
        )
    number = whole_number(value)
    return [number] if is_plan and number is not None else []


def line_numbers(text: str) -> Sequence[int]:
    """The blocks that a line of a value or the cell of a table names."""
    line = plain_line(text)
    return chain(line)[0] or read_statement(line, is_item=True).numbers


def _object(fields: Fields, *, is_plan: bool) -> list[int]:
    if _is_step(fields):
        return _step(fields)
    found = _ordered(fields, is_plan=is_plan)
    is_reversed = any(
        BACKWARD.search(value) if isinstance(value, str) else _BACKWARD_KEY.search(key)
        for key, value in fields
    )
    return found[::-1] if is_reversed else found


def _ordered(fields: Fields, *, is_plan: bool) -> list[int]:
    """The blocks of an object of steps, layers or plans, in the order in which they stand."""
    steps = [(match, value) for key, value in fields if (match := _STEP_KEY.fullmatch(key.strip()))]
    plans = [value for key, value in fields if _PLAN_KEY.fullmatch(key.strip())]
    choices = [(m["which"], v) for k, v in fields if (m := _CHOICE_KEY.fullmatch(k.strip()))]
    if len(choices) > 1:
        chosen = [
            str(v)[-1:].lower()
            for k, v in fields
            if re.search("chosen|choice|selected|best|final", k, re.I)
        ]
        return next((_read(v, is_plan=True) for n, v in choices if n.lower() in chosen), [])
    if plans and not steps:
        read = [_read(value, is_plan=True) for value in plans]
        return next((found for found in reversed(read) if len(found) > 1), max(read, key=len))
    if steps:
        if len({int(m["n"] or m["bare"]) for m, _ in steps}) == len(steps):
            steps.sort(key=lambda step: int(step[0]["n"] or step[0]["bare"]))
        return [number for _, value in steps for number in _read(value, is_plan=True)]
    kept = [(key, value) for key, value in fields if not _OPPOSITE_KEY.search(key)]
    tiers = [_tier(key) for key, _ in kept]
    if kept and all(tier is not None for tier in tiers):
        kept = [kept[i] for i in sorted(range(len(kept)), key=lambda i: tiers[i] or 0)]
    # Beside what holds blocks, a number alone says something of it, but under a place's name.
    is_held = any(isinstance(value, list) for _, value in kept)
    holders = [
        value
        for key, value in kept
        if is_held and (isinstance(value, list) or _tier(key) is not None)
    ]
    values = holders or [value for _, value in kept if is_plan]
    return [number for value in values for number in _read(value, is_plan=is_plan)]


def _tier(key: str) -> int | None:
    words = re.findall(r"[a-z]+", key.lower())
    return next((_TIERS.index(word) for word in words if word in _TIERS), None)


def _items(items: list[Any]) -> list[int]:
    steps = [item for item in items if isinstance(item, Fields)]
    if steps and len(steps) == len(items) and all(_is_step(step) for step in steps):
        looks = all(any(_LOOKS_KEY.fullmatch(k) for k, _ in step) for step in steps)
        numbers = [n for step in steps for n in _step(step)]
        has_place = any(_PLACE_KEY.fullmatch(key) for key, _ in steps[0])
        if looks and not has_place and numbers == list(range(1, len(items) + 1)):
            return []
        places = [_place(step) for step in steps]
        if None not in places and len(set(places)) == len(places):
            steps.sort(key=lambda step: _place(step) or 0)
        return [n for step in steps for n in _step(step)]
    found = [_read(item, is_plan=True) for item in items]
    if any(len(numbers) > 1 and _is_flat(item) for item, numbers in zip(items, found, strict=True)):
        return []
    return [number for numbers in found for number in numbers]


def _is_flat(item: Any) -> bool:
    """Whether an object holds plain values alone: of several numbers no key says which is meant."""
    return isinstance(item, Fields) and not any(isinstance(v, (list, str)) for _, v in item)


def _is_step(fields: Fields) -> bool:
    """Whether an object is one step: it has the number of a block, some, or an action."""
    keys = {key.strip() for key, value in fields if not isinstance(value, Fields)}
    named = any(_INDEX_KEY.fullmatch(k) or _MANY_KEY.fullmatch(k) for k in keys)
    acts = any(_ACTION_KEY.fullmatch(k) for k in keys)
    placed = any(_PLACE_KEY.fullmatch(k) for k in keys)
    alone = any(isinstance(v, (list, Fields)) for k, v in fields if _PLAN_KEY.fullmatch(k.strip()))
    return not alone and ((named and (placed or acts or _one(fields))) or (acts and placed))


def _one(fields: Fields) -> bool:
    return any(
        _INDEX_KEY.fullmatch(k.strip()) and not isinstance(v, (list, Fields)) for k, v in fields
    )


def _place(fields: Fields) -> int | None:
    return next((whole_number(v) for k, v in fields if _PLACE_KEY.fullmatch(k.strip())), None)


def _step(fields: Fields) -> list[int]:
    """The blocks of one step: by its index, else by a list of them, else by what it does."""
    found: list[int] = []
    for pattern in (_BLOCK_KEY, _INDEX_KEY, _MANY_KEY, _ACTION_KEY):
        for key, value in fields:
            if not found and pattern.fullmatch(key.strip()):
                found = _read(value, is_plan=True)
    times = next((whole_number(v) for k, v in fields if TIMES_KEY.fullmatch(k.strip())), None)
    return found * min(times or 1, MOST_AT_ONCE) if len(found) == 1 else found
