"""Counts (paper section 4.1) of one plan or of many, and ratios of summed counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.question import Subtask

Floats = NDArray[np.float64]
Metric = Callable[[Floats], Floats]
"""From summed counts, shape (..., counts), to a measured value, shape (...); NaN: undefined."""


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


def f1_of(sums: Floats) -> Floats:
    """2 TP / (2 TP + FP + FN) of counts (..., [tp, fp, fn])."""
    twice = 2 * sums[..., 0]
    return ratio_of(np.stack([twice, twice + sums[..., 1] + sums[..., 2]], axis=-1))


def ratio_of(sums: Floats) -> Floats:
    """Part / whole of counts (..., [part, whole]), as right answers of answers.

    NaN for no whole, and for a part that is more than the whole and so no share of it: the
    paper's criterion `membership` counts repeated steps again. The mean of such ratios over the
    axis before the last is a macro average.
    """
    part, whole = sums[..., 0], sums[..., 1]
    out = np.full(part.shape, np.nan)
    np.divide(part, whole, out=out, where=(whole > 0) & (part <= whole))
    return out


def mean_of(sums: Floats) -> Floats:
    """Sum / number of counts (..., [sum, number]), in the unit of the sum; NaN for none."""
    total, number = sums[..., 0], sums[..., 1]
    out = np.full(total.shape, np.nan)
    np.divide(total, number, out=out, where=number > 0)
    return out


def chance(subtask: Subtask, n_options: int = 4) -> float:
    """Expected accuracy of a uniform guess: 1 / n, for an order of n pictures 1 / n!."""
    return 1 / (math.factorial(n_options) if subtask == "OR" else n_options)
