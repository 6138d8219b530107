"""Every tolerance and limit that a scene is held to, once."""

from __future__ import annotations

from dataclasses import dataclass, replace

from phyblock.sim.pictures import PictureStyle
from phyblock.sim.stability import DEFAULT_TRIAL, Trial
from phyblock.sim.steps import Rest
from phyblock.sim.support import FIT_TOLERANCE_M
from phyblock.sim.visibility import LEAST_SHOWN

__all__ = [
    "FINISHED_REST",
    "FOREIGN",
    "LEVEL_LIMITS",
    "OURS",
    "OURS_IN_HASTE",
    "STEP_TRIAL",
    "VIEW",
    "Limits",
    "Tolerances",
]

VIEW = PictureStyle(size_px=256)
"""How the goal picture is drawn to see which blocks show in it."""

STEP_TRIAL = replace(DEFAULT_TRIAL, physics=DEFAULT_TRIAL.physics[:1])
"""Every step is tried at the first of the two time steps, for two seconds or until at rest."""

FINISHED_REST = Rest(quiet_s=0.5)
"""When the generator takes a finished structure to be at rest."""


@dataclass(frozen=True)
class Tolerances:
    """What passes: overlaps and gaps up to `fit_m` [m], movement within the limits of the trials.

    `trial` is that of the finished structure, which is watched to its end, or until it is at rest
    as `rest` says; `step_trial` that of every step, `last_step` whether of the last step, too.
    Of every block at least the share `shown` of its outline shows in the goal picture.
    """

    fit_m: float = FIT_TOLERANCE_M
    trial: Trial = DEFAULT_TRIAL
    step_trial: Trial = STEP_TRIAL
    rest: Rest | None = None
    last_step: bool = True
    shown: float = LEAST_SHOWN


OURS = Tolerances()
"""For scenes made here."""

OURS_IN_HASTE = Tolerances(rest=FINISHED_REST)
"""For scenes that are being made: the same, but a trial ends once all is at rest."""

# The last step of a foreign scene is left to the trial of the finished structure: what falls there
# shall be told once. 2 mm cannot be seen in a picture.
FOREIGN = Tolerances(fit_m=0.002, last_step=False)
"""For scenes made elsewhere, whose positions are written by hand in rounded millimeters."""


@dataclass(frozen=True)
class Limits:
    """How many blocks and layers a level allows (paper section 3.1)."""

    least_blocks: int
    most_blocks: int
    most_layers: int


LEVEL_LIMITS: dict[int, Limits] = {
    1: Limits(1, 4, 4),
    2: Limits(2, 5, 3),
    3: Limits(6, 12, 8),
    4: Limits(13, 22, 8),
}
