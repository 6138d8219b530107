"""Lines of one shape that count from 1, as plans in languages that no pattern knows have them."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re

from phyblock.parsing.line_patterns import STEP
from phyblock.parsing.speech import words

__all__ = ["as_steps", "as_unknown_steps", "counted_lines"]

_LINE = re.compile(
    r"(?P<before>[^\d\n]{0,30})(?P<n>\d{1,2})(?P<between>[^\d\n]{1,60})(?P<block>\d{1,3})(?P<after>[^\d\n]{0,120})"
)
_ALIKE = re.compile(
    r"^(?P<before>[ \t]{0,4}(?:#|[a-z]{1,7}[ _]?|(?=1 ?(?:->"
    r"|→))))1(?P<between>\s?(?:[:.=→▸)-]{1,2}|->)\s?(?:block |index "
    r"|#)?)\d{1,2}(?P<after>[^\n\d]{0,40})\n(?:\s{0,4}\n)?(?:(?P=before)\d{1,2}(?P=between)\d{1,2}"
    r"[^\n\d]{0,40}(?:\n|\Z)){1,30}",
    re.MULTILINE | re.IGNORECASE,
)
_ALIKE_LINE = re.compile(r"^\D*(?P<n>\d{1,2})\D+(?P<block>\d{1,2})(?P<after>\D*)$")
_NO_STEPS = words(r"\s*(?:block|candid|piece|cube|layer|level|tier|row|index|id|option|l|c|b)")
_COUNTS = words(
    r"layer|level|tier|row|block|candidate|piece|cube|index|option|ebene|schicht|couche|niveau|capa"
    r"|nivel|strato|camada|слой|уровень|层|層|段|층|طبقة|lớp|kat\b|परत|figure|picture|%|confidence"
)
"""What else lines may count: layers with the number of their blocks, or the candidates."""
_MANY = words(r"\s?(?:\w+s\b|[cm]?m\b|%|°|[x×](?!\w)|blöcke|个|块|個|개)")
"""What stands behind a number that says how many, or how long."""


def counted_lines(text: str) -> str:
    """A text whose lines of one short shape that count from 1 ("#1 → 5") are steps."""
    return _ALIKE.sub(_of_shape, text)


def _of_shape(lines: re.Match[str]) -> str:
    found = [_ALIKE_LINE.match(line) for line in lines[0].splitlines() if line.strip()]
    counted = [int(line["n"]) if line else 0 for line in found]
    says_else = _NO_STEPS.fullmatch(lines["before"].rstrip(" _s")) or any(
        line and _MANY.match(line["after"]) for line in found
    )
    if says_else or counted != [*range(1, len(counted) + 1)]:
        return lines[0]
    steps = [f"Step{ln['n']}: Move block {ln['block']}{ln['after']}" for ln in found if ln]
    return "\n".join([*steps, ""])


def as_steps(text: str) -> str | None:
    """The plan of the one run of lines that differ in two numbers alone, the first of which counts.

    None where there is none, or more than one.
    """
    return _steps(text.splitlines())


def as_unknown_steps(text: str) -> str | None:
    """The same, where nothing stands behind the lines and their word for a step is not known."""
    lines = [line for line in text.splitlines() if line.strip()]
    start = next((i for i, line in enumerate(lines) if _is_first(line)), len(lines))
    plan = None if any(map(STEP.match, lines[start:])) else _steps(lines[start:])
    return plan if plan and plan.count("\n") + 1 == len(lines) - start else None


def _is_first(line: str) -> bool:
    found = _LINE.fullmatch(line.strip())
    return found is not None and found["n"] == "1"


def _steps(lines: list[str]) -> str | None:
    runs: list[list[re.Match[str]]] = []
    for line in lines:
        if not line.strip():
            continue
        found = _LINE.fullmatch(line.strip())
        is_next = found and runs and runs[-1] and _goes_on(runs[-1][-1], found)
        if found and is_next:
            runs[-1].append(found)
        elif found and found["n"] == "1" and not _COUNTS.search(found["before"]):
            runs.append([found])
        elif runs and runs[-1]:
            runs.append([])
    whole = [run for run in runs if len(run) > 1 and not _MANY.match(run[0]["after"])]
    if len(whole) != 1 or all(found["n"] == found["block"] for found in whole[0]):
        return None
    return "\n".join(f"Step{k}: Move block {found['block']}" for k, found in enumerate(whole[0], 1))


def _goes_on(last: re.Match[str], found: re.Match[str]) -> bool:
    return int(found["n"]) == int(last["n"]) + 1 and all(
        found[name].split() == last[name].split() for name in ("before", "between")
    )
