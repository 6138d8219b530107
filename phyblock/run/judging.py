"""Judging a reply, also where no engine can carry it out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from phyblock.errors import SimulationError
from phyblock.records.record import Record
from phyblock.records.reply import StoredError
from phyblock.run.records import judged
from phyblock.tracks import Item, SingleTrack

__all__ = ["judged_apart"]


async def judged_apart(
    track: SingleTrack[Any],
    item: Item,
    text: str | None,
    fields: Mapping[str, Any],
    earlier: Record | None = None,
) -> Record:
    """The record of a reply, for the first time or again after an `earlier` one.

    Where no engine could carry the reply out, it says so and can be judged again.
    """
    try:
        return judged(fields, item, await track.judge_apart(item, text, earlier))
    except SimulationError as error:
        if text is None:
            raise
        lacking = StoredError(kind="unjudged", message=str(error))
        nothing = await track.judge_apart(item, None, None)
        return judged({**fields, "error": lacking}, item, nothing)
