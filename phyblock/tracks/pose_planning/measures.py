"""What pose planning measures: poses that are right, how far off they are, what stands, and the
plan without its poses; by level.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from phyblock.scoring.counts import Floats, f1_of, mean_of, ratio_of
from phyblock.scoring.pose import POSE_ERRORS, POSE_FRAMES, PoseError, PoseFrame
from phyblock.scoring.pose_matching import TOLERANCES_CM
from phyblock.tables.load import Run
from phyblock.tables.measures import Measure, SampleCounts
from phyblock.tracks.pose_planning.baselines import POSE_FLOORS
from phyblock.tracks.pose_planning.counts import CARRIED, ERRORS, FITS, PLANS, RIGHT
from phyblock.types import Setting

__all__ = [
    "ERROR_NAMES",
    "NAME",
    "POSE_PLANNING_MEASURES",
    "error_measure",
    "is_asked",
    "tolerance_measure",
]

NAME = "pose_planning"

ERROR_NAMES: dict[PoseError, str] = {
    "wrong_kind": "Wrong kind",
    "wrong_rotation": "Wrong rotation",
    "too_early": "Too early",
    "off_sideways": "Off sideways",
    "off_height": "Off in height",
    "interpenetrating": "Interpenetrating",
    "floating": "Floating",
    "toppling": "Toppling others",
}
_ERROR_MEANINGS: dict[PoseError, str] = {
    "wrong_kind": "steps with a block that the goal does not need, or not so often",
    "wrong_rotation": "steps with a block that is turned as none of its kind in the goal is",
    "too_early": "steps with a block whose supports are not there",
    "off_sideways": "steps more than 1 cm off, more to a side than in height",
    "off_height": "steps more than 1 cm off, more in height than to a side",
    "interpenetrating": "steps with a right pose that were refused, as space was taken",
    "floating": "steps with a right pose whose block did not stay",
    "toppling": "steps with a right pose that moved other blocks",
}


def is_asked(run: Run) -> bool:
    """Whether the run has plans with poses."""
    return NAME in run.design.suite.tracks


def _f1(frame: PoseFrame, tolerances_cm: tuple[float, ...], sums: Floats) -> Floats:
    """Mean over tolerances of 2 TP / (steps + blocks)."""
    columns = RIGHT.columns
    whole = sums[..., columns.index("steps")] + sums[..., columns.index("blocks")]
    parts = [
        ratio_of(np.stack([2 * sums[..., columns.index(f"{frame}_{cm:g}")], whole], axis=-1))
        for cm in tolerances_cm
    ]
    return np.asarray(np.mean(parts, axis=0))


def _share(counted: SampleCounts, part: str, whole: str, sums: Floats) -> Floats:
    """Share of a column in another."""
    return ratio_of(_two(counted, part, whole, sums))


def _mean(counted: SampleCounts, column: str, number: str, sums: Floats) -> Floats:
    """Mean of what was summed in a column."""
    return mean_of(_two(counted, column, number, sums))


def _two(counted: SampleCounts, first: str, second: str, sums: Floats) -> Floats:
    return sums[..., [counted.columns.index(first), counted.columns.index(second)]]


def tolerance_measure(frame: PoseFrame, cm: float) -> str:
    """Name of F1 at one tolerance."""
    return f"f1_{frame}_{cm:g}cm".replace(".", "_")


def error_measure(error: PoseError) -> str:
    """Name of the measure of an error: its share of all steps."""
    return f"pose_{error}"


def _plan_f1(setting: Setting, meaning: str) -> Measure:
    name, heading = f"f1_{setting.lower()}", f"F1 in {setting}"
    return Measure(name, heading, PLANS[setting], f1_of, meaning, over="steps")


_WITHIN = "right steps within {} of their place and 15 degrees"

POSE_PLANNING_MEASURES = (
    Measure(
        "f1_c", "F1 in C", RIGHT, partial(_f1, "absolute", TOLERANCES_CM),
        _WITHIN.format("0.5, 1, 2 and 4 cm") + ", the mean of the four", over="steps",
        floors=POSE_FLOORS,
    ),
    Measure(
        "f1_c_aligned", "F1 in C, aligned", RIGHT, partial(_f1, "aligned", TOLERANCES_CM),
        "the same after the best shift over the floor and turn of the whole plan", over="steps",
        floors=POSE_FLOORS,
    ),
    *(
        Measure(
            tolerance_measure(frame, cm), f"F1 at {cm:g} cm{', aligned' * (frame == 'aligned')}",
            RIGHT, partial(_f1, frame, (cm,)), _WITHIN.format(f"{cm:g} cm"), over="steps",
            in_tables=frame == "absolute",
        )
        for frame in POSE_FRAMES
        for cm in TOLERANCES_CM
    ),
    _plan_f1("A", "the plan without its poses, as full planning scores it in setting A"),
    _plan_f1("B", "the same in setting B"),
    Measure(
        "position_error", "Position error", FITS, partial(_mean, FITS, "position_cm", "n"),
        "distance of steps from the blocks that they stand for", unit="cm", better="lower",
        over="steps", most=math.inf,
    ),
    Measure(
        "rotation_error", "Rotation error", FITS, partial(_mean, FITS, "turn_deg", "n"),
        "how far these steps are turned, up to symmetry", unit="degrees", better="lower",
        over="steps", most=180.0,
    ),
    Measure(
        "volume_iou", "Volume IoU", FITS, partial(_mean, FITS, "iou", "n"),
        "what these steps and their blocks have in common of their volume", over="steps",
    ),
    Measure(
        "stands", "Steps that stand", CARRIED, partial(_share, CARRIED, "stands", "steps"),
        "steps carried out that stay and let others stay", over="steps",
    ),
    Measure(
        "reached", "Blocks reached", CARRIED, partial(_share, CARRIED, "reached", "blocks"),
        "blocks of the goal within 1 cm and 10 degrees in the end, by the suite's tolerances",
        over="blocks",
    ),
    Measure(
        "final_iou", "Final IoU", CARRIED, partial(_mean, CARRIED, "iou", "plans"),
        "what stands in the end and the goal have in common, in voxels of 5 mm", over="plans",
    ),
    Measure(
        "completed", "Completed", CARRIED, partial(_share, CARRIED, "completed", "plans"),
        "plans that end as the goal, with nothing left over", over="plans",
    ),
    *(
        Measure(
            error_measure(error), ERROR_NAMES[error], ERRORS,
            partial(_share, ERRORS, error, "steps"), _ERROR_MEANINGS[error], better="lower",
            over="steps", in_tables=False,
        )
        for error in POSE_ERRORS
    ),
)  # fmt: skip
