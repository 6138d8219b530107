"""Lists in a form of their own: JSON, read by its keys."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from phyblock.parsing.chain import chain
from phyblock.parsing.json_keys import (
    ACTION_KEY,
    ARGUMENTS_KEY,
    BLOCK_KEY,
    CHOICE_KEY,
    INDEX_KEY,
    LOOKS_KEY,
    MANY_KEY,
    OPPOSITE_KEY,
    PLACE_KEY,
    PLAN_KEY,
    STEP_KEY,
    STEP_TEXT,
    TIMES_KEY,
)
from phyblock.parsing.json_values import Fields, cut_off, decoded, objects, whole_number
from phyblock.parsing.mention import MOST_AT_ONCE
from phyblock.parsing.plan_patterns import DOWNWARD, NOT_REVERSED
from phyblock.parsing.speech import BACKWARD, TAKES_BACK, words
from phyblock.parsing.statement import read_statement
from phyblock.parsing.text_forms import plain_line
from phyblock.parsing.tiers import lowest_first, tier_of

__all__ = ["Found", "find_json", "line_numbers"]

_REVISES = words(TAKES_BACK, r"\b(?:instead|example|or|again|no)\b")
"""Words between objects that are not steps of one plan."""


@dataclass(frozen=True)
class Found:
    """A list in a form of its own: where it stands, the blocks it names, and whether it is a plan.

    What is no plan (a catalogue of the candidates) stands there all the same, with no numbers;
    what may only describe what is seen does not say that it moves.
    """

    start: int
    end: int
    form: str
    numbers: tuple[int, ...]
    says_moves: bool = True


def find_json(text: str) -> list[Found]:
    """The plans and catalogues that stand in a text as JSON."""
    found = []
    for start, end, value in _values(text):
        is_array = isinstance(value, list) and not isinstance(value, Fields)
        if is_array and not any(isinstance(item, (list, str)) for item in value):
            # An array of numbers is what its line says that it is.
            continue
        numbers = _read(value, is_plan=is_array) or _written(value)
        found.append(Found(start, end, "json", tuple(numbers)))
    return found


def _values(text: str) -> list[tuple[int, int, Any]]:
    """The JSON values of a text; objects that are one step each are one list, as lines are.

    A value that the end of the text cuts off is what stands there whole.
    """
    values = list(objects(text))
    cut = cut_off(text, values[-1][1] if values else 0)
    values += [cut] if cut else []
    steps = [_is_step(_arguments(v)) for _, _, v in values if isinstance(v, Fields)]
    if len(steps) < 2 or not all(steps) or len(steps) < len(values):
        return values
    places = [_place(value) for _, _, value in values]
    is_known = None not in places
    is_one = (
        len({*places}) == len(places)
        if is_known
        else not any(
            _REVISES.search(text[end:start]) for (_, end, _), (start, _, _) in pairwise(values)
        )
    )
    return [(values[0][0], values[-1][1], [value for _, _, value in values] if is_one else [])]


def _read(value: Any, *, is_plan: bool) -> list[int]:
    """The blocks of a value; `is_plan`: a key said that it is one, so that numbers are blocks."""
    if isinstance(value, Fields):
        return _object(value, is_plan=is_plan)
    if isinstance(value, list):
        return _items(value, is_plan=is_plan)
    if isinstance(value, str):
        return (
            [number for line in value.splitlines() for number in line_numbers(line)]
            if is_plan
            else []
        )
    number = whole_number(value)
    return [number] if is_plan and number is not None else []


def _written(value: Any) -> list[int]:
    """The blocks of the one text within a value that is a plan, a step a line."""
    if isinstance(value, str):
        lines = [line for line in value.splitlines() if line.strip()]
        named = [list(line_numbers(line)) for line in lines if STEP_TEXT.match(line)]
        return [n for of_line in named for n in of_line] if len(named) == len(lines) > 1 else []
    if not isinstance(value, Fields):
        return []
    held = [_written(field) for key, field in value if not OPPOSITE_KEY.search(key)]
    plans = [numbers for numbers in held if numbers]
    return plans[0] if len(plans) == 1 else []


def line_numbers(text: str) -> Sequence[int]:
    """The blocks that a line of a value or the cell of a table names."""
    line = plain_line(text)
    return chain(line)[0] or read_statement(line, is_item=True).numbers


def _arguments(fields: Fields) -> Fields:
    """What a call of a function is given; of another object, the object itself."""
    for key, value in fields:
        if ARGUMENTS_KEY.fullmatch(key.strip()):
            held = decoded(value) if isinstance(value, str) else value
            if isinstance(held, Fields):
                return _arguments(held)
    return fields


def _object(fields: Fields, *, is_plan: bool) -> list[int]:
    fields = _arguments(fields)
    if _is_step(fields):
        return _step(fields)
    found = _ordered(fields, is_plan=is_plan)
    return (
        found[::-1] if any(_says_down(plain_line(key), value) for key, value in fields) else found
    )


_YES = ("true", "yes")


def _says_down(key: str, value: Any) -> bool:
    """Whether a field says that the list stands in the opposite order, by its text or its key.

    A key says so of a list, or where it is answered with yes: `{"reverse": false}` denies it.
    """
    if isinstance(value, str) and value.strip(" .!").lower() not in _YES:
        return bool(BACKWARD.search(value) and not NOT_REVERSED.search(value))
    return bool(value and (BACKWARD.search(key) or DOWNWARD.search(key)))


def _ordered(fields: Fields, *, is_plan: bool) -> list[int]:
    """The blocks of an object of steps, layers or plans, in the order in which they stand."""
    steps = [(match, value) for key, value in fields if (match := STEP_KEY.fullmatch(key.strip()))]
    plans = [value for key, value in fields if PLAN_KEY.fullmatch(key.strip())]
    choices = [(m["which"], v) for k, v in fields if (m := CHOICE_KEY.fullmatch(k.strip()))]
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
    kept = [(key, value) for key, value in fields if not OPPOSITE_KEY.search(key)]
    if rising := lowest_first([key for key, _ in kept]):
        kept = [kept[i] for i in rising]
    named = [(key, value) for key, value in kept if MANY_KEY.fullmatch(key.strip())]
    kept = named if len(named) == 1 and isinstance(named[0][1], list) else kept
    # Beside what holds blocks, a number alone says something of it, but under a place's name.
    is_held = any(isinstance(value, list) for _, value in kept)
    holders = [
        value
        for key, value in kept
        if is_held and (isinstance(value, list) or tier_of(key) is not None)
    ]
    values = holders or [value for _, value in kept if is_plan]
    return [number for value in values for number in _read(value, is_plan=is_plan)]


def _items(items: list[Any], *, is_plan: bool) -> list[int]:
    steps = [_arguments(item) for item in items if isinstance(item, Fields)]
    if steps and len(steps) == len(items) and all(_is_step(step) for step in steps):
        looks = all(any(LOOKS_KEY.fullmatch(k) for k, _ in step) for step in steps)
        numbers = [n for step in steps for n in _step(step)]
        has_place = any(PLACE_KEY.fullmatch(key) for key, _ in steps[0])
        is_counted = numbers == list(range(1, len(items) + 1))
        if looks and not has_place and (is_counted or not is_plan):
            return []
        places = [_place(step) for step in steps]
        if None in places:
            places = _counted_places(steps)
        if None not in places and len(set(places)) == len(places):
            by_place = sorted(zip(places, steps, strict=True), key=lambda pair: pair[0] or 0)
            steps = [step for _, step in by_place]
        return [n for step in steps for n in _step(step)]
    if len(steps) == len(items) and (rising := lowest_first([_title(step) for step in steps])):
        items = [items[i] for i in rising]
    if is_plan and len(steps) == len(items) > 1 and (numbers := _counted_values(steps)):
        return numbers
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
    named = any(INDEX_KEY.fullmatch(k) or MANY_KEY.fullmatch(k) for k in keys)
    acts = any(ACTION_KEY.fullmatch(k) for k in keys)
    placed = any(PLACE_KEY.fullmatch(k) for k in keys)
    alone = any(isinstance(v, (list, Fields)) for k, v in fields if PLAN_KEY.fullmatch(k.strip()))
    return not alone and ((named and (placed or acts or _one(fields))) or (acts and placed))


def _one(fields: Fields) -> bool:
    return any(
        INDEX_KEY.fullmatch(k.strip()) and not isinstance(v, (list, Fields)) for k, v in fields
    )


def _place(fields: Fields) -> int | None:
    return next((whole_number(v) for k, v in fields if PLACE_KEY.fullmatch(k.strip())), None)


def _counted_places(steps: list[Fields]) -> list[int | None]:
    """The places of steps by the one key, beside that of the block, that counts them from 1."""
    for key, _ in steps[0]:
        values = [whole_number(next((v for k, v in step if k == key), None)) for step in steps]
        is_other = not (BLOCK_KEY.fullmatch(key.strip()) or TIMES_KEY.fullmatch(key.strip()))
        others = [k for k, _ in steps[0] if k != key and INDEX_KEY.fullmatch(k.strip())]
        if is_other and others and set(values) == {*range(1, len(steps) + 1)}:
            return values
    return [None] * len(steps)


def _counted_values(steps: list[Fields]) -> list[int]:
    """The blocks of objects of two numbers each, of which one counts the objects from 1."""
    keys = [key for key, _ in steps[0]]
    columns = [[whole_number(v) for _, v in step] for step in steps]
    if len(keys) != 2 or any([key for key, _ in step] != keys for step in steps):
        return []
    places, blocks = zip(*columns, strict=True)
    is_counted = list(places) == [*range(1, len(steps) + 1)] and not TIMES_KEY.fullmatch(keys[1])
    return (
        [block for block in blocks if block is not None]
        if is_counted and None not in blocks
        else []
    )


def _title(fields: Fields) -> str:
    """What the texts of an object call it."""
    return next((v for _, v in fields if isinstance(v, str)), "")


def _step(fields: Fields) -> list[int]:
    """The blocks of one step: by its index, else by a list of them, else by what it does."""
    found: list[int] = []
    for pattern in (BLOCK_KEY, INDEX_KEY, MANY_KEY, ACTION_KEY):
        for key, value in fields:
            if not found and pattern.fullmatch(key.strip()):
                found = _read(value, is_plan=True)
    times = next((whole_number(v) for k, v in fields if TIMES_KEY.fullmatch(k.strip())), None)
    return found * min(times or 1, MOST_AT_ONCE) if len(found) == 1 else found
