"""Counts and micro averages (paper section 4.1)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

__all__ = ["Counts", "micro"]


@dataclass(frozen=True)
class Counts:
    """True positives, false positives and false negatives, of one plan or summed over many.

    `fn` falls below zero under the `membership` criterion when a plan repeats a right step.
    """

    tp: int = 0
    fp: int = 0
    fn: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(self.tp + other.tp, self.fp + other.fp, self.fn + other.fn)

    @property
    def precision(self) -> float | None:
        """TP / (TP + FP), None where no step was counted."""
        return _ratio(self.tp, self.tp + self.fp)

    @property
    def recall(self) -> float | None:
        """TP / (TP + FN), None where no block was wanted."""
        return _ratio(self.tp, self.tp + self.fn)

    @property
    def f1(self) -> float | None:
        """2 TP / (2 TP + FP + FN): the harmonic mean, None where nothing was counted."""
        return _ratio(2 * self.tp, 2 * self.tp + self.fp + self.fn)


def micro(counts: Iterable[Counts]) -> Counts:
    """Sum of counts; its precision, recall and F1 are the micro averages."""
    return sum(counts, Counts())


def _ratio(part: int, whole: int) -> float | None:
    return part / whole if whole else None
