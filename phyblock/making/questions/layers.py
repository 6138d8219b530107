"""Layers of blocks by what rests on what, where the picture tells the same as the contacts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from phyblock.domain.scene import Block
from phyblock.making.questions.question_draft import UnfairError
from phyblock.sim.support import GROUND, bounds_m, support_graph

__all__ = ["layers_of"]

_WEDGED_M = 0.005


def layers_of(blocks: Sequence[Block]) -> Mapping[int, int]:
    """The layer of each block, by order: one more than that of the highest block it rests on.

    UnfairError where that is not what the picture tells: a block that is wedged between two
    slopes rests on them, and yet it looks as if it were beside them.
    """
    below = support_graph(blocks)
    top = {block.order: bounds_m(block)[1, 2] for block in blocks} | {GROUND: 0.0}
    bottom = {block.order: bounds_m(block)[0, 2] for block in blocks}
    plain = {
        order: {other for other in others if bottom[order] > top[other] - _WEDGED_M} or {GROUND}
        for order, others in below.items()
    }
    counted = _longest(below)
    if counted != _longest(plain):
        raise UnfairError("some block rests on others and stands lower than they reach")
    return counted


def _longest(below: Mapping[int, Collection[int]]) -> dict[int, int]:
    layer = {GROUND: 0}
    while len(layer) <= len(below):
        ready = [o for o in below if o not in layer and below[o] and set(below[o]) <= layer.keys()]
        if not ready:
            raise UnfairError("some block rests on nothing, or on itself")
        layer.update({order: 1 + max(layer[other] for other in below[order]) for order in ready})
    return {order: number for order, number in layer.items() if order != GROUND}
