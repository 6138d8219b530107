"""The four types of wrong step (paper appendix B.3), exhaustive and exclusive."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Literal, get_args

from phyblock.domain import CandidateSet, Plan, Scene
from phyblock.scoring.match import Goal, Match

__all__ = ["ERROR_TYPES", "ErrorType", "count_errors", "error_type", "step_errors"]

ErrorType = Literal["shape_not_in_gt", "overflow", "incorrect_orientation", "dependency_not_met"]
ERROR_TYPES: tuple[ErrorType, ...] = get_args(ErrorType)


def step_errors(
    scene: Scene, candidates: CandidateSet, goal: Goal, plan: Plan, match: Match
) -> tuple[ErrorType | None, ...]:
    """For each step, why it is wrong, or None for a true positive.

    Tested in this order, at the state the step met: no goal block has this type and colour
    (`shape_not_in_gt`); every such block is already placed (`overflow`); an unplaced one exists,
    but none that equals the candidate under the goal's setting (`incorrect_orientation`, setting
    A only); an unplaced equal one exists but is not ready (`dependency_not_met`).
    """
    of_kind: dict[int, int] = {
        index: sum(1 << v for v, block in enumerate(scene.blocks) if block.kind == candidate.kind)
        for index, candidate in enumerate(candidates.candidates, 1)
    }
    equal = {index: sum(1 << v for v in goal.equal_to[index]) for index in of_kind}
    return tuple(
        error_type(of_kind[index], equal[index], placed) if vertex is None else None
        for index, vertex, placed in zip(plan.steps, match.vertices, match.placed, strict=True)
    )


def error_type(of_kind: int, equal: int, placed: int) -> ErrorType:
    """Why a step is wrong: bit masks of the goal blocks of the candidate's type and color, of
    those equal to it under the setting, and of those placed when the step came.
    """
    if not of_kind:
        return "shape_not_in_gt"
    if not of_kind & ~placed:
        return "overflow"
    if not equal & ~placed:
        return "incorrect_orientation"
    return "dependency_not_met"


def count_errors(errors: Iterable[ErrorType | None]) -> dict[ErrorType, int]:
    """Number of wrong steps of each type, all four types present."""
    counted = Counter(error for error in errors if error is not None)
    return {name: counted[name] for name in ERROR_TYPES}
