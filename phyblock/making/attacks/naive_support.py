"""The rules that make counterfactual questions easy: what rests on a block goes with it.

When X is taken away, all that rests on it moves, directly or not, and nothing else does; or only
what rests on nothing else. Neither needs physics: no lever, no weight that held something down.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from phyblock.domain.question import LETTERS, Question
from phyblock.domain.scene import Block
from phyblock.making.attacks.cues import Floats
from phyblock.making.questions.colored_outcomes import colored_orders
from phyblock.making.questions.counterfactual import OUTCOME_TEXTS
from phyblock.making.questions.pictured_drafts import option_pictures, picture_of
from phyblock.sim.support import support_graph

__all__ = ["naive_likings", "resting_on", "resting_only_on"]

Falls = Callable[[Sequence[Block], int], frozenset[int]]
"""Orders of the blocks that a rule says move when one of some blocks is taken away."""


def naive_likings(question: Question, falls: Falls) -> Floats | None:
    """How well each option of a question about a removal fits a rule.

    None for other questions, and where the options say something that the rule has no word for.
    The block taken away is the one that the evidence calls `removed`.
    """
    removed = question.evidence.get("removed")
    if question.subtask != "CF" or not isinstance(removed, int):
        return None
    shown = picture_of(question, "scene")
    moved = falls(shown.blocks, removed)
    if any(picture.label in LETTERS for picture in question.pictures):
        slots = question.evidence["slots"]
        named = [colored_orders(one, shown, removed, slots) for one in option_pictures(question)]
        return np.array([-len(one ^ moved) for one in named], dtype=float)
    if set(question.options) == set(OUTCOME_TEXTS):
        right = OUTCOME_TEXTS[min(len(moved), len(OUTCOME_TEXTS) - 1)]
        return np.array([float(option == right) for option in question.options])
    return None


def resting_on(blocks: Sequence[Block], order: int) -> frozenset[int]:
    """Those that rest on it, directly or not, by contact."""
    rests_on = support_graph(blocks)
    above = {order}
    for _ in blocks:
        above |= {one for one, below in rests_on.items() if above & below}
    return frozenset(above - {order})


def resting_only_on(blocks: Sequence[Block], order: int) -> frozenset[int]:
    """Those that rest, by contact, on nothing but it and others that do."""
    rests_on = support_graph(blocks)
    above = {order}
    for _ in blocks:
        above |= {one for one, below in rests_on.items() if below and below <= above}
    return frozenset(above - {order})
