"""Built-in baselines: they answer as a model would, in the benchmark's own reply form."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

import numpy as np

from phyblock.domain import LETTERS, Block, CandidateSet
from phyblock.errors import DataError, Problem, SpecError
from phyblock.models.base import (
    ChoiceSubject,
    PlanSubject,
    Reply,
    Request,
    StepSubject,
    Subject,
    Usage,
)
from phyblock.models.config import ModelConfig

__all__ = ["BASELINES", "BaselineModel"]

_RANDOM_STEPS = 4
"""As in the paper's Random row."""

_S = TypeVar("_S", bound=Subject)
Rule = Callable[[_S, np.random.Generator], str]
"""What a baseline answers, in the benchmark's own reply form."""


class BaselineModel:
    """A rule instead of a model.

    What it draws depends on its name, the seed and the request's key alone, not on the order in
    which it is asked. It takes prompts and pictures like any model and does not look at them, so
    that a run of baselines shows that a whole run works.
    """

    needs_messages = True

    def __init__(self, config: ModelConfig) -> None:
        if config.id not in BASELINES:
            allowed = ", ".join(BASELINES)
            problem = Problem(f"model {config.name}", "is no baseline", "", config.id, allowed)
            raise SpecError(problem)
        self.name = config.name
        self._id = config.id

    async def ask(self, request: Request) -> Reply:
        """The rule's answer; DataError when an oracle lacks a candidate.

        Raises SpecError for a subject that the baseline has no rule for.
        """
        rule = BASELINES[self._id].get(type(request.subject))
        if rule is None:
            problem = Problem(f"model {self.name}", "has no rule for this track")
            raise SpecError(problem)
        seed_text = f"{self._id}|{request.seed}|{request.key}"
        digest = hashlib.sha256(seed_text.encode()).digest()
        rng = np.random.default_rng(int.from_bytes(digest, "big"))
        text = rule(request.subject, rng)
        return Reply(text, usage=Usage(0, 0), cost_usd=0.0, provider_model=self._id, attempts=0)

    async def aclose(self) -> None:
        """Nothing is held open."""


def _plan(steps: Iterable[int]) -> str:
    return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(steps, 1))


def _random_plan(subject: PlanSubject, rng: np.random.Generator) -> str:
    return _plan(int(n) for n in rng.integers(1, len(subject.candidates) + 1, _RANDOM_STEPS))


def _all_candidates(subject: PlanSubject, _: np.random.Generator) -> str:
    return _plan(range(1, len(subject.candidates) + 1))


def _oracle_plan(subject: PlanSubject, rng: np.random.Generator) -> str:
    blocks = subject.scene.blocks
    return _plan(_needed(subject, blocks[v]) for v in subject.scene.graph.random_order(rng))


def _unoriented_plan(subject: PlanSubject, rng: np.random.Generator) -> str:
    """A valid order in which every block stands wrongly, wherever a wrong one can be chosen."""
    blocks = subject.scene.blocks
    order = subject.scene.graph.random_order(rng)
    return _plan(
        _turned(subject.candidates, blocks[v], rng) or _needed(subject, blocks[v]) for v in order
    )


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


def _random_step(subject: StepSubject, rng: np.random.Generator) -> str:
    return _step(int(rng.integers(1, len(subject.candidates) + 1)))


def _oracle_step(subject: StepSubject, rng: np.random.Generator) -> str:
    """One of the right moves, so that every valid order can come; Done where there is none."""
    moves = subject.exact or subject.valid
    return _step(moves[int(rng.integers(len(moves)))] if moves else None)


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
    return _step(wrong[int(rng.integers(len(wrong)))] if wrong else index)


def _repeated_step(subject: StepSubject, rng: np.random.Generator) -> str:
    """Any move at random until one fails, then that one for ever."""
    return _random_step(subject, rng) if subject.last_failed is None else _step(subject.last_failed)


def _step(index: int | None) -> str:
    return "Next plan: Done" if index is None else f"Next plan: Move({index})"


def _random_choice(subject: ChoiceSubject, rng: np.random.Generator) -> str:
    n = len(subject.question.options)
    if subject.question.subtask == "OR":
        return _choice(int(index) for index in rng.permutation(n))
    return _choice([int(rng.integers(n))])


def _oracle_choice(subject: ChoiceSubject, _: np.random.Generator) -> str:
    return _choice(subject.question.answer)


def _majority_choice(subject: ChoiceSubject, _: np.random.Generator) -> str:
    return _choice(subject.guesses["majority"])


def _text_choice(subject: ChoiceSubject, _: np.random.Generator) -> str:
    return _choice(subject.guesses["text-only"])


def _choice(indices: Iterable[int]) -> str:
    return "Answer: " + ", ".join(LETTERS[index] for index in indices)


BASELINES: Mapping[str, Mapping[type[Subject], Rule[Any]]] = {
    "random": {
        PlanSubject: _random_plan,
        StepSubject: _random_step,
        ChoiceSubject: _random_choice,
    },
    "all-candidates": {PlanSubject: _all_candidates},
    "oracle": {
        PlanSubject: _oracle_plan,
        StepSubject: _oracle_step,
        ChoiceSubject: _oracle_choice,
    },
    "oracle-no-orientation": {PlanSubject: _unoriented_plan, StepSubject: _unoriented_step},
    "repeat": {StepSubject: _repeated_step},
    "majority": {ChoiceSubject: _majority_choice},
    "text-only": {ChoiceSubject: _text_choice},
}
"""Baselines by name, each with its rule for every subject that it knows."""
