"""What the full-planning track adds to a record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from phyblock.records import Line, Record

__all__ = ["PLAN_COLUMNS", "PlanParse", "PlanRecord", "plan_row"]


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
    version: int = 1
    """Version of the parser."""
    problem: str | None = None
    """Why nothing could be read."""


PLAN_COLUMNS = {"parser": "object", "plan": "object", "dropped": "object"}


def plan_row(parse: PlanParse | None) -> Mapping[str, Any]:
    """The values of `PLAN_COLUMNS`."""
    if parse is None:
        return dict.fromkeys(PLAN_COLUMNS)
    return {"parser": parse.parser, "plan": list(parse.plan), "dropped": list(parse.dropped)}


class PlanRecord(Record):
    """A plan for a scene."""

    track: Literal["full_planning"]
    """`full_planning`."""
    parse: PlanParse | None = None
    """The plan that was read."""

    columns: ClassVar[Mapping[str, str]] = PLAN_COLUMNS

    def row(self) -> Mapping[str, Any]:
        """The plan, and by which parser it was read."""
        return plan_row(self.parse)
