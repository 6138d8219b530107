"""Matching a plan against the AOV graph: settings A and B, the `paper` and `optimal` matchers.

A step names a candidate. It is a true positive when an unplaced, ready block of the goal equals
the candidate under the setting: type, colour and orientation in A, type and colour in B.
"""

from __future__ import annotations

from dataclasses import dataclass

from phyblock.domain import Plan
from phyblock.scoring.error_types import ErrorType, error_type
from phyblock.scoring.goal import Goal
from phyblock.scoring.metrics import Counts
from phyblock.types import Matcher

__all__ = ["Match", "match_plan", "most_placed", "step_errors"]


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


def match_plan(goal: Goal, plan: Plan, matcher: Matcher) -> Match:
    """Match `plan` step by step; raises KeyError for a step that is no candidate.

    `paper` is Algorithm 1 of the paper: each step takes the first ready equal block in file
    order. `optimal` takes the same steps but chooses among interchangeable ready blocks so that
    the number of true positives over the whole plan is greatest, so every valid order scores 1.
    Of the choices with as many, it takes those under which the fewest steps are `overflow`, and of
    these the fewest `incorrect_orientation`: the file order of blocks changes no count.
    """
    find = _first_choices if matcher == "paper" else _best_choices
    vertices = find(goal, plan)
    placed, masks = 0, []
    for vertex in vertices:
        masks.append(placed)
        placed |= 0 if vertex is None else 1 << vertex
    return Match(tuple(vertices), tuple(masks), len(goal.graph))


def most_placed(goal: Goal, plan: Plan) -> int:
    """How many steps of a plan are true positives to the `optimal` matcher, which is quicker to
    tell than which; raises as `match_plan`.
    """
    frontier = {0}
    for index in plan.steps:
        if goal.equal[index]:
            reached: set[int] = set()
            for placed in frontier:
                choices = goal.distinct(goal.choices(index, placed))
                reached.update([placed | 1 << vertex for vertex in choices] or [placed])
            frontier = reached
    return max(mask.bit_count() for mask in frontier)


def step_errors(goal: Goal, plan: Plan, match: Match) -> tuple[ErrorType | None, ...]:
    """For each step, why it is wrong (see `ERROR_TYPES`), or None for a true positive."""
    return tuple(
        error_type(goal.of_kind[index], goal.equal[index], placed) if vertex is None else None
        for index, vertex, placed in zip(plan.steps, match.vertices, match.placed, strict=True)
    )


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
    positives, so the way into each distinct set that costs least is enough.
    """
    cost_of: dict[ErrorType, int] = {
        "shape_not_in_gt": 0,
        "overflow": len(plan) + 1,
        "incorrect_orientation": 1,
        "dependency_not_met": 0,
    }
    frontier = {0: 0}
    history: list[dict[int, int | None]] = []
    for index in plan.steps:
        costs: dict[int, int] = {}
        taken: dict[int, int | None] = {}
        for placed, cost in frontier.items():
            choices = goal.distinct(goal.choices(index, placed))
            if not choices:
                more = cost + cost_of[error_type(goal.of_kind[index], goal.equal[index], placed)]
                if more < costs.get(placed, more + 1):
                    costs[placed], taken[placed] = more, None
            for vertex in choices:
                reached = placed | 1 << vertex
                if cost < costs.get(reached, cost + 1):
                    costs[reached], taken[reached] = cost, vertex
        frontier = costs
        history.append(taken)
    best = min(frontier, key=lambda mask: (-mask.bit_count(), frontier[mask]))
    vertices: list[int | None] = []
    for taken in reversed(history):
        chosen = taken[best]
        vertices.append(chosen)
        best &= ~(1 << chosen) if chosen is not None else ~0
    return vertices[::-1]
