"""How a person answers where the next step is asked for: one candidate, or that it is done."""

from __future__ import annotations

from collections.abc import Sequence

from phyblock.tracks.by_hand import Choice, Pick, Picking, candidate_choices
from phyblock.tracks.step_planning.baselines import StepSubject, step_text

__all__ = ["pick_step"]


def pick_step(subject: StepSubject) -> Picking:
    """The candidates, and after them the end."""
    n_candidates = len(subject.candidates)

    def write(picks: Sequence[Pick]) -> str:
        (pick,) = picks
        return step_text(pick.place + 1 if pick.place < n_candidates else None)

    choices = (*candidate_choices(n_candidates), Choice("Done", "the goal is complete"))
    return Picking(choices, least=1, most=1, repeats=False, noun="step", write=write)
