"""What a scene must be to enter a data set: within its levels' limits, and physically sound."""

from __future__ import annotations

from phyblock.domain.scene import Kind, Scene
from phyblock.making.checks.finding import CheckName
from phyblock.making.checks.scene_checks import findings_of
from phyblock.making.checks.scene_facts import SceneFacts
from phyblock.making.checks.tolerances import OURS_IN_HASTE

__all__ = ["FORM", "PHYSICS", "is_acceptable"]

FORM: tuple[CheckName, ...] = ("size", "palette", "layer", "order")
"""Checks without physics."""
# Cheap ones first.
PHYSICS: tuple[CheckName, ...] = (
    "overlap",
    "floating",
    "undeclared dependency",
    "dependency without contact",
    "unstable step",
    "unstable",
)
"""Overlaps, floating blocks, wrong dependencies, and what does not stand."""


def is_acceptable(scene: Scene, palette: tuple[Kind, ...]) -> bool:
    """Whether a scene could enter a data set, each of its blocks to be seen in the goal picture.

    It ends at the first fault, and a trial ends once all is at rest, at both time steps.
    """
    facts = SceneFacts(scene, tolerances=OURS_IN_HASTE, palette=palette)
    return next(findings_of(facts, (*FORM, "hidden", *PHYSICS)), None) is None
