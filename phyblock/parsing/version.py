"""Which version of the readers read a reply, so that readings of two versions are told apart."""

from __future__ import annotations

from phyblock.types import PlanParser

__all__ = ["POSE_READER_VERSION", "READER_VERSION", "reader_version"]

READER_VERSION = 6
"""Of the readers of plans, answers and moves, and of the JSON forms in which they are asked for; it
goes up when any reply can be read otherwise, or is asked for in another form.
"""
POSE_READER_VERSION = 3
"""Of the reader of plans with poses; it goes up when any reply can be read otherwise, also by what
it shares with the other readers (thoughts, frames, marks).
"""


def reader_version(parser: PlanParser) -> int:
    """The version of a plan parser: `official` is the released code's rule and never changes."""
    return 1 if parser == "official" else READER_VERSION
