"""Counts of a sample that are made when its reply is judged, and kept in its record."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from phyblock.registry import added_measures
from phyblock.tracks.kind import kind_of
from phyblock.tracks.measures import SampleCounts

__all__ = ["count_sample"]


def count_sample(track: str, item: Any, judged: Any) -> Mapping[str, tuple[float, ...]]:
    """Return the counts of one sample that the measures of a track need, by name of the counts.

    `judged` is the judgement of the reply, or the episode once it has ended. Where a measure does
    not count a sample, its counts are empty: they are absent where a record was written before the
    measure was there, and `phyblock score` fills them in.
    """
    counts = {name: count(item, judged) for name, count in _sorts(track).items()}
    return {
        name: tuple(float(number) for number in numbers or ()) for name, numbers in counts.items()
    }


def _sorts(track: str) -> dict[str, Callable[[Any, Any], Sequence[float] | None]]:
    """Return the functions that count a sample of a track, by name of the counts."""
    added: list[SampleCounts] = [measure.counted for measure in added_measures(track)]
    return {
        counted.name: counted.sample
        for counted in (*kind_of(track).counted, *added)
        if counted.sample is not None
    }
