"""In which orders of the candidates floors answer, and under which seeds."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

from phyblock.config.suite import Suite, Variant

__all__ = ["floor_orders", "floor_seeds", "shows_seeds"]

_ORDER = "candidate_order"


def floor_orders(suite: Suite) -> list[tuple[Suite, int]]:
    """The suite in each order of the candidates that it asks in, and how often an answer in that
    order counts, so that orders weigh as they do among all ways of asking and seeds.
    """
    orders: dict[str, Suite] = {}
    ways = Counter[str]()
    for variant in suite.vary.variants:
        level = dict(variant.levels).get(_ORDER, "")
        if level not in orders:
            only = Variant(((_ORDER, level),)) if level else Variant()
            orders[level] = suite.at(only)
        ways[level] += 1
    often = {
        level: ways[level] * len(suite.seeds) // len(floor_seeds(one))
        for level, one in orders.items()
    }
    least = math.gcd(*often.values())
    return [(one, often[level] // least) for level, one in orders.items()]


def floor_seeds(suite: Suite) -> Sequence[int]:
    """The seeds under which floors answer: one tells all unless each shows another order."""
    return suite.seeds if shows_seeds(suite) else suite.seeds[:1]


def shows_seeds(suite: Suite) -> bool:
    """Whether each seed shows the candidates in another order."""
    return suite.candidates.order == "shuffled"
