"""What baselines answer where the next step is asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from phyblock.domain import CandidateSet, Plan, Scene

__all__ = ["STEP_FLOORS", "STEP_RULES", "StepSubject", "step_text"]


@dataclass(frozen=True)
class StepSubject:
    """The next step is asked for.

    `valid` are the candidates that would be placed now, in ascending order; empty when the goal
    is complete. `exact` are those of them that are also turned as the goal is. `last_failed` is
    the candidate whose move failed last, if the last move did; `step` is how many steps were taken.
    `guess` gives a plan that was learned without the goal.
    """

    scene: Scene
    candidates: CandidateSet
    valid: tuple[int, ...]
    exact: tuple[int, ...]
    last_failed: int | None = None
    step: int = 0
    guess: Callable[[], Plan] = field(default=Plan, compare=False)


def _random_step(subject: StepSubject, rng: np.random.Generator) -> str:
    return step_text(int(rng.integers(1, len(subject.candidates) + 1)))


def _oracle_step(subject: StepSubject, rng: np.random.Generator) -> str:
    """One of the right moves, so that every valid order can come; Done where there is none."""
    moves = subject.exact or subject.valid
    return step_text(moves[int(rng.integers(len(moves)))] if moves else None)


def _unoriented_step(subject: StepSubject, rng: np.random.Generator) -> str:
    """A right move, but with the block turned wrongly wherever there is such a candidate."""
    index = subject.exact[int(rng.integers(len(subject.exact)))] if subject.exact else None
    if index is None:
        return _oracle_step(subject, rng)
    kind, candidates = subject.candidates[index].kind, subject.candidates
    looks = {block.look for block in subject.scene.blocks}
    wrong = [
        n
        for n in range(1, len(candidates) + 1)
        if candidates[n].kind == kind and candidates[n].look not in looks
    ]
    return step_text(wrong[int(rng.integers(len(wrong)))] if wrong else index)


def _repeated_step(subject: StepSubject, rng: np.random.Generator) -> str:
    """Any move at random until one fails, then that one for ever."""
    return (
        _random_step(subject, rng)
        if subject.last_failed is None
        else step_text(subject.last_failed)
    )


def _next_candidate(subject: StepSubject, _: np.random.Generator) -> str:
    """Every candidate once, in their order."""
    return step_text(subject.step + 1 if subject.step < len(subject.candidates) else None)


def _next_guess(subject: StepSubject, _: np.random.Generator) -> str:
    plan = subject.guess().steps
    return step_text(plan[subject.step] if subject.step < len(plan) else None)


def _first_pose(subject: StepSubject, rng: np.random.Generator) -> str:
    """The kind of a right move, in the pose of it that is listed first."""
    if not subject.exact:
        return _oracle_step(subject, rng)
    index = subject.exact[int(rng.integers(len(subject.exact)))]
    return step_text(subject.candidates.first_of(subject.candidates[index].kind))


def step_text(index: int | None) -> str:
    """One operation in the benchmark's own reply form; None is the end."""
    return "Next plan: Done" if index is None else f"Next plan: Move({index})"


STEP_RULES = {
    "random": _random_step,
    "oracle": _oracle_step,
    "oracle-no-orientation": _unoriented_step,
    "repeat": _repeated_step,
    "all-candidates": _next_candidate,
    "goal-blind": _next_guess,
    "first-pose": _first_pose,
}
"""Rules by name of the baseline."""
STEP_FLOORS = ("goal-blind", "all-candidates", "random", "repeat")
"""Those that never see the goal."""
