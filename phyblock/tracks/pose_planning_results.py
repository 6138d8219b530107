"""Results of plans with poses by level: right poses, how far off they are, what stands, errors."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from phyblock.data import AssemblyTask
from phyblock.domain import PoseStep
from phyblock.scoring.counts import Floats, ratio_of
from phyblock.scoring.pose import PoseFrame
from phyblock.scoring.pose_matching import TOLERANCES_CM
from phyblock.sim.film import FilmStep, Tone
from phyblock.sim.geometry import put, upright
from phyblock.text import counted
from phyblock.tracks.measures import level_cells, read_report
from phyblock.tracks.pose_planning import (
    COUNTS,
    POSE_FLOORS,
    RIGHT,
    GivenStep,
    PoseRecord,
    StepOutcome,
    worlds_of,
)
from phyblock.types import REFUSED_ENDS

if TYPE_CHECKING:
    from phyblock.domain import Block


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
        stays = [step.end not in REFUSED_ENDS for step in pose.steps]
        worlds = list(worlds_of(blocks, stays, [step.rests for step in pose.steps]))
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
    {"f1_c": partial(_f1, "absolute"), "f1_c_aligned": partial(_f1, "aligned")},
    cells=level_cells,
    floors=POSE_FLOORS,
    film=_film,
)
