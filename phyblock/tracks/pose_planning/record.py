"""What the pose-planning track adds to a record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from phyblock.records import Course, Line, Record
from phyblock.records.line import Amount, Whole
from phyblock.scoring.pose import PoseError
from phyblock.tracks.plans import PLAN_COLUMNS, PlanParse, plan_row
from phyblock.tracks.pose_planning.resting import Rest
from phyblock.types import PoseRotation, StepEnd

__all__ = [
    "CarryTolerances",
    "GivenStep",
    "PoseOutcome",
    "PoseParse",
    "PoseRecord",
    "RestingBlock",
    "StepOutcome",
    "kept_rests",
]


class GivenStep(Line):
    """A step as it was read."""

    block: int
    """Number of the candidate, as it was shown."""
    center_cm: tuple[Amount, Amount, Amount]
    """x, y and z of the middle of the block's box [cm]."""
    euler_deg: tuple[Amount, Amount, Amount] | None = None
    """Its rotation, extrinsic x-y-z angles [degrees]; null: as the candidate is shown."""


class PoseParse(PlanParse):
    """The plan with poses that was read in a reply; `plan` leaves out numbers that no candidate
    has.
    """

    steps: tuple[GivenStep, ...] = ()
    """The steps with their poses, those included that name no candidate."""


class CarryTolerances(Line):
    """By what a plan was judged when it was carried out."""

    overlap_cm: Amount
    """Farthest that a block was moved out of others [cm]."""
    stand_cm: Amount
    """Farthest that a block moved and still stood [cm]."""
    stand_deg: Amount
    """Farthest that it turned [degrees]."""
    reached_cm: Amount
    """Farthest from its place that a block of the goal was reached [cm]."""
    reached_deg: Amount
    """Farthest that it was turned [degrees]."""


class RestingBlock(Line):
    """Where a block came to lie."""

    step: Whole
    """Number of the step, from 1, that put it."""
    center_cm: tuple[Amount, Amount, Amount]
    """x, y and z of the middle of its box [cm]."""
    euler_deg: tuple[Amount, Amount, Amount]
    """Its rotation, extrinsic x-y-z angles [degrees]."""


class StepOutcome(Line):
    """What a step is worth by geometry, and how it ended when it was carried out."""

    vertex: Whole | None
    """The goal block, from 0, that it stands for; null: none."""
    position_cm: Amount | None = None
    """How far its center of mass is from that block's [cm]."""
    sideways_cm: Amount | None = None
    """The same over the floor [cm]."""
    up_cm: Amount | None = None
    """The same in height, above zero where it is too high [cm]."""
    turn_deg: Amount | None = None
    """How far it is turned, up to the block's symmetry [degrees]."""
    iou: Amount | None = None
    """Volume that both share, of the volume of both together."""
    end: StepEnd
    """How it ended."""
    moved_cm: Amount = 0.0
    """How far the block came to lie from where it was to be [cm]."""
    turned_deg: Amount = 0.0
    """How far it was turned [degrees]."""
    gap_cm: Amount = 0.0
    """How far it was above what it would fall on when it was let go [cm]."""
    overlap_cm: Amount = 0.0
    """How far it was moved out of others, or how deep it was refused [cm]."""
    knocked: tuple[Whole, ...] = ()
    """Numbers of the steps, from 1, whose blocks it moved."""
    error: PoseError | None = None
    """What was wrong, null where nothing was."""
    rests: tuple[RestingBlock, ...] | None = None
    """The blocks that lie elsewhere after it than before, its own than where it was put, by more
    than 1 mm or 1 degree; null: not kept."""


def kept_rests(step: StepOutcome) -> tuple[Rest, ...] | None:
    """What a step moved, None where that was not kept."""
    if step.rests is None:
        return None
    return tuple(Rest(one.step, one.center_cm, one.euler_deg) for one in step.rests)


class PoseOutcome(Line):
    """What a plan with poses is worth."""

    rotation: PoseRotation
    """Whether candidates keep their orientation or steps bring one."""
    right: dict[str, tuple[Whole, ...]]
    """By frame, `absolute` or `aligned`: right steps within 0.5, 1, 2 and 4 cm."""
    shift_cm: tuple[Amount, Amount]
    """The shift that aligns it, after the turn [cm]."""
    turn_deg: Amount
    """The turn about the vertical that aligns it [degrees]."""
    steps: tuple[StepOutcome, ...]
    """What became of each step."""
    reached: Whole
    """Blocks of the goal that stand where they should in the end."""
    iou: Amount
    """Intersection over union of all that stands and the goal, in voxels of 5 mm by 64 points."""
    completed: bool
    """Whether all of the goal was reached, and nothing else lies about."""
    limits: CarryTolerances
    """The tolerances."""
    engine: str
    """The physics engine, with its version."""


class PoseRecord(Record):
    """A plan with poses for a scene."""

    track: Literal["pose_planning"]
    """`pose_planning`."""
    parse: PoseParse | None = None
    """The plan that was read."""
    pose: PoseOutcome | None = None
    """What it is worth."""

    columns: ClassVar[Mapping[str, str]] = PLAN_COLUMNS

    def row(self) -> Mapping[str, Any]:
        """The plan in both numberings."""
        return plan_row(self.parse, self.shown)

    def course(self, matcher: str) -> Course | None:
        """What was wrong with each step, and how many blocks of the goal were not reached."""
        if self.pose is None or self.parse is None:
            return super().course(matcher)
        names = (str(step.block) for step in self.parse.steps)
        errors = (step.error for step in self.pose.steps)
        blocks = next((score.tp + score.fn for score in self.scores), self.pose.reached)
        return Course(tuple(zip(names, errors, strict=True)), blocks - self.pose.reached)
