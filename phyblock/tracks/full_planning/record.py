"""What the full-planning track adds to a record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from phyblock.records import Record
from phyblock.tracks.plans import PLAN_COLUMNS, PlanParse, plan_row

__all__ = ["PlanRecord"]


class PlanRecord(Record):
    """A plan for a scene."""

    track: Literal["full_planning"]
    """`full_planning`."""
    parse: PlanParse | None = None
    """The plan that was read."""

    columns: ClassVar[Mapping[str, str]] = PLAN_COLUMNS

    def row(self) -> Mapping[str, Any]:
        """The plan in both numberings, and by which parser it was read."""
        return plan_row(self.parse, self.shown)
