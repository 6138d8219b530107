"""Built-in baselines: they answer as a model would, in the benchmark's own reply form."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from phyblock.domain import Block, CandidateSet
from phyblock.errors import DataError, Problem, SpecError
from phyblock.models.base import Reply, Request, Usage
from phyblock.models.config import ModelConfig

__all__ = ["BASELINES", "BaselineModel"]

_RANDOM_STEPS = 4
"""As in the paper's Random row."""

Baseline = Callable[[Request, np.random.Generator], Iterable[int]]


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
        """The baseline's steps; DataError when an oracle lacks a candidate."""
        seed_text = f"{self._id}|{request.seed}|{request.key}"
        digest = hashlib.sha256(seed_text.encode()).digest()
        rng = np.random.default_rng(int.from_bytes(digest, "big"))
        steps = BASELINES[self._id](request, rng)
        text = "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(steps, 1))
        return Reply(text, usage=Usage(0, 0), cost_usd=0.0, provider_model=self._id, attempts=0)

    async def aclose(self) -> None:
        """Nothing is held open."""


def _random(request: Request, rng: np.random.Generator) -> Iterable[int]:
    return (int(n) for n in rng.integers(1, len(request.candidates) + 1, _RANDOM_STEPS))


def _all_candidates(request: Request, _: np.random.Generator) -> Iterable[int]:
    return range(1, len(request.candidates) + 1)


def _oracle(request: Request, rng: np.random.Generator) -> Iterable[int]:
    blocks = request.scene.blocks
    return [_needed(request, blocks[v]) for v in request.scene.graph.random_order(rng)]


def _oracle_no_orientation(request: Request, rng: np.random.Generator) -> Iterable[int]:
    """A valid order in which every block stands wrongly, wherever a wrong one can be chosen."""
    blocks = request.scene.blocks
    order = request.scene.graph.random_order(rng)
    return [
        _turned(request.candidates, blocks[v], rng) or _needed(request, blocks[v]) for v in order
    ]


def _needed(request: Request, block: Block) -> int:
    index = request.candidates.index_of(block.look)
    if index is None:
        found = f"{block.color} {block.type} turned {block.euler_deg}"
        where = f"scene {request.scene.id}"
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


BASELINES: Mapping[str, Baseline] = {
    "random": _random,
    "all-candidates": _all_candidates,
    "oracle": _oracle,
    "oracle-no-orientation": _oracle_no_orientation,
}
"""Baselines by name."""
