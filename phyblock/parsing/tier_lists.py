"""Layers of a structure with their blocks, line by line or in one line, from the ground up."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re
from dataclasses import replace

from phyblock.parsing.line_patterns import MARKED
from phyblock.parsing.speech import words
from phyblock.parsing.statement import read_statement
from phyblock.parsing.structured import Found, line_numbers
from phyblock.parsing.text_forms import plain_line
from phyblock.parsing.tiers import lowest_first, tier_of

__all__ = ["find_tier_lists"]

_PART = (
    r"(?P<{0}label>[^\d\n:=→|.;]{{0,24}}\d{{0,2}}[^\d\n:=→|.;]{{0,24}}?)\s{{0,3}}(?::|=|→|->)"
    r"\s{{0,3}}(?P<{0}value>[^\n|;:]{{1,160}})"
)
_LINE = re.compile(r"[ \t>*+•\-#]{0,8}(?:\d{1,2}[.)]\s)?" + _PART.format(""))
_NUMBERS_AHEAD = re.compile(
    r"(?P<value>\d{1,3}(?:(?:,\s?|\s?\+\s?|\sand\s)\d{1,3}){0,9})\s?\((?P<label>[^()\d\n]{2,30})\)"
)
_APART = re.compile(r"\s?[|;]\s?|(?<=\w)\.\s(?=\S)")
_COUNTED = words(
    r"\d\s(?:\w+\s){0,2}?(?:blocks|cubes|arches|cylinders|cuboids|prisms|cones|pieces|bricks)\b|\d\s?cm\b|%"
)
_NAMED = words(
    r"^\d{1,2}: ?[^\W\d]|\d\D{1,4}\d|\b(?:bloc\w*|bloque|index|candidates?|baustein|блок)\b|积木"
    r"|ブロック|블록|#\d|\(\d|号"
)
_IS_PLAN = words(r"\b(?:option|plan|order|sequence|attempt|version|answer|steps?)\b")
"""A label of a whole plan, not of a part of it."""
_LINE_CHARS = 240
_HEAD = re.compile(
    r"(?=[^\n]*[^\W\d])[#+\-\u2022 ]{0,8}[^\d\n:.,;]{0,24}\d{0,2}[^\d\n:.,;]{0,24}:?"
)
"""A heading of a layer, whose blocks stand below it as items."""
_STAR = re.compile(r"\A\s{0,40}\*(?=\s)")
_Part = tuple[str, list[int]]


def find_tier_lists(text: str) -> list[Found]:
    """The lists of layers in a text; the blocks of each layer stand in the order in which it does.

    A list counts where its labels say how high its parts stand, and some value names blocks for
    certain: numbers alone may say how many there are.
    """
    found: list[Found] = []
    run: list[tuple[int, int, _Part, bool]] = []
    headed: list[tuple[int, int, _Part, bool]] = []
    at = 0
    for line in [*text.splitlines(keepends=True), ""]:
        bare = plain_line(line).strip()
        item = _item(line) if headed else None
        if item is not None:
            start, _, layer, is_sure = headed[-1]
            layer[1].extend(item)
            headed[-1] = (start, at + len(line), layer, is_sure or bool(_NAMED.search(bare)))
        elif _HEAD.fullmatch(bare) and tier_of(bare):
            headed.append((at, at + len(line), (bare, []), False))
        elif bare or not line:
            is_whole = all(part[2][1] for part in headed)
            found += [replace(f, says_moves=False) for f in _rising(headed) if is_whole]
            headed = []
        part = _part(bare)
        if part is None or not (run or tier_of(part[0][0])):
            found += _rising(run)
            run = []
            in_line = (
                [_part(piece) for piece in _APART.split(bare)] if len(bare) < _LINE_CHARS else []
            )
            if len(in_line) > 1 and None not in in_line:
                found += _rising([(at, at + len(line), *p) for p in in_line if p is not None])
        else:
            run.append((at, at + len(line), *part))
        at += len(line)
    return found


def _item(line: str) -> list[int] | None:
    """The blocks of an item below the heading of a layer, which names them and moves none."""
    line = plain_line(_STAR.sub("-", line))
    marked = MARKED.match(line)
    value = line[marked.end() :].rstrip(" .\n") if marked else ""
    if _COUNTED.search(value) or read_statement(value, is_item=True).has_verb:
        return None
    return _all_blocks(value)


def _part(text: str) -> tuple[_Part, bool] | None:
    """A label with the blocks behind it, and whether they are blocks for certain."""
    text = text.rstrip("。")
    if (ahead := _NUMBERS_AHEAD.fullmatch(text)) and tier_of(ahead["label"]):
        return (ahead["label"], list(line_numbers(ahead["value"]))), True
    match = _LINE.fullmatch(text) if text[-1:].isalnum() or text[-1:] in ".)]" else None
    if match is None or _COUNTED.search(match["value"]) or _IS_PLAN.search(match["label"]):
        return None
    numbers = _all_blocks(match["value"].rstrip(". "))
    return ((match["label"], numbers), bool(_NAMED.search(match["value"]))) if numbers else None


def _all_blocks(value: str) -> list[int] | None:
    """The blocks that a text names, where every number of it is one or says how many."""
    numbers = list(line_numbers(value))
    digits = {int(n) for n in re.findall(r"(?<![x×\d])\d{1,3}(?!\s?[x×\d])", value)}
    return numbers if numbers and digits <= {*numbers} else None


def _rising(run: list[tuple[int, int, _Part, bool]]) -> list[Found]:
    while run and tier_of(run[-1][2][0]) is None:
        run.pop()
    if len(run) < 2 or not any(is_sure for *_, is_sure in run):
        return []
    order = lowest_first([label for _, _, (label, _), _ in run])
    if order is None:
        return []
    numbers = tuple(n for i in order for n in run[i][2][1])
    return [Found(run[0][0], run[-1][1], "layers", numbers)]
