"""What a scene must be to enter a data set: within its levels' limits, and physically sound."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from phyblock.domain.blocks import KIT_PALETTE
from phyblock.domain.scene import Kind, Scene
from phyblock.errors import DataError, Problem
from phyblock.sim.stability import DEFAULT_TRIAL, Trial, check
from phyblock.sim.steps import Rest, check_at_rest, check_steps
from phyblock.sim.support import GROUND, find_gaps, find_overlaps, support_graph

__all__ = [
    "FINISHED_REST",
    "LEVEL_LIMITS",
    "PREFIX_TRIAL",
    "Limits",
    "accept",
    "form_problems",
    "is_sound",
    "physics_problems",
]

PREFIX_TRIAL = replace(DEFAULT_TRIAL, physics=DEFAULT_TRIAL.physics[:1])
"""Every prefix is tried at the first of the two time steps, for two seconds or until at rest."""
FINISHED_REST = Rest(quiet_s=0.5)
"""When the generator takes a finished structure to be at rest."""


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


def accept(scene: Scene, palette: tuple[Kind, ...] = KIT_PALETTE) -> None:
    """Raise DataError with all that is wrong with a scene; return when nothing is."""
    problems = form_problems(scene, palette) or physics_problems(scene)
    if problems:
        raise DataError(problems)


def form_problems(scene: Scene, palette: tuple[Kind, ...] = KIT_PALETTE) -> tuple[Problem, ...]:
    """What is wrong with the scene's size, palette, layers and order, without physics."""
    found: list[Problem] = []
    for level in scene.levels:
        limits, layers = LEVEL_LIMITS[level], max(scene.graph.layers, default=0)
        if not limits.least_blocks <= len(scene) <= limits.most_blocks:
            allowed = f"{limits.least_blocks} to {limits.most_blocks} at level {level}"
            found.append(Problem(scene.id, "wrong size", "blocks", str(len(scene)), allowed))
        if layers > limits.most_layers:
            allowed = f"at most {limits.most_layers} at level {level}"
            found.append(Problem(scene.id, "too high", "layers", str(layers), allowed))
    for block, layer in zip(scene.blocks, scene.graph.layers, strict=True):
        where = f"blocks[{block.order}]"
        if block.kind not in palette:
            found.append(Problem(scene.id, "not in the palette", where, str(block.kind)))
        if block.layer != layer:
            message = "is not the longest path from the ground"
            found.append(Problem(scene.id, message, f"{where}.layer", str(block.layer), str(layer)))
    if not scene.graph.is_valid(range(len(scene))):
        found.append(Problem(scene.id, "the stored order puts a block before its support"))
    return tuple(found)


def physics_problems(
    scene: Scene, trial: Trial = DEFAULT_TRIAL, prefix_trial: Trial = PREFIX_TRIAL
) -> tuple[Problem, ...]:
    """Overlaps, floating blocks, wrong dependencies, and every step that does not stand.

    The finished structure is watched for the whole time of `trial`.
    """
    return tuple(_physics_problems(scene, trial, prefix_trial, None))


def is_sound(scene: Scene) -> bool:
    """A quick `physics_problems`: ends at the first, and a trial ends once all is at rest.

    At rest is the finished structure as in `FINISHED_REST`, at both time steps.
    """
    found = _physics_problems(scene, DEFAULT_TRIAL, PREFIX_TRIAL, FINISHED_REST)
    return next(found, None) is None


def _physics_problems(
    scene: Scene, trial: Trial, prefix_trial: Trial, rest: Rest | None
) -> Iterator[Problem]:
    """Cheap checks first."""
    blocks = scene.blocks
    for o in find_overlaps(blocks):
        message = f"overlaps block {o.second} by {o.depth_m * 1000:.2f} mm"
        yield Problem(scene.id, message, _at(o.first))
    for gap in find_gaps(blocks):
        message = f"floats {gap.height_m * 1000:.2f} mm above its support"
        yield Problem(scene.id, message, _at(gap.order))
    below = support_graph(blocks)
    for block in blocks:
        rests_on = sorted(below[block.order] - {GROUND})
        if rests_on != sorted(block.depend):
            field = f"{_at(block.order)}.depend"
            found, allowed = str(block.depend), str(rests_on)
            yield Problem(scene.id, "differs from contact", field, found, allowed)
    for count, step in enumerate(check_steps(blocks, prefix_trial), 1):
        if not step.stable:
            yield Problem(scene.id, f"blocks {step.fallen} fall at step {count}")
    whole = check(blocks, trial) if rest is None else check_at_rest(blocks, trial, rest)
    if not whole.stable:
        yield Problem(scene.id, f"blocks {whole.fallen} fall when it is finished")


def _at(order: int) -> str:
    return "ground" if order == GROUND else f"blocks[{order}]"
