"""A plan with poses step by step: as a table of text, and as the frames of a film."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from phyblock.data import AssemblyTask
from phyblock.domain import Block, PoseStep
from phyblock.scoring.pose import PoseError
from phyblock.sim.dynamics import ExecutionLimits, execute
from phyblock.sim.engine import described_engine
from phyblock.sim.film import FilmStep, Tone
from phyblock.sim.geometry import put, upright
from phyblock.tables.text_table import NO_VALUE, Column, TextTable, number
from phyblock.text import counted
from phyblock.tracks.pose_planning.measures import ERROR_NAMES
from phyblock.tracks.pose_planning.record import PoseOutcome, PoseRecord, StepOutcome, kept_rests
from phyblock.tracks.pose_planning.resting import worlds_of
from phyblock.types import REFUSED_ENDS, StepEnd

__all__ = ["pose_film", "pose_table"]

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
    """A frame for the plan as it was given, one for the world after each step, and one for the end.

    A plan of which the record does not keep where blocks came to lie is carried out again, in the
    engine that is chosen now.
    """
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
    worlds = _kept_worlds(blocks, pose.steps)
    by = ""
    if worlds is None:
        tolerances = pose.limits
        limits = ExecutionLimits(tolerances.overlap_cm, tolerances.stand_cm, tolerances.stand_deg)
        worlds = execute(blocks, limits).worlds
        if pose.engine != (engine := described_engine()):
            by = f" (shown in {engine}, not {pose.engine})"
    for n, (one, step, world) in enumerate(zip(given, pose.steps, worlds, strict=True), 1):
        tone: Tone = "good" if step.error is None else "bad"
        where = "" if step.error is None or step.end != "stands" else _where(step.error)
        yield FilmStep(f"{n}. block {one.block}: {_ended(step)}{where}", tone, one.block, world)
    tone = "good" if pose.completed else "bad"
    yield FilmStep(f"{_came_to(record, pose)}{by}", tone, None, worlds[-1] if worlds else ())


def _kept_worlds(
    blocks: Sequence[Block | None], steps: Sequence[StepOutcome]
) -> tuple[tuple[Block, ...], ...] | None:
    """The blocks after each step, None where that was not kept."""
    kept = [rests for step in steps if (rests := kept_rests(step)) is not None]
    if len(kept) < len(steps):
        return None
    return worlds_of(blocks, [step.end not in REFUSED_ENDS for step in steps], kept)


def _no_plan(record: PoseRecord) -> str:
    """Why there is not one step."""
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


def _where(error: PoseError) -> str:
    """What is wrong with a step that stands."""
    return f", but {ERROR_NAMES[error].lower()}"


def _came_to(record: PoseRecord, pose: PoseOutcome | None) -> str:
    if pose is None:
        return "nothing was carried out"
    return f"{pose.reached} of {counted(record.n_blocks, 'block')} reached, IoU {pose.iou:.2f}"
