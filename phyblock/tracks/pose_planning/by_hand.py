"""How a person answers where a plan with poses is asked for: candidates, each with its place."""

from __future__ import annotations

from phyblock.domain import PoseStep
from phyblock.parsing.poses import FARTHEST_PLACE_CM, MOST_POSE_STEPS
from phyblock.tracks.by_hand import NumberField, Pick, Picking, candidate_choices
from phyblock.tracks.pose_planning.baselines import PoseSubject, written
from phyblock.tracks.pose_planning.pictures import KIT_LABEL

__all__ = ["pick_poses"]

_PLACE = tuple(
    NumberField(name, "cm", FARTHEST_PLACE_CM, decimals=2, step=0.5, leap=5.0) for name in "xyz"
)
_TURN = tuple(
    NumberField(f"r{name}", "degrees", 360.0, decimals=1, step=15.0, leap=90.0, start=0.0)
    for name in "xyz"
)
"""At first as the sheet of blocks shows it."""


def pick_poses(subject: PoseSubject) -> Picking:
    """Any candidates, each as often as needed, with its place, and its turn where that is free."""
    return Picking(
        candidate_choices(len(subject.candidates), (KIT_LABEL,)),
        least=1,
        most=MOST_POSE_STEPS,
        repeats=True,
        noun="step",
        write=lambda picks: written(map(_step, picks)),
        fields=(*_PLACE, *(_TURN if subject.is_free else ())),
    )


def _step(pick: Pick) -> PoseStep:
    x, y, z, *turn = pick.numbers
    return PoseStep(pick.place + 1, (x, y, z), (turn[0], turn[1], turn[2]) if turn else None)
