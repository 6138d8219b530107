"""Measured difficulty of scenes, by which a suite may select them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from phyblock.config.suite import DifficultySpec
from phyblock.domain.scene import AOVGraph, AssemblyTask, Oriented, Plan
from phyblock.scoring.plan import Goal, match_plan


def log_orders(graph: AOVGraph) -> float:
    """Return the decimal logarithm of a lower bound on the number of valid orders.

    The bound is n! divided, for each block, by the number of blocks that need it (or that it
    needs), itself included: exact if no block rests on two others, or no two rest on one.
    """
    needed = [0] * len(graph)
    for vertex in sorted(range(len(graph)), key=graph.layers.__getitem__):
        needed[vertex] = 1 << vertex
        for other in graph.depends_on[vertex]:
            needed[vertex] |= needed[other]
    below = [mask.bit_count() for mask in needed]
    above = [sum(mask >> vertex & 1 for mask in needed) for vertex in range(len(graph))]
    most = max(-math.log10(math.prod(sizes)) for sizes in (below, above))
    return math.log10(math.factorial(len(graph))) + most


def distractor_distance(task: AssemblyTask) -> float:
    """Return in how many of type, color and orientation the nearest distractor differs from a
    needed look, averaged over needed looks; 3 without distractors.
    """
    needed = {block.look: block for block in task.scene.blocks}
    others = [one for one in task.candidates.candidates if one.look not in needed]

    def apart(one: Oriented, other: Oriented) -> int:
        is_turned = one.look[2] != other.look[2] or one.type != other.type
        return (one.type != other.type) + (one.color != other.color) + is_turned

    nearest = [min((apart(one, other) for other in others), default=3) for one in needed.values()]
    return sum(nearest) / len(nearest)


def _blind_f1(task: AssemblyTask) -> float:
    plan = Plan(tuple(range(1, len(task.candidates) + 1)))
    return match_plan(Goal(task.scene, task.candidates, "A"), plan, "optimal").counts.f1 or 0.0


MEASURES: Mapping[str, Callable[[AssemblyTask], float]] = {
    "blocks": lambda task: len(task.scene),
    "depth": lambda task: max(task.scene.graph.layers),
    "orders": lambda task: log_orders(task.scene.graph),
    "blind": _blind_f1,
    "distractor": distractor_distance,
}
"""The measures of a scene, by the names in `DifficultySpec`."""


def is_within(task: AssemblyTask, spec: DifficultySpec) -> bool:
    """True if all measures of a scene are within the ranges of a suite."""
    return all(low <= MEASURES[name](task) <= high for name, (low, high) in spec.ranges.items())
