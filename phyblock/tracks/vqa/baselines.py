"""What baselines answer where one of several options is asked for."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from phyblock.domain import LETTERS, Question

__all__ = ["CHOICE_RULES", "ChoiceSubject", "choice_text"]


@dataclass(frozen=True)
class ChoiceSubject:
    """One of several options is asked for, of a question as it is shown.

    `guesses` holds what rules over the whole question set answer, by the rule's name: the 0-based
    indices of `question.answer`'s form.
    """

    question: Question
    guesses: Mapping[str, tuple[int, ...]] = field(default_factory=dict)


def _random_choice(subject: ChoiceSubject, rng: np.random.Generator) -> str:
    n = len(subject.question.options)
    if subject.question.subtask == "OR":
        return choice_text(int(index) for index in rng.permutation(n))
    return choice_text([int(rng.integers(n))])


def _oracle_choice(subject: ChoiceSubject, _: np.random.Generator) -> str:
    return choice_text(subject.question.answer)


def _majority_choice(subject: ChoiceSubject, _: np.random.Generator) -> str:
    return choice_text(subject.guesses["majority"])


def _text_choice(subject: ChoiceSubject, _: np.random.Generator) -> str:
    return choice_text(subject.guesses["text-only"])


def choice_text(indices: Iterable[int]) -> str:
    """An answer in the benchmark's own reply form."""
    return "Answer: " + ", ".join(LETTERS[index] for index in indices)


CHOICE_RULES = {
    "random": _random_choice,
    "oracle": _oracle_choice,
    "majority": _majority_choice,
    "text-only": _text_choice,
}
"""Rules by name of the baseline."""
