"""The checks of a scene by itself: each takes a scene and yields what is wrong with it.

`phyblock_making.checks.acceptance` asks them before a scene enters a data set,
`phyblock_making.auditing.set_verification` afterwards, of what was stored.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from phyblock.domain.scene import Kind, Scene
from phyblock.errors import Problem
from phyblock.sim.stability import DEFAULT_TRIAL, Trial, check
from phyblock.sim.steps import Rest, check_at_rest, check_steps
from phyblock.sim.support import GROUND, find_gaps, find_overlaps, support_graph

__all__ = [
    "LEVEL_LIMITS",
    "STEP_TRIAL",
    "Limits",
    "dependency_problems",
    "finished_problems",
    "gap_problems",
    "layer_problems",
    "order_problems",
    "overlap_problems",
    "palette_problems",
    "size_problems",
    "step_problems",
]

STEP_TRIAL = replace(DEFAULT_TRIAL, physics=DEFAULT_TRIAL.physics[:1])
"""Every step is tried at the first of the two time steps, for two seconds or until at rest."""


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


def size_problems(scene: Scene) -> Iterator[Problem]:
    """More or fewer blocks, or more layers, than a level of the scene allows."""
    layers = max(scene.graph.layers, default=0)
    for level in scene.levels:
        limits = LEVEL_LIMITS[level]
        if not limits.least_blocks <= len(scene) <= limits.most_blocks:
            allowed = f"{limits.least_blocks} to {limits.most_blocks} at level {level}"
            yield Problem(scene.id, "wrong size", "blocks", str(len(scene)), allowed)
        if layers > limits.most_layers:
            allowed = f"at most {limits.most_layers} at level {level}"
            yield Problem(scene.id, "too high", "layers", str(layers), allowed)


def palette_problems(scene: Scene, palette: Sequence[Kind]) -> Iterator[Problem]:
    """Blocks whose pair of type and color is not in the palette."""
    for i, block in enumerate(scene.blocks):
        if block.kind not in palette:
            yield Problem(scene.id, "not in the palette", f"blocks[{i}]", " ".join(block.kind))


def layer_problems(scene: Scene) -> Iterator[Problem]:
    """Layers that are not the longest path from the ground."""
    for i, (block, layer) in enumerate(zip(scene.blocks, scene.graph.layers, strict=True)):
        if block.layer != layer:
            message, field = "is not the longest path", f"blocks[{i}].layer"
            yield Problem(scene.id, message, field, str(block.layer), str(layer))


def order_problems(scene: Scene) -> Iterator[Problem]:
    """A stored order that cannot be built."""
    if not scene.graph.is_valid(range(len(scene))):
        yield Problem(scene.id, "the stored order puts a block before its support", "blocks")


def overlap_problems(scene: Scene) -> Iterator[Problem]:
    """Blocks that share space, with one another or with the ground."""
    for one in find_overlaps(scene.blocks):
        other = "the ground" if one.first == GROUND else f"block {one.first}"
        depth = f"{one.depth_m * 1000:.2f} mm"
        yield Problem(scene.id, f"block {one.second} overlaps {other} by {depth}")


def gap_problems(scene: Scene) -> Iterator[Problem]:
    """Blocks that hang above what is below them."""
    for gap in find_gaps(scene.blocks):
        height = f"{gap.height_m * 1000:.2f} mm"
        yield Problem(scene.id, f"block {gap.order} floats {height} above its support")


def dependency_problems(scene: Scene) -> Iterator[Problem]:
    """Declared dependencies that are not the contacts that carry."""
    below = support_graph(scene.blocks)
    for i, block in enumerate(scene.blocks):
        touched = below[block.order]
        if not touched or touched - {GROUND} != set(block.depend):
            field, found = f"blocks[{i}].depend", str(list(block.depend) or [GROUND])
            allowed = str(sorted(touched - {GROUND}) or [GROUND]) if touched else ""
            message = "differs from the contacts" if touched else "touches nothing below it"
            yield Problem(scene.id, message, field, found, allowed)


def step_problems(scene: Scene) -> Iterator[Problem]:
    """Steps of the stored order after which something falls, tried as in `STEP_TRIAL`."""
    for count, step in enumerate(check_steps(scene.blocks, STEP_TRIAL), 1):
        if not step.stable:
            yield Problem(scene.id, f"{_falling(step.fallen)} at step {count}")


def finished_problems(
    scene: Scene, trial: Trial = DEFAULT_TRIAL, rest: Rest | None = None
) -> Iterator[Problem]:
    """What falls from the finished structure, watched to the end or until it is at rest."""
    blocks = scene.blocks
    whole = check(blocks, trial) if rest is None else check_at_rest(blocks, trial, rest)
    if not whole.stable:
        yield Problem(scene.id, f"{_falling(whole.fallen)} when all is built")


def _falling(orders: Sequence[int]) -> str:
    named = ", ".join(map(str, orders))
    return f"blocks {named} fall" if len(orders) > 1 else f"block {named} falls"
