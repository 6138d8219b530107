"""What a scene must be to enter a data set: within its levels' limits, and physically sound."""

from __future__ import annotations

from phyblock.domain.blocks import KIT_PALETTE
from phyblock.domain.scene import Kind, Scene
from phyblock.errors import DataError, Problem
from phyblock_making.checks.finding import CheckName
from phyblock_making.checks.scene_checks import findings_of
from phyblock_making.checks.scene_facts import SceneFacts
from phyblock_making.checks.tolerances import OURS_IN_HASTE

__all__ = ["accept", "form_problems", "is_acceptable", "physics_problems"]

_FORM: tuple[CheckName, ...] = ("size", "palette", "layer", "order")
# Cheap ones first.
_PHYSICS: tuple[CheckName, ...] = (
    "overlap",
    "floating",
    "undeclared dependency",
    "dependency without contact",
    "unstable step",
    "unstable",
)


def accept(scene: Scene, palette: tuple[Kind, ...] = KIT_PALETTE) -> None:
    """Raise DataError with all that is wrong with a scene; return when nothing is."""
    problems = form_problems(scene, palette) or physics_problems(scene)
    if problems:
        raise DataError(problems)


def form_problems(scene: Scene, palette: tuple[Kind, ...] = KIT_PALETTE) -> tuple[Problem, ...]:
    """What is wrong with the scene's size, palette, layers and order, without physics."""
    return _problems(SceneFacts(scene, palette=palette), _FORM)


def physics_problems(scene: Scene) -> tuple[Problem, ...]:
    """Overlaps, floating blocks, wrong dependencies, and every step that does not stand.

    The finished structure is watched for the whole time of the default trial.
    """
    return _problems(SceneFacts(scene), _PHYSICS)


def is_acceptable(scene: Scene, palette: tuple[Kind, ...]) -> bool:
    """Whether a scene could enter a data set: a quick `accept` that also looks at the picture.

    It ends at the first fault, and a trial ends once all is at rest, at both time steps.
    """
    facts = SceneFacts(scene, tolerances=OURS_IN_HASTE, palette=palette)
    return next(findings_of(facts, (*_FORM, "hidden", *_PHYSICS)), None) is None


def _problems(facts: SceneFacts, names: tuple[CheckName, ...]) -> tuple[Problem, ...]:
    return tuple(finding.problem for finding in findings_of(facts, names))
