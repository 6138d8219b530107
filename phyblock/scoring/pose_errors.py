"""What was wrong with each step of a plan with poses: one type a step, the first in time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

from phyblock.scoring.error_types import error_type
from phyblock.scoring.goal import Goal
from phyblock.scoring.pose import PoseFit
from phyblock.scoring.pose_match import TURN_TOLERANCE_DEG
from phyblock.types import StepEnd

__all__ = ["ERROR_TOLERANCE_CM", "POSE_ERRORS", "PoseError", "pose_errors"]

PoseError = Literal[
    "wrong_kind",
    "wrong_rotation",
    "too_early",
    "off_sideways",
    "off_height",
    "interpenetrating",
    "floating",
    "toppling",
]
POSE_ERRORS: tuple[PoseError, ...] = get_args(PoseError)
"""In the order in which a step meets them, of which the first counts: a block is chosen, of a kind
that the goal does not need, or not so often (`wrong_kind`); it is turned as no such block of the
goal is (`wrong_rotation`); what it rests on is not there (`too_early`); its place is farther than
`ERROR_TOLERANCE_CM` from that of its goal block, more to a side or more up or down (`off_sideways`,
`off_height`); put there, it shares space with others or the floor (`interpenetrating`); let go, it
does not stay (`floating`), or others do not (`toppling`).
"""
ERROR_TOLERANCE_CM = 1.0


def pose_errors(
    goal: Goal,
    numbers: Sequence[int],
    fits: Sequence[PoseFit | None],
    ends: Sequence[StepEnd],
) -> tuple[PoseError | None, ...]:
    """The error of each step, None for one that is right and stands.

    `numbers` are the candidates of all steps, those included that no candidate is, which have no
    fit; `fits` and `ends` are as the plan stands and as it was carried out.
    """
    placed = 0
    found: list[PoseError | None] = []
    for number, fit, end in zip(numbers, fits, ends, strict=True):
        if fit is None:
            found.append(_unmatched(goal, number, placed))
            continue
        placed |= 1 << fit.vertex
        found.append(_misplaced(fit) or _physical(end))
    return tuple(found)


def _unmatched(goal: Goal, number: int, placed: int) -> PoseError:
    if number not in goal.equal:
        return "wrong_kind"
    why = error_type(goal.of_kind[number], goal.equal[number], placed)
    if why == "incorrect_orientation":
        return "wrong_rotation"
    # One of several steps for a block, of which another lies nearer, is one too many.
    is_ready = bool(goal.choices(number, placed))
    return "too_early" if why == "dependency_not_met" and not is_ready else "wrong_kind"


def _misplaced(fit: PoseFit) -> PoseError | None:
    if fit.turn_deg > TURN_TOLERANCE_DEG:
        return "wrong_rotation"
    if fit.position_cm <= ERROR_TOLERANCE_CM:
        return None
    return "off_sideways" if fit.sideways_cm >= abs(fit.up_cm) else "off_height"


def _physical(end: StepEnd) -> PoseError | None:
    errors: dict[StepEnd, PoseError] = {
        "no_block": "wrong_kind",
        "under_floor": "interpenetrating",
        "overlaps": "interpenetrating",
        "falls": "floating",
        "knocks_over": "toppling",
    }
    return errors.get(end)
