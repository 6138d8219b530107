"""What is counted of a plan with poses as it is judged."""

from __future__ import annotations

from collections import Counter
from typing import Any

from phyblock.scoring.pose import POSE_ERRORS, POSE_FRAMES
from phyblock.scoring.pose_matching import TOLERANCES_CM
from phyblock.stable import plain_sum
from phyblock.tables.measures import SampleCounts
from phyblock.types import SETTINGS, STEP_ENDS, Setting

__all__ = ["CARRIED", "COUNTED", "ERRORS", "FITS", "PLANS", "RIGHT"]


def _right(_: Any, judged: Any) -> tuple[int, ...]:
    by_frame = {score.frame: score.right for score in judged.poses}
    right = (count for frame in POSE_FRAMES for count in by_frame[frame])
    return (*right, len(judged.kept), judged.poses[0].n_blocks)


def _fits(_: Any, judged: Any) -> tuple[float, ...]:
    fits = [fit for fit in judged.fits if fit is not None]
    return (
        plain_sum(fit.position_cm for fit in fits),
        plain_sum(fit.turn_deg for fit in fits),
        plain_sum(fit.iou for fit in fits),
        len(fits),
    )


def _carried(_: Any, judged: Any) -> tuple[float, ...]:
    ended = judged.ended
    ends = Counter(step.end for step in ended.steps)
    whole = (ended.reached, judged.poses[0].n_blocks, ended.iou, ended.completed, 1)
    return (*(ends[name] for name in STEP_ENDS), len(ended.steps), *whole)


def _errors(_: Any, judged: Any) -> tuple[int, ...]:
    counts = Counter(error for error in judged.errors if error is not None)
    return (*(counts[name] for name in POSE_ERRORS), len(judged.errors))


def _plan(setting: Setting) -> SampleCounts:
    """The plan without its poses under a setting, by the headline matcher."""

    def count(_: Any, judged: Any) -> tuple[int, int, int] | None:
        scores = (score for score in judged.scores if score.setting == setting)
        counts = next((score.counts for score in scores), None)
        return None if counts is None else (counts.tp, counts.fp, counts.fn)

    return SampleCounts(f"plan_{setting.lower()}", ("tp", "fp", "fn"), sample=count)


RIGHT = SampleCounts(
    "poses",
    (*(f"{frame}_{cm:g}" for frame in POSE_FRAMES for cm in TOLERANCES_CM), "steps", "blocks"),
    sample=_right,
)
FITS = SampleCounts("fits", ("position_cm", "turn_deg", "iou", "n"), sample=_fits)
CARRIED = SampleCounts(
    "carried",
    (*STEP_ENDS, "steps", "reached", "blocks", "iou", "completed", "plans"),
    sample=_carried,
)
ERRORS = SampleCounts("pose_errors", (*POSE_ERRORS, "steps"), sample=_errors)
PLANS = {setting: _plan(setting) for setting in SETTINGS}
COUNTED = (RIGHT, FITS, CARRIED, ERRORS, *PLANS.values())
