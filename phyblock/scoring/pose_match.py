"""Which goal block each step of a plan with poses stands for: one to one, in a valid order, at the
least total cost.

As many steps as setting A (or B) lets place a block are matched, never fewer: a step stands for an
unplaced, ready block that equals its candidate. Of all such matchings it is one under which steps
are within the most tolerances together, and of those one under which they lie nearest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.domain import Plan
from phyblock.scoring.assignment import cheapest
from phyblock.scoring.goal import Goal
from phyblock.scoring.match import most_placed
from phyblock.scoring.ratios import Floats

__all__ = ["FARTHEST_CM", "TOLERANCES_CM", "TURN_TOLERANCE_DEG", "Nearness", "assigned", "matched"]

TOLERANCES_CM = (0.5, 1.0, 2.0, 4.0)
"""How far from its place a right step may be [cm]; the headline is the mean over them."""
TURN_TOLERANCE_DEG = 15.0
"""How far a right step may be turned, up to the symmetry of the block [degrees]."""
FARTHEST_CM = 20.0
"""Steps that are farther off cost no more, so that one far away moves no other [cm]."""
_SLACK = 1e-6
_DISTANCE_COST = 1e-3
_IMPOSSIBLE = 1e3
_MOST_SETS = 4000
"""Sets of placed blocks that are kept after a step, those that cost least; plans that follow the
order need no search at all.
"""


@dataclass(frozen=True)
class Nearness:
    """How steps lie to goal blocks, arrays of shape (steps, blocks): distance [cm], turn [degrees],
    and whether the step's candidate equals the block.
    """

    distance_cm: Floats
    turn_deg: Floats
    equal: NDArray[np.bool_]

    @property
    def within(self) -> NDArray[np.int64]:
        """How many tolerances each pair is within."""
        limits = np.array(TOLERANCES_CM) + _SLACK
        near = (self.distance_cm[..., None] <= limits).sum(axis=-1)
        turned = self.turn_deg <= TURN_TOLERANCE_DEG + _SLACK
        within: NDArray[np.int64] = np.where(turned & self.equal, near, 0)
        return within

    @property
    def cost(self) -> Floats:
        """What each pair costs: the share of tolerances that it misses, and a little by its
        distance.
        """
        missed = 1 - self.within / len(TOLERANCES_CM)
        far = np.round(np.minimum(self.distance_cm / FARTHEST_CM, 1.0), 9)
        return np.where(self.equal, missed + _DISTANCE_COST * far, _IMPOSSIBLE)


def assigned(near: Nearness) -> list[int | None]:
    """The goal block of each step at the least total cost, in whatever order they are placed."""
    vertices: list[int | None] = [None] * len(near.equal)
    for step, vertex in cheapest(near.cost):
        if near.equal[step, vertex]:
            vertices[step] = vertex
    return vertices


def matched(goal: Goal, numbers: Sequence[int], near: Nearness) -> tuple[int | None, ...]:
    """The goal block of each step; KeyError for a number that is no candidate."""
    most = most_placed(goal, Plan(tuple(numbers)))
    vertices = assigned(near)
    if sum(vertex is not None for vertex in vertices) == most and _is_valid(goal, vertices):
        return tuple(vertices)
    return tuple(_searched(goal, numbers, near.cost, most))


def _is_valid(goal: Goal, vertices: Sequence[int | None]) -> bool:
    placed = 0
    for vertex in vertices:
        if vertex is not None:
            if not goal.graph.is_ready(vertex, placed):
                return False
            placed |= 1 << vertex
    return True


def _searched(goal: Goal, numbers: Sequence[int], cost: Floats, most: int) -> list[int | None]:
    """Step by step over the sets of placed blocks, each with the way into it that costs least.

    So many steps as cannot be matched at all may be passed over, where a later one fits better.
    """
    spare = len(numbers) - most
    frontier: dict[int, float] = {0: 0.0}
    history: list[dict[int, int | None]] = []
    for step, number in enumerate(numbers):
        costs: dict[int, float] = {}
        taken: dict[int, int | None] = {}
        for placed, paid in frontier.items():
            if step - placed.bit_count() < spare and paid < costs.get(placed, np.inf):
                costs[placed], taken[placed] = paid, None
            for vertex in goal.choices(number, placed):
                reached, more = placed | 1 << vertex, paid + float(cost[step, vertex])
                if more < costs.get(reached, np.inf):
                    costs[reached], taken[reached] = more, vertex
        if len(costs) > _MOST_SETS:
            # Passing a step over counts as if it had missed every tolerance.
            ranked = sorted(costs, key=lambda mask: (costs[mask] - mask.bit_count(), mask))
            costs = {mask: costs[mask] for mask in ranked[:_MOST_SETS]}
        frontier = costs
        history.append(taken)
    best = min(frontier, key=lambda mask: (-mask.bit_count(), frontier[mask], mask))
    vertices: list[int | None] = []
    for taken in reversed(history):
        chosen = taken[best]
        vertices.append(chosen)
        best &= ~(1 << chosen) if chosen is not None else ~0
    return vertices[::-1]
