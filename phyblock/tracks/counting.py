"""What is counted of a sample when its reply is judged, and kept in its record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from phyblock.registry import added_measures
from phyblock.tables.measures import Counted
from phyblock.tracks.kind import kind_of

__all__ = ["sample_counts"]


def sample_counts(track: str, item: Any, judged: Any) -> Mapping[str, tuple[float, ...]]:
    """What the measures of a track count of one sample, by name of the counts.

    `judged` is the judgement of the reply, or the episode once it has ended. Where a measure does
    not count a sample, its counts are empty: they are absent where a record was written before the
    measure was there, and `phyblock score` fills them in.
    """
    added: list[Counted] = [measure.counted for measure in added_measures(track)]
    found = {
        counted.name: counted.sample(item, judged)
        for counted in (*kind_of(track).counted, *added)
        if counted.sample is not None
    }
    return {
        name: tuple(float(number) for number in numbers or ()) for name, numbers in found.items()
    }
