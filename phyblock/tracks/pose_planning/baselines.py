"""What baselines answer where a plan with poses is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from phyblock.domain import Block, CandidateSet, PoseStep, Scene
from phyblock.errors import DataError, Problem
from phyblock.sim.geometry import box_height_cm, center_cm

__all__ = ["POSE_FLOORS", "POSE_RULES", "PoseSubject"]

_RANDOM_STEPS = 4
_RANDOM_REACH_CM = 15.0


@dataclass(frozen=True)
class PoseSubject:
    """A plan with poses is asked for; with `is_free` its steps bring a rotation."""

    scene: Scene
    candidates: CandidateSet
    is_free: bool


Center = tuple[float, float, float]


def written(steps: Iterable[PoseStep]) -> str:
    """Steps in the form that the prompt asks for."""
    return "\n".join(f"Step{n}: {_line(step)}" for n, step in enumerate(steps, 1))


def _line(step: PoseStep) -> str:
    turned = "" if step.euler_deg is None else f" turned ({_numbers(step.euler_deg)})"
    return f"block {step.candidate} at ({_numbers(step.center_cm)}){turned}"


def _numbers(values: Sequence[float]) -> str:
    return ", ".join(f"{round(value, 4) + 0.0:g}" for value in values)


def _built(
    subject: PoseSubject,
    rng: np.random.Generator,
    move: Callable[[Block, Center], Center] = lambda _, center: center,
) -> str:
    """The goal's blocks in a random valid order, each moved from its true place.

    Layer by layer where that is in balance, else as near to it as is: a balance of which one arm is
    loaded to its top before the other topples, though the order is a valid one.
    """
    blocks, layers = subject.scene.blocks, subject.scene.graph.layers
    drawn = rng.random(len(blocks)).tolist()
    wanted = sorted(range(len(blocks)), key=lambda vertex: (layers[vertex], drawn[vertex]))
    # It needs scipy, which takes a while to import: only those who build pay for it.
    from phyblock.tracks.pose_planning.buildable import buildable_order

    order = buildable_order(subject.scene, wanted)
    return written(_step(subject, blocks[v], move(blocks[v], center_cm(blocks[v]))) for v in order)


def _step(subject: PoseSubject, block: Block, center: Center) -> PoseStep:
    candidates = subject.candidates
    if subject.is_free:
        number, euler = candidates.first_of(block.kind), block.euler_deg
        if number is not None:
            return PoseStep(number, center, euler)
    elif (number := candidates.index_of(block.look)) is not None:
        return PoseStep(number, center)
    where, field = f"scene {subject.scene.id}", f"blocks[order={block.order}]"
    found = f"{block.color} {block.type} turned {block.euler_deg}"
    raise DataError(Problem(where, "no candidate looks like this block", field, found))


def _oracle(subject: PoseSubject, rng: np.random.Generator) -> str:
    return _built(subject, rng)


def _noisy(sigma_cm: float) -> Callable[[PoseSubject, np.random.Generator], str]:
    """The oracle, every coordinate off by a Gaussian of so many centimeters."""

    def rule(subject: PoseSubject, rng: np.random.Generator) -> str:
        noise = np.random.default_rng(rng.integers(2**32))

        def moved(_: Block, center: Center) -> Center:
            x, y, z = np.array(center) + noise.normal(0.0, sigma_cm, 3)
            return float(x), float(y), float(z)

        return _built(subject, rng, moved)

    return rule


def _flat(subject: PoseSubject, rng: np.random.Generator) -> str:
    """Right sideways, all on the floor."""
    return _built(subject, rng, lambda block, center: (*center[:2], box_height_cm(block) / 2))


def _stack(subject: PoseSubject, rng: np.random.Generator) -> str:
    """All at the origin, one on another."""
    top = 0.0

    def stacked(block: Block, _: Center) -> Center:
        nonlocal top
        height = box_height_cm(block)
        top += height
        return 0.0, 0.0, top - height / 2

    return _built(subject, rng, stacked)


def _random(subject: PoseSubject, rng: np.random.Generator) -> str:
    """Any blocks anywhere, which sees nothing of the goal."""
    steps = []
    for _ in range(_RANDOM_STEPS):
        number = int(rng.integers(1, len(subject.candidates) + 1))
        x, y = rng.uniform(-_RANDOM_REACH_CM, _RANDOM_REACH_CM, 2)
        z = rng.uniform(0.0, _RANDOM_REACH_CM)
        turns = [90.0 * float(turn) for turn in rng.integers(0, 4, 3)]
        euler = (turns[0], turns[1], turns[2]) if subject.is_free else None
        steps.append(PoseStep(number, (float(x), float(y), float(z)), euler))
    return written(steps)


POSE_RULES = {
    "random": _random,
    "oracle": _oracle,
    "oracle-noise-1mm": _noisy(0.1),
    "oracle-noise-3mm": _noisy(0.3),
    "oracle-noise-1cm": _noisy(1.0),
    "oracle-2d": _flat,
    "stack": _stack,
}
"""Rules by name of the baseline."""
POSE_FLOORS = ("random",)
"""Those that never see the goal."""
