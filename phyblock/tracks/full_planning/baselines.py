"""What baselines answer where a whole plan is asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from phyblock.domain import Block, CandidateSet, Plan, Scene
from phyblock.errors import DataError, Problem

__all__ = ["PLAN_FLOORS", "PLAN_RULES", "PlanSubject", "plan_text"]

_RANDOM_STEPS = 4
"""As in the paper's Random row."""


@dataclass(frozen=True)
class PlanSubject:
    """A whole plan is asked for; `guess` gives one that was learned without the goal."""

    scene: Scene
    candidates: CandidateSet
    guess: Callable[[], Plan] = field(default=Plan, compare=False)


def plan_text(steps: Iterable[int]) -> str:
    """A plan in the benchmark's own reply form."""
    return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(steps, 1))


def _random_plan(subject: PlanSubject, rng: np.random.Generator) -> str:
    return plan_text(int(n) for n in rng.integers(1, len(subject.candidates) + 1, _RANDOM_STEPS))


def _all_candidates(subject: PlanSubject, _: np.random.Generator) -> str:
    return plan_text(range(1, len(subject.candidates) + 1))


def _oracle_plan(subject: PlanSubject, rng: np.random.Generator) -> str:
    blocks = subject.scene.blocks
    return plan_text(_needed(subject, blocks[v]) for v in subject.scene.graph.random_order(rng))


def _unoriented_plan(subject: PlanSubject, rng: np.random.Generator) -> str:
    """A valid order in which every block stands wrongly, wherever a wrong one can be chosen."""
    blocks = subject.scene.blocks
    order = subject.scene.graph.random_order(rng)
    return plan_text(
        _turned(subject.candidates, blocks[v], rng) or _needed(subject, blocks[v]) for v in order
    )


def _first_poses(subject: PlanSubject, rng: np.random.Generator) -> str:
    """A valid order of the right kinds, of each kind the pose that is listed first."""
    blocks = subject.scene.blocks
    order = subject.scene.graph.random_order(rng)
    first = subject.candidates.first_of
    return plan_text(first(blocks[v].kind) or _needed(subject, blocks[v]) for v in order)


def _goal_blind(subject: PlanSubject, _: np.random.Generator) -> str:
    return plan_text(subject.guess().steps)


def _needed(subject: PlanSubject, block: Block) -> int:
    index = subject.candidates.index_of(block.look)
    if index is None:
        found = f"{block.color} {block.type} turned {block.euler_deg}"
        where = f"scene {subject.scene.id}"
        message = "no candidate looks like this block"
        raise DataError(Problem(where, message, f"blocks[order={block.order}]", found))
    return index


def _turned(candidates: CandidateSet, block: Block, rng: np.random.Generator) -> int | None:
    """Number of a candidate of the block's kind that looks otherwise, or None."""
    numbers = range(1, len(candidates) + 1)
    wrong = [
        n for n in numbers if candidates[n].kind == block.kind and candidates[n].look != block.look
    ]
    return wrong[int(rng.integers(len(wrong)))] if wrong else None


PLAN_RULES = {
    "random": _random_plan,
    "all-candidates": _all_candidates,
    "goal-blind": _goal_blind,
    "first-pose": _first_poses,
    "oracle": _oracle_plan,
    "oracle-no-orientation": _unoriented_plan,
}
"""Rules by name of the baseline."""
PLAN_FLOORS = ("goal-blind", "all-candidates", "random")
"""Those that never see the goal."""
