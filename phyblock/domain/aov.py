"""The activity-on-vertex (AOV) graph of a scene: a vertex is a block, an edge a support.

Vertices are 0-based positions in the scene's file order. Sets of vertices are passed as integer
bit masks (bit v set: vertex v is in the set), which keeps the matchers small and quick.
"""

from __future__ import annotations

import functools
import graphlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


class CycleError(ValueError):
    """The dependencies hold a cycle; `vertices` are those on it, in order."""

    def __init__(self, vertices: tuple[int, ...]) -> None:
        self.vertices = vertices
        super().__init__("cycle " + " -> ".join(str(v) for v in (*vertices, vertices[0])))


@dataclass(frozen=True)
class AOVGraph:
    """Dependencies of n blocks (paper section 3.2).

    `depends_on[v]` holds the vertices that must be placed before v. Raises ValueError when a
    vertex is outside 0..n-1 and CycleError when no order of placing exists.
    """

    depends_on: tuple[frozenset[int], ...]

    def __post_init__(self) -> None:
        n = len(self.depends_on)
        for vertex, needed in enumerate(self.depends_on):
            for other in needed:
                if not 0 <= other < n:
                    raise ValueError(f"vertex {vertex} depends on {other}, outside 0..{n - 1}")
        try:
            graphlib.TopologicalSorter(dict(enumerate(self.depends_on))).prepare()
        except graphlib.CycleError as error:
            # Each vertex is needed by the next, and the first stands at both ends.
            vertices = error.args[1][:0:-1]
            start = vertices.index(min(vertices))
            raise CycleError((*vertices[start:], *vertices[:start])) from None

    def __len__(self) -> int:
        return len(self.depends_on)

    @functools.cached_property
    def needed_masks(self) -> tuple[int, ...]:
        """For each vertex, the bit mask of what it directly depends on."""
        return tuple(sum(1 << other for other in needed) for needed in self.depends_on)

    @functools.cached_property
    def layers(self) -> tuple[int, ...]:
        """Layer of each vertex: 1 on the ground, else 1 + the highest layer it depends on."""
        layers = [0] * len(self)
        for vertex in graphlib.TopologicalSorter(dict(enumerate(self.depends_on))).static_order():
            layers[vertex] = 1 + max((layers[o] for o in self.depends_on[vertex]), default=0)
        return tuple(layers)

    def is_ready(self, vertex: int, placed: int) -> bool:
        """True if `vertex` is unplaced and all it depends on is in the bit mask `placed`."""
        needed = self.needed_masks[vertex]
        return not placed >> vertex & 1 and needed & placed == needed

    def ready(self, placed: int = 0) -> tuple[int, ...]:
        """The vertices that can be placed next, in file order."""
        return tuple(v for v in range(len(self)) if self.is_ready(v, placed))

    def is_valid(self, order: Sequence[int]) -> bool:
        """True if `order` places every vertex exactly once, each only when it is ready."""
        placed = 0
        for vertex in order:
            if not 0 <= vertex < len(self) or not self.is_ready(vertex, placed):
                return False
            placed |= 1 << vertex
        return placed == (1 << len(self)) - 1

    def random_order(self, rng: np.random.Generator) -> tuple[int, ...]:
        """A topological order in which each step is drawn evenly from the ready vertices."""
        order: list[int] = []
        placed = 0
        while len(order) < len(self):
            choices = self.ready(placed)
            vertex = choices[int(rng.integers(len(choices)))]
            order.append(vertex)
            placed |= 1 << vertex
        return tuple(order)
