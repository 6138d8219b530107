"""What the full-planning track adds to a record."""

from __future__ import annotations

from typing import Literal

from phyblock.records import Line, Record

__all__ = ["PlanParse", "PlanRecord"]


class PlanParse(Line):
    """The plan that was read in a reply."""

    parser: str
    """How replies are read."""
    rule: str | None
    """The rule that matched; null: nothing could be read."""
    plan: tuple[int, ...]
    """Candidate numbers in order."""
    dropped: tuple[int, ...] = ()
    """Numbers that no candidate has."""


class PlanRecord(Record):
    """A plan for a scene."""

    track: Literal["full_planning"]
    """`full_planning`."""
    parse: PlanParse | None = None
    """The plan that was read."""
