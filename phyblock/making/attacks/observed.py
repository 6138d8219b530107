"""What attacks work on: a question, and the numbers that each of its options comes with."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from phyblock.domain.question import Question
from phyblock.errors import DataError
from phyblock.making.attacks.cues import Floats, cues_of
from phyblock.making.attacks.cut import Cut, cuts_of
from phyblock.making.attacks.looks import look_at
from phyblock.making.attacks.naive_support import Falls, naive_likings, resting_on, resting_only_on
from phyblock.making.questions.question_draft import UnfairError
from phyblock.making.workers import open_workers

__all__ = ["RULES", "Observed", "credit", "kind_of", "observe", "observe_all"]

RULES: Mapping[str, Falls] = {"support": resting_on, "sole support": resting_only_on}
"""What moves when a block is taken away, by rules without physics."""


@dataclass(frozen=True, eq=False)
class Observed:
    """A question with its cues by name, and how its options fit the rules that are about it.

    Each is of shape (options,). `cuts` are its pictures that are cut open; `fault` says why its
    pictures could not be looked at.
    """

    question: Question
    cues: Mapping[str, Floats] = field(default_factory=dict)
    rules: Mapping[str, Floats] = field(default_factory=dict)
    cuts: tuple[Cut, ...] = ()
    fault: str = ""


def observe(question: Question) -> Observed:
    """Draw a question and measure its options."""
    try:
        cues, cuts = cues_of(look_at(question)), cuts_of(question)
    except DataError as error:
        return Observed(question, fault=str(error))
    return Observed(question, cues, _fits(question), cuts)


def _fits(question: Question) -> dict[str, Floats]:
    """Likings by each rule that has a say; it has none where what is asked about cannot be told."""
    try:
        fits = {name: naive_likings(question, falls) for name, falls in RULES.items()}
    except UnfairError:
        return {}
    return {name: likings for name, likings in fits.items() if likings is not None}


def observe_all(questions: Sequence[Question], jobs: int = 1) -> Iterator[Observed]:
    """Observe many questions in `jobs` processes, in the order given.

    Raises PhyblockError when a process is killed.
    """
    with open_workers(jobs) as workers:
        yield from workers.map(observe, questions)


def kind_of(question: Question) -> str:
    """The sort of question within its subtask, by its evidence; empty where there is none."""
    kind = question.evidence.get("kind", "")
    return kind if isinstance(kind, str) else ""


def credit(likings: Floats, answer: Sequence[int]) -> float:
    """How often options taken by falling liking, ties at random, are the answer, 0..1.

    `answer` holds the index of one option, or all of them in the right order.
    """
    if len(answer) == 1:
        best = np.flatnonzero(likings == likings.max())
        return float(answer[0] in best) / len(best)
    liked = likings[list(answer)]
    if (np.diff(liked) > 0).any():
        return 0.0
    _, ties = np.unique(liked, return_counts=True)
    return 1.0 / math.prod(math.factorial(int(n)) for n in ties)
