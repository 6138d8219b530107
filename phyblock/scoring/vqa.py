"""Multiple-choice questions: accuracy, macro averages, circular scoring, letter rates. Pure."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from phyblock.domain.question import CATEGORIES, LETTERS, SUBTASKS, Category, Subtask

__all__ = [
    "Accuracy",
    "Answered",
    "LetterRates",
    "MacroAccuracy",
    "chance",
    "circular",
    "letter_rates",
    "macro_accuracy",
    "subtask_accuracies",
]


@dataclass(frozen=True)
class Answered:
    """One question as it was shown, the letters that are right, and those that were given.

    `rotation` tells the shown orders of one question's options apart; `given` is None where no
    answer could be read or there was no reply.
    """

    question: str
    subtask: Subtask
    right: str
    given: str | None
    rotation: int = 0

    @property
    def is_correct(self) -> bool:
        """Whether exactly the right letters were given, for ordering in the right order."""
        return self.given == self.right


@dataclass(frozen=True)
class Accuracy:
    """How many of `n` questions were answered right."""

    n_right: int = 0
    n: int = 0

    def __add__(self, other: Accuracy) -> Accuracy:
        return Accuracy(self.n_right + other.n_right, self.n + other.n)

    @property
    def value(self) -> float | None:
        """Share in [0, 1]; None where there is no question."""
        return self.n_right / self.n if self.n else None


@dataclass(frozen=True)
class MacroAccuracy:
    """Unweighted means over subtasks and categories, as Table 2's averages are; in [0, 1].

    A mean is None unless each of its parts has a value: that of three subtasks is no category.
    """

    categories: Mapping[Category, float | None]
    overall: float | None


@dataclass(frozen=True)
class LetterRates:
    """How often each letter is right and was given, of the `n` questions that have one letter."""

    n: int
    right: Mapping[str, int]
    given: Mapping[str, int]


def subtask_accuracies(answers: Iterable[Answered]) -> dict[Subtask, Accuracy]:
    """Accuracy of every subtask, in the paper's order; n = 0 for those that were not asked."""
    found = dict.fromkeys(SUBTASKS, Accuracy())
    for answer in answers:
        found[answer.subtask] += Accuracy(int(answer.is_correct), 1)
    return found


def macro_accuracy(values: Mapping[Subtask, float | None]) -> MacroAccuracy:
    """Means of the subtasks' accuracies by category, and of the categories."""
    categories = {
        category: _mean([values.get(subtask) for subtask in subtasks])
        for category, subtasks in CATEGORIES.items()
    }
    return MacroAccuracy(categories, _mean(list(categories.values())))


def circular(answers: Iterable[Answered], rotations: int) -> dict[Subtask, Accuracy]:
    """Accuracy of every subtask where a question is right only if all its rotations are.

    A question of which one of the `rotations` has no answer here is not right.
    """
    right: dict[tuple[Subtask, str], set[int]] = {}
    for answer in answers:
        shown = right.setdefault((answer.subtask, answer.question), set())
        if answer.is_correct:
            shown.add(answer.rotation)
    found = dict.fromkeys(SUBTASKS, Accuracy())
    for (subtask, _), shown in right.items():
        found[subtask] += Accuracy(int(len(shown) == rotations), 1)
    return found


def letter_rates(answers: Iterable[Answered]) -> LetterRates:
    """Counts by letter over questions with one right letter, so without ordering."""
    single = [answer for answer in answers if len(answer.right) == 1]
    right = Counter(answer.right for answer in single)
    given = Counter(answer.given for answer in single)
    return LetterRates(
        len(single),
        {letter: right[letter] for letter in LETTERS},
        {letter: given[letter] for letter in LETTERS},
    )


def chance(subtask: Subtask, n_options: int = 4) -> float:
    """Expected accuracy of a uniform guess: 1 / n, for an order of n pictures 1 / n!."""
    return 1 / (math.factorial(n_options) if subtask == "OR" else n_options)


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known and len(known) == len(values) else None
