"""How often the pose of a needed kind is chosen rightly, where it is listed first and where not.

A model that looks chooses as well in either case; one that goes by the list does not.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from phyblock.domain import CandidateSet, Scene
from phyblock.scoring.counts import Floats, ratio_of
from phyblock.tables.measures import Measure, SampleCounts

__all__ = ["POSE_COUNTS", "POSE_MEASURES", "pose_choices", "pose_counts"]


def pose_choices(
    scene: Scene, candidates: CandidateSet, steps: Sequence[int]
) -> Iterator[tuple[bool, bool]]:
    """For each kind that could be chosen wrongly and was named: whether the pose that is listed
    first is right, and whether the pose that was named first is.

    Such a kind is needed in one pose or several, and offered in a pose in which it is not. Numbers
    that no candidate has name nothing.
    """
    needed = {block.look for block in scene.blocks}
    kinds = {block.kind for block in scene.blocks}
    chosen: dict[Any, bool] = {}
    for step in steps:
        if 1 <= step <= len(candidates):
            one = candidates[step]
            chosen.setdefault(one.kind, one.look in needed)
    for kind in sorted(kinds & set(chosen)):
        right = [one.look in needed for one in candidates.candidates if one.kind == kind]
        if not all(right):
            yield right[0], chosen[kind]


def pose_counts(
    scene: Scene, candidates: CandidateSet, steps: Sequence[int]
) -> tuple[int, int, int, int]:
    """The numbers of `POSE_COUNTS`."""
    choices = list(pose_choices(scene, candidates, steps))
    first = [is_right for is_first, is_right in choices if is_first]
    later = [is_right for is_first, is_right in choices if not is_first]
    return sum(first), len(first), sum(later), len(later)


def _count(item: Any, judged: Any) -> tuple[int, int, int, int]:
    return pose_counts(item.scene, item.candidates, judged.steps)


def _first(sums: Floats) -> Floats:
    return ratio_of(sums[..., :2])


def _later(sums: Floats) -> Floats:
    return ratio_of(sums[..., 2:])


def _gap(sums: Floats) -> Floats:
    return np.asarray(_first(sums) - _later(sums))


POSE_COUNTS = SampleCounts(
    "poses", ("first_right", "first_n", "later_right", "later_n"), sample=_count
)
POSE_MEASURES = (
    Measure(
        "pose_first",
        "Right pose, listed first",
        POSE_COUNTS,
        _first,
        "kinds named in the right pose, of those whose right pose is listed first among others",
        over="kinds",
    ),
    Measure(
        "pose_later",
        "Right pose, listed later",
        POSE_COUNTS,
        _later,
        "the same, of those of which a wrong pose is listed first",
        over="kinds",
    ),
    Measure(
        "pose_gap",
        "Listed first less later",
        POSE_COUNTS,
        _gap,
        "what is won by the place in the list: nothing, for a model that goes by the picture",
        better="lower",
        over="kinds",
        is_difference=True,
    ),
)
