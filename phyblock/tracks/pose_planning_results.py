"""Measures of plans with poses by level: right poses, how far off they are, what stands, errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from phyblock.data import AssemblyTask
from phyblock.domain import PoseStep
from phyblock.errors import Problem, SpecError
from phyblock.results.text import NO_VALUE, Column, TextTable, number
from phyblock.scoring.counts import Floats, f1_of, mean_of, ratio_of
from phyblock.scoring.pose import POSE_ERRORS, POSE_FRAMES, PoseError, PoseFrame
from phyblock.scoring.pose_matching import TOLERANCES_CM
from phyblock.sim.film import FilmStep, Tone
from phyblock.sim.geometry import put, upright
from phyblock.text import counted
from phyblock.tracks.base import CARRYING, ENGINE
from phyblock.tracks.measures import (
    EpisodeView,
    HeadlineColumn,
    Listing,
    Measure,
    TrackReport,
    by_settings,
    share,
)
from phyblock.tracks.pose_planning import (
    CARRIED,
    ERRORS,
    FITS,
    LISTED_IN_C,
    PLANS,
    POSE_FLOORS,
    RIGHT,
    PoseOutcome,
    PoseRecord,
    StepOutcome,
    worlds_of,
)
from phyblock.types import REFUSED_ENDS, Setting, StepEnd

if TYPE_CHECKING:
    from phyblock.results.load import Design, Run

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


def _f1(frame: PoseFrame, tolerances_cm: tuple[float, ...], sums: Floats) -> Floats:
    """Mean over tolerances of 2 TP / (steps + blocks)."""
    columns = RIGHT.columns
    whole = sums[..., columns.index("steps")] + sums[..., columns.index("blocks")]
    parts = [
        ratio_of(np.stack([2 * sums[..., columns.index(f"{frame}_{cm:g}")], whole], axis=-1))
        for cm in tolerances_cm
    ]
    return np.asarray(np.mean(parts, axis=0))


def tolerance_measure(frame: PoseFrame, cm: float) -> str:
    """Name of F1 at one tolerance."""
    return f"f1_{frame}_{cm:g}cm".replace(".", "_")


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
        )
        for frame in POSE_FRAMES
        for cm in TOLERANCES_CM
    ),
    _plan_f1("A", "the plan without its poses, as full planning scores it in setting A"),
    _plan_f1("B", "the same in setting B"),
    share(FITS, "position_cm", "n", "Position error", name="position_error", unit="cm",
          better="lower", over="steps",
          meaning="distance of steps from the blocks that they stand for"),
    share(FITS, "turn_deg", "n", "Rotation error", name="rotation_error", unit="degrees",
          better="lower", over="steps", most=180.0,
          meaning="how far these steps are turned, up to symmetry"),
    share(FITS, "iou", "n", "Volume IoU", name="volume_iou", over="steps", ratio=mean_of,
          meaning="what these steps and their blocks have in common of their volume"),
    share(CARRIED, "stands", "steps", "Steps that stand",
          meaning="steps carried out that stay and let others stay"),
    share(CARRIED, "reached", "blocks", "Blocks reached",
          meaning="blocks of the goal within 1 cm and 10 degrees in the end, by the suite's "
          "tolerances"),
    share(CARRIED, "iou", "plans", "Final IoU", name="final_iou", ratio=mean_of,
          meaning="what stands in the end and the goal have in common, in voxels of 5 mm"),
    share(CARRIED, "completed", "plans", "Completed",
          meaning="plans that end as the goal, with nothing left over"),
    *(
        share(ERRORS, error, "steps", ERROR_NAMES[error], name=f"pose_{error}", better="lower",
              meaning=_ERROR_MEANINGS[error])
        for error in POSE_ERRORS
    ),
)  # fmt: skip


_ENDS: dict[StepEnd, str] = {
    "stands": "stands",
    "falls": "falls",
    "knocks_over": "knocks others over",
    "overlaps": "overlaps",
    "under_floor": "under the floor",
    "no_block": "no such block",
}


def pose_table(record: PoseRecord) -> TextTable:
    """Every step: what it puts where, how far off that is, and how it ended."""
    columns = ("Step", "Block", "At (cm)", "Off by (cm)", "Ended", "Error")
    given = record.parse.steps if record.parse else ()
    steps = record.pose.steps if record.pose else ()
    rows = tuple(
        (
            str(n),
            str(one.block),
            ", ".join(f"{part:g}" for part in one.center_cm),
            NO_VALUE if step.position_cm is None else number(step.position_cm, 2),
            _ended(step),
            "" if step.error is None else ERROR_NAMES[step.error],
        )
        for n, (one, step) in enumerate(zip(given, steps, strict=True), 1)
    )
    text = ("At (cm)", "Ended", "Error")
    return TextTable(
        f"{record.sample}: {_came_to(record, record.pose)}",
        tuple(Column(name, is_text=name in text) for name in columns),
        rows,
        () if given else (_no_plan(record),),
    )


def pose_film(record: PoseRecord, task: AssemblyTask) -> Iterator[FilmStep]:
    """A frame for the plan as given, one for the world after each step, and one for the end."""
    given = record.parse.steps if record.parse else ()
    pose, candidates = record.pose, task.candidates
    if pose is None:
        return
    if pose.rotation == "free":
        candidates, _ = upright(candidates)
    steps = [PoseStep(one.block, one.center_cm, one.euler_deg) for one in given]
    blocks = [put(step, candidates) for step in steps]
    yield FilmStep(
        f"{record.model}, {task.scene.id}: the plan as given", "plain", None,
        tuple(block for block in blocks if block is not None),
    )  # fmt: skip
    stays = [step.end not in REFUSED_ENDS for step in pose.steps]
    worlds = worlds_of(blocks, stays, [step.rests for step in pose.steps])
    for n, (one, step, world) in enumerate(zip(given, pose.steps, worlds, strict=True), 1):
        tone: Tone = "good" if step.error is None else "bad"
        where = ""
        if step.error is not None and step.end == "stands":
            where = f", but {ERROR_NAMES[step.error].lower()}"
        yield FilmStep(f"{n}. block {one.block}: {_ended(step)}{where}", tone, one.block, world)
    tone = "good" if pose.completed else "bad"
    yield FilmStep(f"{_came_to(record, pose)}", tone, None, worlds[-1] if worlds else ())


def _no_plan(record: PoseRecord) -> str:
    """Return why there is not one step."""
    why = "there is no reply"
    if record.error is not None:
        why = record.error.message
    elif record.parse is not None and record.parse.problem is not None:
        why = f"nothing could be read out of the reply ({record.parse.problem})"
    return f"There is no plan: {why}."


def _ended(step: StepOutcome) -> str:
    if step.end == "falls":
        return f"falls, {number(step.moved_cm)} cm from its place"
    if step.end == "knocks_over":
        return f"knocks over {', '.join(map(str, step.knocked))}"
    return _ENDS[step.end]


def _came_to(record: PoseRecord, pose: PoseOutcome | None) -> str:
    if pose is None:
        return "nothing was carried out"
    return f"{pose.reached} of {counted(record.n_blocks, 'block')} reached, IoU {pose.iou:.2f}"


_MAIN = "Overall F1 in C"


def _headline(run: Run) -> tuple[HeadlineColumn, ...]:
    cells = run.level_cells()
    levels = [
        HeadlineColumn("f1_c", cell.name, _MAIN if cell == cells[-1] else cell.heading)
        for cell in cells
    ]
    sides = [
        HeadlineColumn(name, cells[-1].name, heading)
        for name, heading in (("f1_a", "F1 in A"), ("stands", "Stand"), ("completed", "Completed"))
    ]
    return (*levels, *sides)


def _notes(run: Run) -> Sequence[str]:
    return (
        "F1 in setting C in percent: steps right in kind, rotation and order, and in place, mean "
        f"over 0.5, 1, 2 and 4 cm; F1 in A leaves out the poses, matcher {run.design.matcher}.",
    )


def _check_alike(run: Run, first: Run, _: Sequence[str], measure: Measure) -> None:
    """Return the version of execution for measures of the world; F1 does not depend on it."""
    if measure.counted not in (CARRIED, ERRORS):
        return
    for key in (CARRYING, ENGINE):
        found, wanted = (one.manifest.tracks.get(NAME, {}).get(key) for one in (run, first))
        if found != wanted:
            message = f"carried plans out otherwise than {first.path}, which decides {measure.name}"
            hint = "run the older one again, or compare by f1_c"
            field = f"tracks.{NAME}.{key}"
            raise SpecError(Problem(str(run.path), message, field, str(found), str(wanted), hint))


def _listings(design: Design) -> tuple[Listing, ...]:
    return (LISTED_IN_C, *by_settings(design))


REPORT = TrackReport(
    measures=POSE_PLANNING_MEASURES,
    cells=lambda run: run.level_cells(),
    in_cells=lambda rows, run: run.in_levels(rows),
    headline=_headline,
    main=_MAIN,
    short="f1_c",
    notes=_notes,
    check_alike=_check_alike,
    episodes=EpisodeView(pose_table, pose_film),
    listings=_listings,
    showing=lambda run: run.showing("pose"),
)
