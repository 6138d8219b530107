"""What a scene must be to enter a data set: within its levels' limits, and physically sound."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

from phyblock.domain.blocks import KIT_PALETTE
from phyblock.domain.scene import Kind, Scene
from phyblock.errors import DataError, Problem
from phyblock.sim.steps import Rest
from phyblock_making.checks.scene_checks import (
    dependency_problems,
    finished_problems,
    gap_problems,
    layer_problems,
    order_problems,
    overlap_problems,
    palette_problems,
    size_problems,
    step_problems,
)

__all__ = ["FINISHED_REST", "accept", "form_problems", "is_sound", "physics_problems"]

FINISHED_REST = Rest(quiet_s=0.5)
"""When the generator takes a finished structure to be at rest."""


def accept(scene: Scene, palette: tuple[Kind, ...] = KIT_PALETTE) -> None:
    """Raise DataError with all that is wrong with a scene; return when nothing is."""
    problems = form_problems(scene, palette) or physics_problems(scene)
    if problems:
        raise DataError(problems)


def form_problems(scene: Scene, palette: tuple[Kind, ...] = KIT_PALETTE) -> tuple[Problem, ...]:
    """What is wrong with the scene's size, palette, layers and order, without physics."""
    return (
        *size_problems(scene),
        *palette_problems(scene, palette),
        *layer_problems(scene),
        *order_problems(scene),
    )


def physics_problems(scene: Scene) -> tuple[Problem, ...]:
    """Overlaps, floating blocks, wrong dependencies, and every step that does not stand.

    The finished structure is watched for the whole time of the default trial.
    """
    return tuple(_physics_problems(scene, None))


def is_sound(scene: Scene) -> bool:
    """A quick `physics_problems`: ends at the first, and a trial ends once all is at rest.

    At rest is the finished structure as in `FINISHED_REST`, at both time steps.
    """
    return next(_physics_problems(scene, FINISHED_REST), None) is None


def _physics_problems(scene: Scene, rest: Rest | None) -> Iterator[Problem]:
    """Cheap checks first; each runs only when the ones before it are used up."""
    checks = (overlap_problems, gap_problems, dependency_problems, step_problems)
    yield from chain.from_iterable(find(scene) for find in checks)
    yield from finished_problems(scene, rest=rest)
