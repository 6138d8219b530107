"""The four types of wrong step (paper appendix B.3), exhaustive and exclusive."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Literal, get_args

__all__ = ["ERROR_TYPES", "ErrorType", "count_errors", "error_type"]

ErrorType = Literal["shape_not_in_gt", "overflow", "incorrect_orientation", "dependency_not_met"]
ERROR_TYPES: tuple[ErrorType, ...] = get_args(ErrorType)
"""The first that holds, at the state that the step met: no goal block has this type and color;
every such block is already placed; an unplaced one exists, but none that equals the candidate
under the setting (A only); an unplaced equal one exists but is not ready.
"""


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
