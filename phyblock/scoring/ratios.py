"""Ratios of summed counts, in arrays of any shape: what measures are worth."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["Floats", "Metric", "f1_of", "mean_of", "precision_of", "ratio_of", "recall_of"]

Floats = NDArray[np.float64]
Metric = Callable[[Floats], Floats]
"""From summed counts, shape (..., counts), to what is measured, shape (...); NaN where undefined.
"""


def precision_of(sums: Floats) -> Floats:
    """TP / (TP + FP) of counts (..., [tp, fp, fn])."""
    return ratio_of(np.stack([sums[..., 0], sums[..., 0] + sums[..., 1]], axis=-1))


def recall_of(sums: Floats) -> Floats:
    """TP / (TP + FN) of counts (..., [tp, fp, fn])."""
    return ratio_of(np.stack([sums[..., 0], sums[..., 0] + sums[..., 2]], axis=-1))


def f1_of(sums: Floats) -> Floats:
    """2 TP / (2 TP + FP + FN) of counts (..., [tp, fp, fn])."""
    twice = 2 * sums[..., 0]
    return ratio_of(np.stack([twice, twice + sums[..., 1] + sums[..., 2]], axis=-1))


def ratio_of(sums: Floats) -> Floats:
    """Part / whole of counts (..., [part, whole]), as right answers of answers.

    NaN for no whole, and for a part that is more than the whole, which is no share of it: the
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
