"""What a suite says of the pose-planning track: the section `pose`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, get_args

from pydantic import AfterValidator, Discriminator, Field, Tag

from phyblock.config.validation import PictureControls, Section, TemplateName, UniqueSome, refuse
from phyblock.sim.dynamics import ExecutionLimits
from phyblock.types import PoseRotation, View

__all__ = ["MOST_VIEWS", "PoseSpec", "ViewSpec"]

_LIMITS = ExecutionLimits()
MOST_VIEWS = 4


class ViewSpec(Section):
    """A direction to see the goal from."""

    azimuth_deg: Annotated[float, Field(strict=True, ge=-360, le=360, allow_inf_nan=False)] = Field(
        description="0 looks from +x, 90 from +y [degrees]."
    )
    elevation_deg: Annotated[float, Field(strict=True, ge=1, le=90, allow_inf_nan=False)] = Field(
        description="90 looks straight down [degrees]."
    )


def _kind(view: object) -> str:
    """What a view is meant as, so that it is said to be wrong as that alone."""
    return "direction" if isinstance(view, Mapping | ViewSpec) else "name"


AnyView = Annotated[
    Annotated[View, Tag("name")] | Annotated[ViewSpec, Tag("direction")], Discriminator(_kind)
]


def _check_few(views: tuple[View | ViewSpec, ...]) -> tuple[View | ViewSpec, ...]:
    if len(views) <= MOST_VIEWS:
        return views
    raise refuse(f"has {len(views)} views", allowed=f"1 to {MOST_VIEWS}")


Tolerance = Annotated[float, Field(strict=True, gt=0, le=10, allow_inf_nan=False)]
Angle = Annotated[float, Field(strict=True, gt=0, le=90, allow_inf_nan=False)]


class PoseSpec(PictureControls):
    """How poses are asked for in the pose_planning track, and how plans are carried out."""

    rotation: PoseRotation = Field(
        default="candidate",
        description="candidate: blocks keep the orientation in which they are shown, and steps "
        "give a number and a place. free: each kind is shown once, upright, and steps give a "
        "rotation as well.",
    )
    views: Annotated[
        UniqueSome[AnyView],
        AfterValidator(_check_few),
        Field(max_length=MOST_VIEWS),
    ] = Field(
        default=("oblique", "top"),
        description="Where the goal is seen from, a picture each, 1 to 4 of them: "
        f"{', '.join(get_args(View))}, or an azimuth_deg and elevation_deg. Blocks are shown from "
        "where the first one is.",
    )
    overlap_cm: Tolerance = Field(
        default=_LIMITS.overlap_cm,
        description="A block that shares space with others is moved out of them by so much at "
        "most; one that would need more is refused [cm].",
    )
    stand_cm: Tolerance = Field(
        default=_LIMITS.stand_cm,
        description="A block that moves farther when it is let go has fallen, or was knocked over "
        "by another [cm].",
    )
    stand_deg: Angle = Field(
        default=_LIMITS.stand_deg, description="The same for how far it turns [degrees]."
    )
    reached_cm: Tolerance = Field(
        default=1.0,
        description="A block of the goal is reached where one of its kind lies so near in the end "
        "[cm].",
    )
    reached_deg: Angle = Field(default=10.0, description="The same for how it is turned [degrees].")
    prompt: TemplateName = Field(
        default="default", description="default, or the path of a .j2 template."
    )
