"""What became of a plan that was carried out, held against where its blocks came to lie.

Where a block came to lie is kept to within 1 mm and 1 degree of what it was judged by, so that what
was said may differ a little from what follows; what no such rounding explains is worked out anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from phyblock.domain import Block
from phyblock.scoring.pose import blocks_reached
from phyblock.sim.contact import voxel_iou
from phyblock.sim.dynamics import (
    DEFAULT_TRIAL,
    ExecutedStep,
    ExecutionLimits,
    depth_cm,
    end_of,
    moved_between,
)
from phyblock.sim.engine import Pose
from phyblock.tracks.pose_planning.resting import Rest, worlds_of
from phyblock.types import REFUSED_ENDS, StepEnd

__all__ = ["Ended", "borne_out"]

_CM = 100.0
_DIGITS, _IOU_DIGITS = 3, 4
_SLACK_CM, _SLACK_DEG, _SLACK_IOU = 0.2, 2.0, 0.15
_SET_BACK_CM = DEFAULT_TRIAL.limit_m * _CM + _SLACK_CM
_SET_BACK_DEG = DEFAULT_TRIAL.limit_deg + _SLACK_DEG
"""Where all stands, blocks are set back by up to this much, and their steps tell from where."""


@dataclass(frozen=True)
class Ended:
    """What became of a plan that was carried out: its steps, what each of them moved (None where
    that was not kept), the blocks of the goal that were reached, all that stands beside the goal,
    whether that is the whole goal and nothing else, and the engine with its version.
    """

    steps: tuple[ExecutedStep, ...]
    rests: tuple[tuple[Rest, ...] | None, ...]
    reached: int
    iou: float
    completed: bool
    engine: str


def borne_out(
    put: Sequence[Block | None],
    goal: Sequence[Block],
    ended: Ended,
    limits: ExecutionLimits,
    reached: tuple[float, float],
) -> Ended:
    """What became of a plan, where it was kept what each step moved; as it was said where not.

    `put` are the blocks as steps put them; `reached` says how near [cm, degrees] to its place a
    block of the goal is reached.
    """
    rests = [step for step in ended.rests if step is not None]
    if len(rests) != len(put) or len(ended.steps) != len(put):
        return ended
    ends = [_refused(block, step, limits) for block, step in zip(put, ended.steps, strict=True)]
    stays = [step.end not in REFUSED_ENDS for step in ends]
    moved = _lying_alone(stays, rests)
    worlds = worlds_of(put, stays, moved)
    steps = tuple(
        _step(step, number, put[number - 1], worlds[:number][-2:], limits)
        for number, step in enumerate(ends, 1)
    )
    world = worlds[-1] if worlds else ()
    cm, deg = reached
    near, far = (
        blocks_reached(goal, world, max(0.0, cm + by * _SLACK_CM), max(0.0, deg + by * _SLACK_DEG))
        for by in (-1, 1)
    )
    count = ended.reached
    if not near <= count <= far:
        count = blocks_reached(goal, world, cm, deg)
    iou, by_rests = ended.iou, voxel_iou(goal, world)
    if abs(iou - by_rests) > _SLACK_IOU:
        iou = round(by_rests, _IOU_DIGITS)
    return Ended(steps, moved, count, iou, count == len(goal) == len(world), ended.engine)


def _lying_alone(
    stays: Sequence[bool], rests: Sequence[Sequence[Rest]]
) -> tuple[tuple[Rest, ...], ...]:
    """What each step moved, without blocks that were not there."""
    return tuple(
        tuple(rest for rest in moved if 1 <= rest.step <= number and stays[rest.step - 1])
        for number, moved in enumerate(rests, 1)
    )


def _refused(block: Block | None, step: ExecutedStep, limits: ExecutionLimits) -> ExecutedStep:
    """The step, refused where there is no block or no room above the floor, and only there."""
    end: StepEnd = "overlaps" if step.end == "overlaps" else "stands"
    if block is None:
        end = "no_block"
    elif depth_cm(block) > limits.overlap_cm:
        end = "under_floor"
    is_alike = end == step.end or (end == "stands" and step.end not in REFUSED_ENDS)
    return step if is_alike else replace(step, end=end)


def _step(
    step: ExecutedStep,
    number: int,
    block: Block | None,
    worlds: Sequence[Sequence[Block]],
    limits: ExecutionLimits,
) -> ExecutedStep:
    """How a step ended, by the worlds before and after it, of which the first is left out."""
    if block is None or step.end in REFUSED_ENDS:
        return step
    before = _poses(worlds[0]) if len(worlds) > 1 else {}
    after = _poses(worlds[-1])
    way = moved_between(Pose.goal(block), after[number])
    ways = {order: moved_between(pose, after[order]) for order, pose in before.items()}
    knocked = tuple(
        order for order, far in ways.items() if _is_past(far, order in step.knocked, limits)
    )
    is_past = _is_past(way, step.end != "stands", limits)
    end = end_of(knocked, not is_past)
    told = {}
    if abs(step.moved_cm - way[0]) > _SET_BACK_CM:
        told["moved_cm"] = round(way[0], _DIGITS)
    if abs(step.turned_deg - way[1]) > _SET_BACK_DEG:
        told["turned_deg"] = round(way[1], _DIGITS)
    return replace(step, end=end, knocked=knocked, **told)


def _poses(world: Sequence[Block]) -> Mapping[int, Pose]:
    return {block.order: Pose.goal(block) for block in world}


def _is_past(way: tuple[float, float], said: bool, limits: ExecutionLimits) -> bool:
    """Whether a block moved past the limits of standing; as it was said where that is near."""
    allowed = (limits.stand_cm, limits.stand_deg)
    slack = (_SET_BACK_CM, _SET_BACK_DEG)
    if any(far > most + by for far, most, by in zip(way, allowed, slack, strict=True)):
        return True
    if all(far <= most - by for far, most, by in zip(way, allowed, slack, strict=True)):
        return False
    return said
