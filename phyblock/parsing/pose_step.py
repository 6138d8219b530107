"""One step of a plan with poses as a line of text: block, place and turn, or what is wrong.

A number is read where it can mean one thing. Centimeters are what the prompt asks for, so that a
number without a unit is one of them; millimeters and meters are converted where they stand beside
their numbers, and every other unit is refused.
"""

# ruff: noqa: RUF001 -- replies come with dashes and signs of other scripts

from __future__ import annotations

import math
import re
from typing import Literal

from phyblock.domain import PoseStep

__all__ = [
    "FARTHEST_PLACE_CM",
    "MOST_TURN_DEG",
    "OTHER_UNIT",
    "StepProblem",
    "checked_step",
    "read_step",
    "step_label",
]

StepProblem = Literal[
    "no_place",
    "missing_coordinate",
    "too_many_coordinates",
    "not_a_number",
    "out_of_range",
    "other_unit",
    "mixed_units",
    "two_places",
    "missing_rotation",
    "turned",
    "unclear_step",
]
"""Why a step cannot be read. `turned`: it is given a rotation where candidates keep theirs."""

FARTHEST_PLACE_CM = 1000.0
"""Coordinates beyond this are no place on a table [cm]."""
MOST_TURN_DEG = 3600.0

_UNITS = {
    **dict.fromkeys(("cm", "cms", "centimeter", "centimeters", "centimetre", "centimetres"), 1.0),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), 0.1),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), 100.0),
}
_DEGREES = ("", "deg", "degs", "degree", "degrees", "°")
_NUMBER = re.compile(
    r"(?P<number>[+-]?(?:\d{1,12}(?:\.\d{0,12})?|\.\d{1,12})(?:e[+-]?\d{1,3})?)"
    r"\s{0,3}(?P<unit>[a-z°%\u00b5\u03bc]{0,16})\.?",
    re.IGNORECASE,
)
_LABEL = re.compile(r"(?P<name>[xyz])\s{0,2}[=:]\s{0,2}", re.IGNORECASE)
_HEAD = re.compile(
    r"(?P<lead>.{0,24}?)\b(?:block|candidate)\s{0,2}"
    r"(?:with index|index|number|no\.?|nr\.?|id)?\s{0,2}[#:]?\s{0,2}"
    r"(?P<block>-?\d{1,6})(?!\d|\.\d|,\d)(?P<rest>.*)",
    re.IGNORECASE,
)
_LEAD = re.compile(
    r"\W*(?:(?:then|next|now|finally|first|move|put|place|set|add|the)\b\W*)*", re.IGNORECASE
)
_STEP = re.compile(
    r"[\s>#|•·–—*-]*(?:step\s{0,2}#?\s{0,2}(?P<step>\d{1,6})\s{0,2}[:.)\]–—|>-]*|"
    r"\(?(?P<item>\d{1,6})\s{0,2}[.):]+)\s*",
    re.IGNORECASE,
)
_TO_PLACE = re.compile(
    r"(?:[\s,:=→–—|-]|>|\b(?:at|to|with|its|the|center(?:ed)?|centre(?:d)?|of|box|position(?:ed)?"
    r"|pos|coordinates?|location|is|goes|placed|put)\b)*",
    re.IGNORECASE,
)
_BRACKET = re.compile(r"[(\[](?P<held>[^()\[\]]{0,300})[)\]]")
_LOOSE = re.compile(
    r"[xyz]\s{0,2}[=:][^()\[\]]{0,120}?(?=\s*(?:[,;]?\s*(?:and )?(?:turned|rotat|orient)|\Z))",
    re.IGNORECASE,
)
_UNIT_BEHIND = re.compile(r"\s{0,3}(?:\(?in )?\s{0,2}(?P<unit>[a-z]{1,16})\b\)?", re.IGNORECASE)
_KNOWN_UNIT = re.compile(
    r"(?:c|m)?m|cms|(?:centi|milli|deci)?met(?:er|re)s?|inch(?:es)?|f(?:oo|ee)?t|px|pixels?|units?"
    r"|studs?|blocks?|cells?|voxels?",
    re.IGNORECASE,
)
_TURN = re.compile(
    r"[\s,;:|–—-]*(?:and |with |its )*(?:a )?(?:turned|rotated|rotation|orientation|euler"
    r"(?: angles)?)\s{0,2}(?:by|of|is|to|=|:)?\s*[(\[](?P<held>[^()\[\]]{0,300})[)\]]"
    r"\s{0,2}(?P<unit>[a-z°]{0,12})",
    re.IGNORECASE,
)
_TURN_WORD = re.compile(r"\b(?:turned|rotat(?:ed|ion)|degrees?)\b|°", re.IGNORECASE)
_MENTION = re.compile(r"\b(?:blocks?|steps?|candidates?|layers?|levels?)\s{0,2}#?\d{1,6}(?:\W|\Z)")
_INCHES = re.compile("\\d\\s{0,2}[\"\u2033\u2032\u201d']")

_OTHER = (
    r"(?:m|km|dm|mm|[\u00b5\u03bc]m|(?:kilo|deci|milli|micro)?met(?:er|re)s?|inch(?:es)?|feet"
    r"|foot|ft|yards?|px|pixels?|voxels?|studs?|cells?|blocks|grid \w+|block \w+"
    r"|units of (?!(?:1 |one )?c(?:m|enti))\w+)"
)
OTHER_UNIT = re.compile(
    r"\b(?:units?|coordinates?|positions?|values?|numbers?|measured|given|expressed|dimensions?"
    r"|lengths?|distances?|everything|all)\b[^.\n]{0,40}?"
    r"(?:(?<!not )(?<!never )(?<!than )(?<!instead of )\b(?:in|are|is)\b|[:=])[\s\"'(*_`]{0,6}"
    # "in" is a unit where nothing comes behind it: "are in cm" says another one.
    rf"(?:the )?(?:{_OTHER}|in(?=[\"'*_`]{{0,3}}[ \t]*(?:[.,;)\]}}\n]|\Z))"
    r"(?!\s*[\"'(*_`]*(?:the |units? of )?(?:1 )?c(?:m|enti)))"
    r"(?:(?![\w(])|(?=_+(?:\W|\Z)))"
    rf"|\((?:in )?{_OTHER}\)",
    re.IGNORECASE,
)
"""A text that says of all its numbers that they are no centimeters."""


def step_label(line: str) -> tuple[int | None, str]:
    """The number that a line begins with as a step or an item of a list, and what follows it."""
    match = _STEP.match(line)
    if match is None:
        return None, line
    return int(match["step"] or match["item"]), line[match.end() :]


def read_step(line: str, raw: str, *, labeled: bool, free: bool) -> PoseStep | StepProblem | None:
    """The step that a line says, behind its label; None for a line that is none.

    `raw` is the line with its quotation marks, `free` whether a rotation is asked for.
    """
    head = _HEAD.match(line)
    if head is None or not _LEAD.fullmatch(head["lead"]):
        is_step = labeled and re.search(r"\bblock\s?#?-?\d|[(\[]\s?[-+.\d]", line, re.IGNORECASE)
        return "unclear_step" if is_step else None
    rest = head["rest"]
    start = _TO_PLACE.match(rest)
    rest = rest[start.end() :] if start else rest
    found = _BRACKET.match(rest) or _LOOSE.match(rest)
    if found is None:
        if re.search(r"[(\[]", rest):
            return "unclear_step"
        return "no_place" if labeled else None
    if _INCHES.search(raw):
        return "other_unit"
    held = found[0] if found.re is _LOOSE else found["held"]
    behind = rest[found.end() :]
    word = _UNIT_BEHIND.match(behind)
    unit = word["unit"].lower() if word and _KNOWN_UNIT.fullmatch(word["unit"]) else ""
    behind = behind[word.end() :] if word and unit else behind
    place = _place(held, unit)
    if isinstance(place, str):
        return place
    turn = _TURN.match(behind)
    euler: list[float] | StepProblem | None = None
    if turn:
        euler, behind = _angles(turn["held"], turn["unit"]), behind[turn.end() :]
    elif _TURN_WORD.search(behind):
        return "unclear_step"
    if isinstance(euler, str):
        return euler
    if re.search(r"\d", _MENTION.sub(" ", behind.lower())):
        return "two_places" if re.search(r"[(\[]", behind) else "unclear_step"
    return checked_step(int(head["block"]), place, euler, free=free)


def checked_step(
    block: int, place: list[float], euler: list[float] | None, *, free: bool
) -> PoseStep | StepProblem:
    """A step of finite numbers that a table has room for, with a rotation where one is asked."""
    if not all(map(math.isfinite, (*place, *(euler or ())))):
        return "not_a_number"
    if max(map(abs, place)) > FARTHEST_PLACE_CM or max(map(abs, euler or (0.0,))) > MOST_TURN_DEG:
        return "out_of_range"
    x, y, z = place
    if not free:
        return "turned" if any(euler or ()) else PoseStep(block, (x, y, z))
    if euler is None:
        return "missing_rotation"
    a, b, c = euler
    return PoseStep(block, (x, y, z), (a, b, c))


def _place(held: str, unit: str) -> list[float] | StepProblem:
    """Three coordinates [cm]; `unit` stands behind all of them."""
    values = _three(held)
    if isinstance(values, str):
        return values
    units = [own for _, own in values]
    if unit and any(units):
        return "mixed_units"
    units = [unit] * 3 if unit else units
    if any(own and own not in _UNITS for own in units):
        return "other_unit"
    if len({_UNITS.get(own, 1.0) for own in units}) > 1:
        return "mixed_units"
    return [number * _UNITS.get(own, 1.0) for (number, _), own in zip(values, units, strict=True)]


def _angles(held: str, unit: str) -> list[float] | StepProblem:
    values = _three(held)
    if isinstance(values, str):
        return values
    if any(own not in _DEGREES for own in (unit.lower(), *(own for _, own in values))):
        return "other_unit"
    return [number for number, _ in values]


def _three(held: str) -> list[tuple[float, str]] | StepProblem:
    """Three numbers with their units, in the order x, y, z."""
    labels = list(_LABEL.finditer(held))
    if labels:
        ends = [*(label.start() for label in labels[1:]), len(held)]
        parts = [held[label.end() : end] for label, end in zip(labels, ends, strict=True)]
        names = [label["name"].lower() for label in labels]
        if held[: labels[0].start()].strip() or len(set(names)) < len(names):
            return "unclear_step"
        if len(parts) < 3:
            return "missing_coordinate"
        parts = [
            part.strip().rstrip(",;").rstrip() for _, part in sorted(zip(names, parts, strict=True))
        ]
        if any("," in part or ";" in part for part in parts):
            return "too_many_coordinates"
    else:
        mark = ";" if ";" in held else "," if "," in held else None
        parts = [part.strip() for part in (held.split(mark) if mark else held.split())]
        if mark is None and parts and parts[-1].lower() in _UNITS:
            parts[-2:] = [" ".join(parts[-2:])]
    if len(parts) != 3:
        return "missing_coordinate" if len(parts) < 3 else "too_many_coordinates"
    if "" in parts:
        return "missing_coordinate"
    found = [_NUMBER.fullmatch(part) for part in parts]
    numbers = [match for match in found if match is not None]
    if len(numbers) < 3:
        return "not_a_number"
    return [(float(match["number"]), match["unit"].lower()) for match in numbers]
