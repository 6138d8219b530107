"""A goal structure beside what it is built from: which blocks each candidate could be."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

from phyblock.domain import AOVGraph, CandidateSet, Scene
from phyblock.types import Setting

__all__ = ["Goal"]


class Goal:
    """A scene and its candidate set prepared for matching under one setting.

    `equal_to[i]` holds the goal vertices, in file order, that equal candidate i (1-based). All else
    are bit masks of vertices: `equal[i]` the same, `of_kind[i]` those of its type and color,
    `kinds` all blocks by type and color, `kind_of_look` the kind of each group that the setting
    takes for equal; `above[v]` v and all that depends on it, directly or not, `below[v]` v and all
    that it depends on.
    """

    def __init__(self, scene: Scene, candidates: CandidateSet, setting: Setting) -> None:
        attribute = "look" if setting == "A" else "kind"
        self.graph: AOVGraph = scene.graph
        self.equal_to: dict[int, tuple[int, ...]] = {
            index: tuple(
                vertex
                for vertex, block in enumerate(scene.blocks)
                if getattr(block, attribute) == getattr(candidate, attribute)
            )
            for index, candidate in enumerate(candidates.candidates, 1)
        }
        self.equal: dict[int, int] = {
            index: sum(1 << v for v in vertices) for index, vertices in self.equal_to.items()
        }
        self.of_kind: dict[int, int] = {
            index: sum(1 << v for v, block in enumerate(scene.blocks) if block.kind == one.kind)
            for index, one in enumerate(candidates.candidates, 1)
        }
        self.kinds = _groups(block.kind for block in scene.blocks)
        looks = _groups(getattr(block, attribute) for block in scene.blocks)
        self.kind_of_look = {look: kind for look in looks for kind in self.kinds if look & kind}
        self.below = _below(self.graph)
        self.above = tuple(
            sum(1 << w for w, below in enumerate(self.below) if below >> v & 1)
            for v in range(len(scene))
        )
        self._twins = _twins(self.graph)

    def choices(self, index: int, placed: int) -> list[int]:
        """Ready goal vertices, in file order, that candidate `index` could be placed as."""
        return [v for v in self.equal_to[index] if self.graph.is_ready(v, placed)]

    def distinct(self, vertices: Sequence[int]) -> list[int]:
        """The first of each group of vertices that unlock the same blocks."""
        if len(vertices) < 2:
            return list(vertices)
        return list({self._twins[v]: v for v in reversed(vertices)}.values())


def _twins(graph: AOVGraph) -> tuple[tuple[int, ...], ...]:
    """For each vertex, the vertices that directly depend on it: equal blocks with the same ones
    are interchangeable once both are ready.
    """
    n = len(graph)
    return tuple(tuple(w for w in range(n) if v in graph.depends_on[w]) for v in range(n))


def _groups(values: Iterable[Hashable]) -> tuple[int, ...]:
    """Bit masks of the places that have the same value."""
    groups: dict[Hashable, int] = {}
    for place, value in enumerate(values):
        groups[value] = groups.get(value, 0) | 1 << place
    return tuple(groups.values())


def _below(graph: AOVGraph) -> tuple[int, ...]:
    """For each vertex the bit mask of itself and all that it depends on, directly or not."""
    below = [1 << v for v in range(len(graph))]
    for vertex in sorted(range(len(graph)), key=graph.layers.__getitem__):
        for other in graph.depends_on[vertex]:
            below[vertex] |= below[other]
    return tuple(below)
