"""How a person answers where a whole plan is asked for: candidates, one after another."""

from __future__ import annotations

from phyblock.tracks.by_hand import Picking, candidate_choices
from phyblock.tracks.full_planning.baselines import PlanSubject, plan_text

__all__ = ["pick_plan"]

_MOST_STEPS = 99
"""Far above what any goal has."""


def pick_plan(subject: PlanSubject) -> Picking:
    """Any candidates, each as often as needed."""
    return Picking(
        candidate_choices(len(subject.candidates)),
        least=1,
        most=_MOST_STEPS,
        repeats=True,
        noun="step",
        write=lambda picks: plan_text(pick.place + 1 for pick in picks),
    )
