"""Multiple-choice questions: what guessing gives, and which letters are given. Pure."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from phyblock.domain.question import LETTERS, Subtask

__all__ = ["LetterRates", "chance", "letter_rates"]


@dataclass(frozen=True)
class LetterRates:
    """How often each letter is right and was given, of the `n` questions that have one letter."""

    n: int
    right: Mapping[str, int]
    given: Mapping[str, int]


def letter_rates(answers: Iterable[tuple[str, str | None]]) -> LetterRates:
    """Counts by letter over the answers with one right letter, so without ordering.

    An answer is the letters that are right and those that were given, None where none could be
    read.
    """
    single = [(right, given) for right, given in answers if len(right) == 1]
    rights = Counter(right for right, _ in single)
    givens = Counter(given for _, given in single)
    return LetterRates(
        len(single),
        {letter: rights[letter] for letter in LETTERS},
        {letter: givens[letter] for letter in LETTERS},
    )


def chance(subtask: Subtask, n_options: int = 4) -> float:
    """Expected accuracy of a uniform guess: 1 / n, for an order of n pictures 1 / n!."""
    return 1 / (math.factorial(n_options) if subtask == "OR" else n_options)
