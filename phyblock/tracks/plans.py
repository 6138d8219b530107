"""The common part of records of plans: the plan that was read, and its scores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from phyblock.domain import CandidateSet, Scene
from phyblock.records.line import Line
from phyblock.records.record import ShownScene
from phyblock.scoring.counts import Floats, ratio_of
from phyblock.scoring.plan import Score
from phyblock.tracks.measures import Measure, SampleCounts


class PlanParse(Line):
    """The plan that was read in a reply."""

    parser: str
    """How replies are read."""
    rule: str | None
    """The rule that matched; null: nothing could be read."""
    plan: tuple[int, ...]
    """Candidate numbers in order, as they were shown."""
    file_plan: tuple[int, ...] | None = None
    """The same in the numbers of the file; null: those are the ones that were shown."""
    dropped: tuple[int, ...] = ()
    """Numbers that no candidate has."""
    version: int = 1
    """Version of the parser."""
    problem: str | None = None
    """Why nothing could be read."""
    truncated: bool = False
    """True where the text breaks off within the plan."""


PLAN_COLUMNS = dict.fromkeys(("parser", "plan", "file_plan", "dropped", "shown"), "object")


def plan_row(parse: PlanParse | None, shown: ShownScene | None) -> Mapping[str, Any]:
    """The values of `PLAN_COLUMNS`; `shown` is None for what was shown as the file has it."""
    order = None if shown is None else shown.fields()
    if parse is None:
        return {**dict.fromkeys(PLAN_COLUMNS), "shown": order}
    in_file = parse.plan if parse.file_plan is None else parse.file_plan
    return {
        "parser": parse.parser,
        "plan": list(parse.plan),
        "file_plan": list(in_file),
        "dropped": list(parse.dropped),
        "shown": order,
    }


def score_fields(score: Score) -> dict[str, Any]:
    """A score as records hold it."""
    return {
        "criterion": score.criterion,
        "matcher": score.matcher,
        "setting": score.setting,
        "tp": score.counts.tp,
        "fp": score.counts.fp,
        "fn": score.counts.fn,
        "errors": score.errors,
        "placed": None if score.vertices is None else list(score.vertices),
        "why": None if score.step_errors is None else list(score.step_errors),
        "blocks": score.blocks,
        "kept": score.kept,
    }


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
