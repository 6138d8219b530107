"""Matching a plan against the AOV graph: settings A and B, the `paper` and `optimal` matchers.

A step names a candidate. It is a true positive when an unplaced, ready block of the goal equals
the candidate under the setting: type, colour and orientation in A, type and colour in B.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from phyblock.domain import AOVGraph, CandidateSet, Plan, Scene
from phyblock.scoring.metrics import Counts
from phyblock.words import Matcher, Setting

__all__ = ["Goal", "Match", "match_plan"]


@dataclass(frozen=True)
class Match:
    """What each step of a plan did.

    `vertices[i]` is the goal vertex that step i placed, or None; `placed[i]` the bit mask of the
    vertices placed before step i; `n_blocks` the size of the goal.
    """

    vertices: tuple[int | None, ...]
    placed: tuple[int, ...]
    n_blocks: int

    @property
    def counts(self) -> Counts:
        """TP: steps that placed a block; FP: the other steps; FN: blocks that were left."""
        tp = sum(vertex is not None for vertex in self.vertices)
        return Counts(tp, len(self.vertices) - tp, self.n_blocks - tp)


class Goal:
    """A scene and its candidate set prepared for matching under one setting.

    `equal_to[i]` holds the goal vertices, in file order, that equal candidate i (1-based).
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
        self._twins = _twins(self.graph)

    def choices(self, index: int, placed: int) -> list[int]:
        """Ready goal vertices, in file order, that candidate `index` could be placed as."""
        return [v for v in self.equal_to[index] if self.graph.is_ready(v, placed)]

    def distinct(self, vertices: Sequence[int]) -> list[int]:
        """The first of each group of vertices that unlock the same blocks."""
        if len(vertices) < 2:
            return list(vertices)
        return list({self._twins[v]: v for v in reversed(vertices)}.values())


def match_plan(goal: Goal, plan: Plan, matcher: Matcher) -> Match:
    """Match `plan` step by step; raises KeyError for a step that is no candidate.

    `paper` is Algorithm 1 of the paper: each step takes the first ready equal block in file
    order. `optimal` takes the same steps but chooses among interchangeable ready blocks so that
    the number of true positives over the whole plan is greatest, so every valid order scores 1.
    """
    find = _first_choices if matcher == "paper" else _best_choices
    vertices = find(goal, plan)
    placed, masks = 0, []
    for vertex in vertices:
        masks.append(placed)
        placed |= 0 if vertex is None else 1 << vertex
    return Match(tuple(vertices), tuple(masks), len(goal.graph))


def _first_choices(goal: Goal, plan: Plan) -> list[int | None]:
    placed = 0
    vertices: list[int | None] = []
    for index in plan.steps:
        choices = goal.choices(index, placed)
        vertices.append(choices[0] if choices else None)
        placed |= 1 << choices[0] if choices else 0
    return vertices


def _best_choices(goal: Goal, plan: Plan) -> list[int | None]:
    """Search over the frontier of sets of placed vertices that some choice can reach.

    A step with a ready match never gains by being skipped, and a set's size is its number of true
    positives, so keeping one way into each distinct set is enough.
    """
    frontier: dict[int, int | None] = {0: None}
    history: list[dict[int, int | None]] = []
    for index in plan.steps:
        reached: dict[int, int | None] = {}
        for placed in frontier:
            choices = goal.distinct(goal.choices(index, placed))
            if not choices:
                reached.setdefault(placed, None)
            for vertex in choices:
                reached.setdefault(placed | 1 << vertex, vertex)
        frontier = reached
        history.append(reached)
    best = max(frontier, key=lambda mask: mask.bit_count())
    vertices: list[int | None] = []
    for reached in reversed(history):
        taken = reached[best]
        vertices.append(taken)
        best &= ~(1 << taken) if taken is not None else ~0
    return vertices[::-1]


def _twins(graph: AOVGraph) -> tuple[tuple[int, ...], ...]:
    """For each vertex, the vertices that directly depend on it: equal blocks with the same ones
    are interchangeable once both are ready.
    """
    n = len(graph)
    return tuple(tuple(w for w in range(n) if v in graph.depends_on[w]) for v in range(n))
