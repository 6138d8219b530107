"""The rules of a step-planning episode: the simulator, how many replies, what ends it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from phyblock.parsing.move import ParsedMove, move_form
from phyblock.parsing.structured import AnswerForm
from phyblock.types import AnswerFormat, Gating, Physics, Setting

__all__ = ["ENDINGS", "Ending", "StepLimits", "StepRules", "Tally", "majority"]

Ending = Literal[
    "completed",
    "done",
    "collapsed",
    "max_steps",
    "max_failures",
    "max_repeats",
    "max_tokens",
    "max_cost",
    "unanswered",
]
ENDINGS: tuple[Ending, ...] = get_args(Ending)


@dataclass(frozen=True)
class StepLimits:
    """What ends an episode, whatever the model does; None is no bound.

    `steps` None is twice the number of blocks, so that every episode ends. `failures` are failed
    steps in a row, `repeats` failures in a row of one and the same operation; `tokens` and `usd`
    are those of all replies, a number that is not known counting as 0.
    """

    steps: int | None = None
    failures: int | None = 5
    repeats: int | None = 3
    tokens: int | None = None
    usd: float | None = None

    def max_steps(self, n_blocks: int) -> int:
        """Steps at most for a goal of so many blocks."""
        return 2 * n_blocks if self.steps is None else self.steps


@dataclass(frozen=True)
class StepRules:
    """How episodes are played and scored.

    The simulator lets a move succeed under `accepts`; scores are counted under all `settings`.
    Reasons are a part of the JSON that is asked for where `cot`.
    """

    accepts: Setting = "A"
    settings: tuple[Setting, ...] = ("A", "B")
    gating: Gating = "aov"
    physics: Physics = "off"
    samples: int = 1
    limits: StepLimits = StepLimits()
    answer_format: AnswerFormat = "text"
    cot: bool = True

    def form(self, n_candidates: int) -> AnswerForm[ParsedMove] | None:
        """The form in which an operation is asked for; None where that is text."""
        return None if self.answer_format == "text" else move_form(n_candidates, reasons=self.cot)

    def written(self, operation: str, n_candidates: int) -> str:
        """A reply that names an operation and nothing else, as it is shown in a conversation."""
        form = self.form(n_candidates)
        return operation if form is None else form.write(operation)


@dataclass
class Tally:
    """What counts against the limits of an episode."""

    steps: int = 0
    failures: int = 0
    repeats: int = 0
    tokens: int = 0
    usd: float = 0.0
    last_failed: int | None = None

    def count(self, move: int | None, *, is_placed: bool) -> None:
        """Count a step: the candidate that was named, None for a reply that could not be read."""
        self.steps += 1
        if is_placed:
            self.failures = self.repeats = 0
            self.last_failed = None
            return
        self.failures += 1
        is_repeat = move is not None and move == self.last_failed
        self.repeats = self.repeats + 1 if is_repeat else 1
        self.last_failed = move

    def ending(self, limits: StepLimits, n_blocks: int) -> Ending | None:
        """The first limit that is reached, or None."""
        reached: tuple[tuple[Ending, float, float | None], ...] = (
            ("max_repeats", self.repeats if self.last_failed is not None else 0, limits.repeats),
            ("max_failures", self.failures, limits.failures),
            ("max_steps", self.steps, limits.max_steps(n_blocks)),
            ("max_tokens", self.tokens, limits.tokens),
            ("max_cost", self.usd, limits.usd),
        )
        return next((name for name, n, most in reached if most is not None and n >= most), None)


def majority(replies: Sequence[ParsedMove]) -> int:
    """Place of the reply that speaks for all: the first with the operation named most often.

    Operations named equally often are taken in the order in which they came. Replies that could
    not be read have no vote, unless none could be.
    """
    votes = Counter((one.move, one.is_done) for one in replies if one.problem is None)
    if not votes:
        return 0
    (chosen, _), *_ = votes.most_common(1)
    return next(
        place
        for place, one in enumerate(replies)
        if one.problem is None and (one.move, one.is_done) == chosen
    )
