"""The acceptance test of scenes, with the long trial and our own tolerances."""

from __future__ import annotations

from phyblock.domain import KIT_PALETTE, Scene
from phyblock.domain.scene import Kind
from phyblock.errors import DataError, Problem
from phyblock.making.checks import FORM, PHYSICS, SceneFacts, findings_of


def accept(scene: Scene, palette: tuple[Kind, ...] = KIT_PALETTE) -> None:
    problems = form_problems(scene, palette) or physics_problems(scene)
    if problems:
        raise DataError(problems)


def form_problems(scene: Scene, palette: tuple[Kind, ...] = KIT_PALETTE) -> tuple[Problem, ...]:
    facts = SceneFacts(scene, palette=palette)
    return tuple(finding.problem for finding in findings_of(facts, FORM))


def physics_problems(scene: Scene) -> tuple[Problem, ...]:
    return tuple(finding.problem for finding in findings_of(SceneFacts(scene), PHYSICS))
