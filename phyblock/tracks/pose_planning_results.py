"""Results of plans with poses by level: right poses, how far off they are, what stands, errors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from phyblock.data import AssemblyTask
from phyblock.domain import PoseStep
from phyblock.scoring.counts import Floats, ratio_of
from phyblock.scoring.pose import POSE_ERRORS, POSE_FRAMES, PoseFrame
from phyblock.scoring.pose_matching import TOLERANCES_CM
from phyblock.sim.film import FilmStep, Tone
from phyblock.sim.geometry import put, upright
from phyblock.stable import plain_sum
from phyblock.text import counted
from phyblock.tracks.base import CARRYING, ENGINE
from phyblock.tracks.measures import (
    SampleCounts,
    Way,
    level_cells,
    read_report,
)
from phyblock.tracks.pose_planning import (
    POSE_FLOORS,
    GivenStep,
    PoseRecord,
    StepOutcome,
    worlds_of,
)
from phyblock.types import SETTINGS, STEP_ENDS, Setting

if TYPE_CHECKING:
    from phyblock.domain import Block


def _right(record: PoseRecord) -> Iterator[tuple[Way, tuple[float, ...]]]:
    if (pose := record.pose) is not None:
        right = (count for frame in POSE_FRAMES for count in pose.right[frame])
        score = record.scores[0]
        yield _ANY, (*right, score.tp + score.fp, score.tp + score.fn)


def _fits(record: PoseRecord) -> Iterator[tuple[Way, tuple[float, ...]]]:
    if (pose := record.pose) is not None:
        fits = [step for step in pose.steps if step.vertex is not None]
        parts = ("position_cm", "turn_deg", "iou")
        sums = (plain_sum(getattr(fit, part) for fit in fits) for part in parts)
        yield _ANY, (*sums, len(fits))


def _carried(record: PoseRecord) -> Iterator[tuple[Way, tuple[float, ...]]]:
    if (pose := record.pose) is not None:
        ends, blocks = Counter(step.end for step in pose.steps), record.n_blocks
        whole = (pose.reached, blocks, pose.iou, pose.completed, 1)
        yield _ANY, (*(ends[name] for name in STEP_ENDS), len(pose.steps), *whole)


def _errors(record: PoseRecord) -> Iterator[tuple[Way, tuple[float, ...]]]:
    if (pose := record.pose) is not None:
        errors = Counter(step.error for step in pose.steps)
        yield _ANY, (*(errors[name] for name in POSE_ERRORS), len(pose.steps))


def _plan(setting: Setting, record: PoseRecord) -> Iterator[tuple[Way, tuple[float, ...]]]:
    """Count the plan without its poses under a setting, by the headline matcher."""
    for score in [one for one in record.scores if one.setting == setting][:1]:
        yield _ANY, (score.tp, score.fp, score.fn)


_ANY: Way = ("", "", "")
_ALIKE = tuple(f"tracks.pose_planning.{key}" for key in (CARRYING, ENGINE))
RIGHT = SampleCounts(
    "poses",
    (*(f"{frame}_{cm:g}" for frame in POSE_FRAMES for cm in TOLERANCES_CM), "steps", "blocks"),
    rows=_right,
)
CARRIED = (*STEP_ENDS, "steps", "reached", "blocks", "iou", "completed", "plans")
FITS = SampleCounts("fits", ("position_cm", "turn_deg", "iou", "n"), rows=_fits)
COUNTS = (
    RIGHT,
    FITS,
    SampleCounts("carried", CARRIED, rows=_carried, alike=_ALIKE),
    SampleCounts("pose_errors", (*POSE_ERRORS, "steps"), rows=_errors, alike=_ALIKE),
    *(
        SampleCounts(f"plan_{setting.lower()}", ("tp", "fp", "fn"), rows=partial(_plan, setting))
        for setting in SETTINGS
    ),
)


def _f1(frame: PoseFrame, sums: Floats) -> Floats:
    """Return the mean over tolerances of 2 TP / (steps + blocks)."""
    steps, blocks = (sums[..., RIGHT.columns.index(name)] for name in ("steps", "blocks"))
    right = (sums[..., RIGHT.columns.index(f"{frame}_{cm:g}")] for cm in TOLERANCES_CM)
    parts = [ratio_of(np.stack([2 * each, steps + blocks], axis=-1)) for each in right]
    return np.asarray(np.mean(parts, axis=0))


def _film(record: PoseRecord, task: AssemblyTask | None) -> Iterator[FilmStep]:
    """Yield the plan as given, the world after each step, and the end."""
    given, pose = record.parse.steps if record.parse else (), record.pose
    if pose is None or not given:
        yield FilmStep(f"there is no plan: {_no_plan(record)}", "bad", None, ())
        return
    worlds: list[tuple[Block, ...]] = [() for _ in given]
    blocks: list[Block | None] = []
    if task is not None:
        candidates = upright(task.candidates)[0] if pose.rotation == "free" else task.candidates
        steps = [PoseStep(one.block, one.center_cm, one.euler_deg) for one in given]
        blocks = [put(step, candidates) for step in steps]
        worlds = list(worlds_of(blocks, pose.steps))
    first = tuple(block for block in blocks if block is not None)
    yield FilmStep(f"{record.model}, {record.scene}: the plan as given", "plain", None, first)
    for n, (one, step, world) in enumerate(zip(given, pose.steps, worlds, strict=True), 1):
        tone: Tone = "good" if step.error is None else "bad"
        caption = f"{n}. block {one.block}: {_ended(step)}"
        if step.error is not None and step.end == "stands":
            caption += f", but {REPORT.heading('pose', step.error).lower()}"
        yield FilmStep(caption, tone, one.block, world, _where(one, step))
    reached = f"{pose.reached} of {counted(record.n_blocks, 'block')} reached"
    tone = "good" if pose.completed else "bad"
    yield FilmStep(f"{reached}, IoU {pose.iou:.2f}", tone, None, worlds[-1])


def _no_plan(record: PoseRecord) -> str:
    """Return why there is not one step."""
    if record.error is not None:
        return record.error.message
    if record.parse is not None and record.parse.problem is not None:
        return f"nothing could be read out of the reply ({record.parse.problem})"
    return "there is no reply"


def _where(given: GivenStep, step: StepOutcome) -> str:
    """Return where a step puts its block, how far that is off, and what is wrong with it."""
    told = [f"at ({', '.join(f'{part:g}' for part in given.center_cm)}) cm"]
    told += [] if step.position_cm is None else [f"off by {step.position_cm:.2f} cm"]
    told += [] if step.error is None else [REPORT.heading("pose", step.error).lower()]
    return ", ".join(told)


def _ended(step: StepOutcome) -> str:
    if step.end == "falls":
        return f"falls, {step.moved_cm:.1f} cm from its place"
    if step.end == "knocks_over":
        return f"knocks over {', '.join(map(str, step.knocked))}"
    plain = {"under_floor": "under the floor", "no_block": "no such block"}
    return plain.get(step.end, step.end)


REPORT = read_report(
    "pose_planning",
    COUNTS,
    {
        "f1_c": {"value": partial(_f1, "absolute")},
        "f1_c_aligned": {"value": partial(_f1, "aligned")},
    },
    cells=level_cells,
    floors=POSE_FLOORS,
    film=_film,
)
