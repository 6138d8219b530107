"""What a reply claims of its plan that the plan itself shows to be so or not."""

from __future__ import annotations

import re
from collections.abc import Sequence

__all__ = ["PLACE_OR_TIMES", "counts_hold", "places_hold"]

PLACE_OR_TIMES = re.compile(
    r"(?<![\d.])(?P<block>\d{1,2})\s(?:must|has to|needs to|should|is|comes?|goes)\s?(?:be|come"
    r"|go)?\s?"
    r"(?:(?:placed|used|needed)\s)?(?:(?P<place>first|last)|(?P<times>once|twice|three times"
    r"|two times)"
    r"|(?P<relation>before|after)\s(?:block\s|candidate\s)?(?P<other>\d{1,2}))\b",
    re.IGNORECASE,
)
"""What is said of a block behind the plan that the plan itself shows to be so or not."""
_TOTAL = re.compile(
    r"\b(?:total(?: number)?(?: of)?|number of) ?(?:blocks?|steps?"
    r"|moves?)?(?: used)?\W{1,4}(\d{1,2})\b(?! (?:layers|levels|kinds|types|colou?rs))",
    re.IGNORECASE,
)
"""A count of the steps, said behind them."""


def counts_hold(text: str, order: Sequence[int]) -> bool:
    """Whether the numbers of steps that a text claims are that of the plan."""
    return all(int(total[1]) == len(order) for total in _TOTAL.finditer(text))


def places_hold(text: str, order: Sequence[int]) -> bool:
    """Whether blocks come where and as often as a text claims."""
    return all(_holds(claim, order) for claim in PLACE_OR_TIMES.finditer(text))


def _holds(said: re.Match[str], order: Sequence[int]) -> bool:
    """Whether what a line says of a block's place or number of times is so in the plan."""
    block = int(said["block"])
    if said["times"]:
        times = said["times"].lower()
        return order.count(block) == {"once": 1, "twice": 2, "three times": 3}.get(times, 2)
    if block not in order:
        return False
    if said["other"]:
        earlier = said["relation"].lower() == "before"
        other = int(said["other"])
        first, then = (block, other) if earlier else (other, block)
        return other in order and order.index(first) < order.index(then)
    return order[0 if said["place"].lower() == "first" else -1] == block
