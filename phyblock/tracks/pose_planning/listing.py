"""How the page of a run lists plans with poses: by F1 in setting C, as their headline does."""

from __future__ import annotations

from phyblock.records import Record
from phyblock.scoring.pose import POSE_ERRORS
from phyblock.scoring.pose_matching import TOLERANCES_CM
from phyblock.tables.listing import ListedScore, Listing
from phyblock.tracks.pose_planning.counts import RIGHT
from phyblock.tracks.pose_planning.record import PoseRecord

__all__ = ["LISTED_IN_C"]

_RIGHT = tuple(RIGHT.columns.index(f"absolute_{cm:g}") for cm in TOLERANCES_CM)
_STEPS, _BLOCKS = (RIGHT.columns.index(name) for name in ("steps", "blocks"))


def _in_c(record: Record) -> ListedScore | None:
    """Right steps as a mean over the tolerances, which gives the mean of their F1."""
    counts = record.counts.get(RIGHT.name)
    if counts is None:
        return None
    right = sum(counts[place] for place in _RIGHT) / len(_RIGHT)
    pose = record.pose if isinstance(record, PoseRecord) else None
    errors = {step.error for step in pose.steps if step.error is not None} if pose else ()
    return ListedScore(right, counts[_STEPS] - right, counts[_BLOCKS] - right, errors)


LISTED_IN_C = Listing("C", POSE_ERRORS, _in_c, is_counted=False)
