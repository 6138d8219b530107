"""An order in which a goal can be built block by block, each step in balance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from phyblock.domain import Block, Scene
from phyblock.sim.balance import MARGIN_M, is_balanced
from phyblock.sim.dynamics import groups, settle

__all__ = ["buildable_order"]

_MOST_TRIED = 200
_MOST_SETTLED = 16
"""States that the physics engine is asked about, each of which may take a second."""


def buildable_order(scene: Scene, wanted: Sequence[int]) -> list[int]:
    """The vertices of a scene in a valid order, as near to the `wanted` one, which is valid too, as
    balance lets it be.

    Each step takes the first block with which what stands is in balance with every weight off by
    `MARGIN_M`, else the first with which it is in balance at all and stands in the physics engine;
    where there is none, an earlier step is taken back. The wanted order where no other is found.
    """
    return _Search(scene, wanted).found() or list(wanted)


class _Search:
    def __init__(self, scene: Scene, wanted: Sequence[int]) -> None:
        self._blocks, self._needs = scene.blocks, scene.graph.depends_on
        self._wanted = wanted
        self._dead: set[frozenset[int]] = set()
        self._left, self._settles_left = _MOST_TRIED, _MOST_SETTLED

    def found(self, order: tuple[int, ...] = ()) -> list[int]:
        """The rest of an order that begins so; empty where there is none."""
        if len(order) == len(self._blocks):
            return list(order)
        placed = frozenset(order)
        if placed not in self._dead:
            for vertex in self._next(order):
                if whole := self.found((*order, vertex)):
                    return whole
            self._dead.add(placed)
        return []

    def _next(self, order: tuple[int, ...]) -> Iterator[int]:
        """The blocks that may come next, the surest first."""
        ready = [v for v in self._wanted if v not in order and self._needs[v] <= set(order)]
        doubtful = []
        for vertex in ready:
            if self._left <= 0:
                return
            self._left -= 1
            touched = self._touched((*order, vertex))
            if is_balanced(touched, margin_m=MARGIN_M):
                yield vertex
            elif is_balanced(touched):
                doubtful.append(vertex)
        # So near to an edge engines differ, and a structure may stand while its mirror image falls.
        yield from (vertex for vertex in doubtful if self._settles((*order, vertex)))

    def _settles(self, order: tuple[int, ...]) -> bool:
        self._settles_left -= 1
        return self._settles_left >= 0 and settle(self._touched(order)).stands

    def _touched(self, order: tuple[int, ...]) -> tuple[Block, ...]:
        """The blocks that hang together with the last one."""
        blocks = [replace(self._blocks[v], order=place) for place, v in enumerate(order)]
        return next(group for group in groups(blocks) if blocks[-1] in group)
