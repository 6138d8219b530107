"""Level-1 criteria: which blocks were chosen, whatever their order.

`selection` is one-to-one. `membership` is what the paper's published Level-1 columns are: a step
counts when its block occurs anywhere in the goal, so a repeated step counts again and the number
of false negatives may fall below zero. It exists to reproduce those columns.
"""

from __future__ import annotations

from collections import Counter

from phyblock.domain import Plan
from phyblock.scoring.goal import Goal
from phyblock.scoring.metrics import Counts
from phyblock.types import Level1Criterion

__all__ = ["level1_counts"]


def level1_counts(goal: Goal, plan: Plan, criterion: Level1Criterion) -> Counts:
    """Counts of `plan` without order, under the goal's setting.

    Raises KeyError for a step that is no candidate.
    """
    if criterion == "membership":
        tp = sum(bool(goal.equal_to[index]) for index in plan.steps)
    else:
        chosen = Counter(goal.equal_to[index] for index in plan.steps)
        tp = sum(min(times, len(vertices)) for vertices, times in chosen.items())
    return Counts(tp, len(plan) - tp, len(goal.graph) - tp)
