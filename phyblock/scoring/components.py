"""Variance components: how much a factor of the way of asking moves scores, in their own unit.

Items (scenes, questions) are crossed with the levels of a factor, and both with *blocks*: the
combinations of everything else that was varied, repeats included. Of the score of an item two
things are told apart. The *shift* is what a level does to all items alike: the standard deviation
of the levels' means. The *interaction* is what it does to single items beyond that: the standard
deviation of an item's scores over levels, without shift and without what differs from block to
block (further interactions and the noise of a repeat).

Both are method-of-moments estimates of a crossed design with items as a random facet (Cornfield and
Tukey, *Average values of mean squares in factorials*, Annals of Mathematical Statistics 27, 1956;
Brennan, *Generalizability Theory*, 2001). Items of common origin are no independent sample, so what
the error of the levels' means adds to the shift is taken from the jackknife over base scenes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, ncfdtr, ncfdtrinc  # type: ignore[import-untyped]

from phyblock.scoring.ratios import Floats
from phyblock.scoring.uncertainty import CONFIDENCE, Clusters, jackknife

__all__ = ["NO_COMPONENT", "Component", "interaction", "shift", "spread_of_items", "within"]

_TAIL = (1 - CONFIDENCE) / 2


@dataclass(frozen=True)
class Component:
    """A standard deviation with its 95 % interval; NaN where it cannot be told."""

    sd: float
    lo: float
    hi: float


NO_COMPONENT = Component(np.nan, np.nan, np.nan)


def shift(scores: Floats, clusters: Clusters) -> Component:
    """How far levels move the mean over items; `scores` has shape (items, levels, blocks).

    The interval is that of the noncentrality of an F test of equal levels (Steiger, *Beyond the F
    test*, Psychological Methods 9, 2004), with the jackknife's error and one degree of freedom less
    than base scenes; it begins at 0 where the test finds nothing.
    """
    items, levels, _ = scores.shape
    if items < 2 or levels < 2 or clusters.size < 2:
        return NO_COMPONENT
    moved = (scores - scores.mean(axis=1, keepdims=True)).mean(axis=2)
    estimate = jackknife(
        np.concatenate([moved, np.ones((items, 1))], axis=1),
        clusters,
        lambda sums: sums[..., :-1] / sums[..., -1:],
    )
    df = levels - 1
    total, error = float((estimate.value**2).sum()), float((estimate.se**2).sum())
    if error <= np.finfo(float).tiny:
        exact = np.sqrt(total / df)
        return Component(exact, exact, exact)
    f = total / error
    ends = [_noncentrality(f, df, clusters.size - 1, p) for p in (1 - _TAIL, _TAIL)]
    lo, hi = (float(np.sqrt(end * error) / df) for end in ends)
    return Component(float(np.sqrt(max(total - error, 0.0) / df)), lo, hi)


def _noncentrality(f: float, df: int, df_error: int, p: float) -> float:
    """The noncentrality at which so large an F or a smaller one has probability `p`; 0 where none
    has.
    """
    if ncfdtr(df, df_error, 0.0, f) <= p:
        return 0.0
    return float(ncfdtrinc(df, df_error, p, f))


def interaction(scores: Floats, clusters: Clusters) -> Component:
    """How far levels move single items beyond the shift; `scores` (items, levels, blocks).

    With one block it cannot be told from noise.
    """
    items, levels, blocks = scores.shape
    if items < 2 or levels < 2 or blocks < 2 or clusters.size < 2:
        return NO_COMPONENT
    moved = scores - scores.mean(axis=1, keepdims=True)
    mean = moved.mean(axis=2, keepdims=True)
    counts = np.concatenate(
        [
            np.ones((items, 1)),
            (mean**2).sum(axis=(1, 2))[:, None],
            ((moved - mean) ** 2).sum(axis=(1, 2))[:, None],
            moved.reshape(items, -1),
        ],
        axis=1,
    )

    def variance(sums: Floats) -> Floats:
        n = sums[..., 0]
        cells = (sums[..., 3:] / n[..., None]).reshape(*n.shape, levels, blocks)
        level = cells.mean(axis=-1)
        df = (n - 1) * (levels - 1)
        of_levels = (sums[..., 1] - n * (level**2).sum(axis=-1)) / df
        apart = ((cells - level[..., None]) ** 2).sum(axis=(-2, -1))
        of_blocks = (sums[..., 2] - n * apart) / (df * (blocks - 1))
        return np.stack([of_levels - of_blocks / blocks, of_blocks / blocks], axis=-1)

    estimate = jackknife(counts, clusters, variance)
    most = (clusters.size - 1) * (levels - 1)
    above, noise = (float(value) for value in estimate.value)
    return _of_variance(above, float(estimate.se[0]), noise, most=most)


def within(scores: Floats, clusters: Clusters) -> Component:
    """How far the score of one item goes from repeat to repeat of one way of asking.

    `scores` has shape (items, ways, repeats).
    """
    items, ways, repeats = scores.shape
    if items < 2 or repeats < 2 or clusters.size < 2:
        return NO_COMPONENT
    variances = scores.var(axis=2, ddof=1).mean(axis=1)
    counts = np.stack([np.ones(items), variances], axis=1)
    estimate = jackknife(counts, clusters, lambda sums: sums[..., 1] / sums[..., 0])
    most = clusters.size * ways * (repeats - 1)
    return _of_variance(float(estimate.value), float(estimate.se), most=most)


def spread_of_items(scores: Floats, clusters: Clusters) -> Component:
    """How far items differ, each by its mean over all ways of asking; `scores` (items, ...)."""
    items = len(scores)
    if items < 3 or clusters.size < 3:
        return NO_COMPONENT
    means = scores.reshape(items, -1).mean(axis=1)
    # Centered first: what is left of large squares would be noise.
    means = means - means.mean()
    counts = np.stack([np.ones(items), means, means**2], axis=1)
    estimate = jackknife(
        counts,
        clusters,
        lambda sums: (sums[..., 2] - sums[..., 1] ** 2 / sums[..., 0]) / (sums[..., 0] - 1),
    )
    return _of_variance(float(estimate.value), float(estimate.se), most=clusters.size - 1)


def _of_variance(variance: float, se: float, noise: float = 0.0, *, most: float) -> Component:
    """A variance that is left of a mean square when `noise` is taken off it.

    The mean square has the interval of chi-square with the degrees of freedom that its error stands
    for (Satterthwaite, *An approximate distribution of estimates of variance components*,
    Biometrics Bulletin 2, 1946), of which `noise` is taken off too; nothing of it is below zero.
    An error that was estimated is at times far too small, even 0: there are at `most` as many
    degrees of freedom as independent base scenes have.
    """
    square = variance + noise
    ends = (square, square)
    if square > 0:
        ratio = square / se if se > 0 else math.inf
        df = min(2 * ratio * ratio, most)
        ends = (square * df / chdtri(df, _TAIL), square * df / chdtri(df, 1 - _TAIL))
    parts = (variance, *(end - noise for end in ends))
    return Component(*(float(np.sqrt(max(part, 0.0))) for part in parts))
