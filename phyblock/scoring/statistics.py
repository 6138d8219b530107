"""Uncertainty: a cluster jackknife over base scenes, tests of differences, ranks, shifts.

Scenes made from the same base scene succeed and fail together, and a scene that combines two base
scenes shares something with every scene made from either of them. The variance of a statistic then
sums over all pairs of units that have a base scene in common: the dyadic cluster-robust variance
(Aronow, Samii and Assenova, *Cluster-robust variance estimation for dyadic data*, Political
Analysis 23, 2015), written by inclusion and exclusion (Cameron, Gelbach and Miller, *Robust
inference with multiway clustering*, Journal of Business & Economic Statistics 29, 2011). Each of
its terms is computed by leaving units out and measuring again, which needs no derivative of the
statistic and is less optimistic with few clusters (MacKinnon, Nielsen and Webb, *Fast and
reliable jackknife and bootstrap methods for cluster-robust inference*, Journal of Applied
Econometrics 38, 2023). docs/statistics.md has the simulation.

The *shift* by a varied factor (prompt, background) is the effect of its levels on all items in
common: the standard deviation of the levels' means. Items are crossed with the levels, and both
with *blocks*: the combinations of everything else that was varied. It is a method-of-moments
estimate with items as a random facet (Cornfield and Tukey, *Average values of mean squares in
factorials*, Annals of Mathematical Statistics 27, 1956; Brennan, *Generalizability Theory*, 2001).
Items of common origin are no independent sample, so the jackknife gives the error of the means.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phyblock.scoring.plan import Floats, Metric

CONFIDENCE = 0.95
POWER = 0.8
"""Share of cases in which the difference that `detectable` returns is found."""
_NOTHING = 1e-9
"""Standard error, as a share of the value, that may come from rounding alone."""


@dataclass(frozen=True, eq=False)
class Clusters:
    """The base scenes that each unit (scene, question) comes from.

    `members` has shape (units, most base scenes of a unit) and holds numbers of base scenes from 0
    to `size` - 1, with `size` where a unit has no further one.
    """

    members: NDArray[np.intp]
    size: int

    @classmethod
    def of(cls, parents: Sequence[Sequence[str]]) -> Clusters:
        """Clusters by names of base scenes, once each. Raises ValueError for a unit without any."""
        names = [tuple(dict.fromkeys(unit)) for unit in parents]
        if not all(names):
            raise ValueError("every unit needs a base scene")
        numbers = {name: n for n, name in enumerate(dict.fromkeys(sum(names, ())))}
        width = max(map(len, names), default=1)
        members = np.full((len(names), width), len(numbers), dtype=np.intp)
        for row, unit in zip(members, names, strict=True):
            row[: len(unit)] = [numbers[name] for name in unit]
        return cls(members, len(numbers))

    def behind(self, present: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Number of base scenes behind each column of `present` (units, columns)."""
        seen = np.zeros((self.size + 1, present.shape[1]), dtype=bool)
        for members in self.members.T:
            np.logical_or.at(seen, members, present)
        return np.asarray(seen[:-1].sum(axis=0))


@dataclass(frozen=True, eq=False)
class Estimate:
    """A measured value, or an array of them, with its uncertainty.

    `value` is over all units, with standard error `se` and interval `lo` to `hi`; `p` is two-sided
    against zero, by Student's t with `n_clusters` - 1 degrees of freedom (those behind a value).
    All have one shape; NaN without a value, and for fewer than two clusters in all but `value`.
    """

    value: Floats
    se: Floats
    lo: Floats
    hi: Floats
    p: Floats
    n_clusters: NDArray[np.intp]


def jackknife(
    counts: ArrayLike, clusters: Clusters, metric: Metric, *, n_clusters: ArrayLike | None = None
) -> Estimate:
    """Estimate `metric` of the summed `counts`, with a t test against zero and its interval.

    `counts` has shape (units, *cells, counts of a cell); the result has that of `metric` of the
    sums, usually (*cells,). A metric that subtracts one cell from another is a paired comparison.
    `n_clusters`, of the result's shape, counts the clusters behind each value if cells lack units.

    For units of one cluster each, the interval of a mean is Student's. The variance is never less
    than that of independent units, which keeps it above zero where units of common origin differ in
    opposite directions. `p` is never less than `least_p`. There is no standard error where leaving
    out a cluster leaves nothing to measure.
    """
    from scipy.special import stdtr, stdtrit  # type: ignore[import-untyped]

    given = np.asarray(counts, dtype=np.float64)
    total = given.sum(axis=0)
    value = _measured(metric, total)
    behind = np.broadcast_to(
        np.asarray(clusters.size if n_clusters is None else n_clusters, dtype=np.intp), value.shape
    )
    shared = np.zeros(value.shape)
    # For one, two, ... base scenes in common: a unit with two is in two groups of one, and in one
    # group of two.
    members = np.sort(clusters.members, axis=1)
    for size in range(1, members.shape[1] + 1):
        sets = [members[:, list(of)] for of in combinations(range(members.shape[1]), size)]
        stacked, units = np.concatenate(sets), np.tile(np.arange(len(members)), len(sets))
        whole = (stacked < clusters.size).all(axis=1)
        _, groups = np.unique(stacked[whole], axis=0, return_inverse=True)
        squares = _squares(given[units[whole]], groups.reshape(-1), total, metric, value)
        shared += squares if size % 2 else -squares
    alone = _squares(given, np.arange(len(given)), total, metric, value)
    df = np.where(behind > 1, behind - 1.0, np.nan)
    se = np.sqrt(np.maximum(shared, alone) * df / behind)
    wide = stdtrit(df, (1 + CONFIDENCE) / 2) * se
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(value == 0, 0 * se, np.abs(value) / se)
        p = np.minimum(np.maximum(2 * stdtr(df, -t), least_p(behind)), 1) + 0 * se
    return Estimate(value, se, value - wide, value + wide, p, behind)


def in_range(estimate: Estimate, most: ArrayLike = 1.0) -> Estimate:
    """The same estimates, with Wilson's interval instead of Student's where a range is known.

    Values are from 0 to `most`: 1 for shares, infinity for values only never below zero, NaN for no
    range, which keeps Student's. For a share p with standard error s, the effective number of
    samples is p (1 - p) / s^2 (Kish), or the number of clusters where every unit agrees and s is
    uninformative; the interval is that of Wilson (Journal of the American Statistical Association
    22, 1927) with Student's quantile (Dean and Pagano, *Evaluating confidence interval methods for
    binomial proportions in clustered surveys*, Journal of Survey Statistics and Methodology 3,
    2015). Any other mean is treated as a share of the end of its range, in the limit if infinite.
    The interval stays in the range and, if that has an end, has a width even if nothing varies.
    """
    from scipy.special import stdtrit

    end = np.broadcast_to(np.asarray(most, dtype=np.float64), estimate.value.shape)
    chosen = ~np.isnan(end)
    value = np.where(chosen, estimate.value, np.nan)
    behind = estimate.n_clusters.astype(np.float64)
    known = ~np.isnan(estimate.se) & chosen
    t = stdtrit(np.where(known & (behind > 1), behind - 1, np.nan), (1 + CONFIDENCE) / 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1 / end
        spread = value * (1 - value * inverse)
        is_still = (spread <= 0) | (estimate.se <= _NOTHING * value)
        # The variance of one cluster at either end of the range, over `spread`.
        still = np.where(inverse > 0, 1 / (behind * inverse), 0.0)
        per_spread = np.where(is_still, still, estimate.se**2 / spread)
    scale = 1 + t**2 * per_spread * inverse
    centre = (value + t**2 * per_spread / 2) / scale
    half = t * np.sqrt(per_spread * (spread + t**2 * per_spread / 4)) / scale
    # Rounding must not leave a value outside of its interval.
    lo, hi = np.minimum(centre - half, value), np.maximum(centre + half, value)
    lo, hi = np.maximum(lo, 0.0), np.minimum(hi, end)
    lo, hi = np.where(known, lo, estimate.lo), np.where(known, hi, estimate.hi)
    return replace(estimate, lo=lo, hi=hi)


def bounded(estimate: Estimate, most: float) -> Estimate:
    """The same estimates of differences, with intervals cut at -`most` and `most`."""
    lo, hi = (np.clip(end, -most, most) for end in (estimate.lo, estimate.hi))
    return replace(estimate, lo=lo, hi=hi)


def least_p(n_clusters: ArrayLike) -> Floats:
    """The least p value that this many clusters can give: that of equal signs in a sign test.

    Without it, a few clusters that happen to agree exactly would give a p value of 0.
    """
    return np.asarray(np.minimum(1.0, 2.0 ** (1.0 - np.asarray(n_clusters, dtype=np.float64))))


def detectable(
    se: ArrayLike, n_clusters: ArrayLike, level: float, most: float = math.inf
) -> Floats:
    """The difference that a test at `level` finds in `POWER` of cases, in the unit of `se`.

    Bloom, *Minimum detectable effects*, Evaluation Review 19, 1995: the sum of the two quantiles of
    Student's t, times the standard error. NaN with fewer than two clusters, beyond the `most` that
    values can differ by, and where no sample differs, since a standard error of 0 says nothing.
    """
    from scipy.special import stdtrit

    behind = np.asarray(n_clusters, dtype=np.float64)
    df = np.where(behind > 1, behind - 1.0, np.nan)
    error = np.asarray(se, dtype=np.float64)
    difference = (stdtrit(df, 1 - level / 2) + stdtrit(df, POWER)) * error
    return np.where((error > 0) & (difference <= most), difference, np.nan)


def _squares(
    counts: Floats, groups: NDArray[np.intp], total: Floats, metric: Metric, value: Floats
) -> Floats:
    """The squared changes of the metric when each group is left out, summed over groups."""
    if not len(groups):
        return np.zeros(value.shape)
    dropped = np.zeros((int(groups.max()) + 1, *total.shape))
    np.add.at(dropped, groups, counts)
    change = _measured(metric, total - dropped) - value
    return np.asarray((change**2).sum(axis=0))


def _measured(metric: Metric, sums: Floats) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(metric(sums), dtype=np.float64)


def holm(p: ArrayLike) -> Floats:
    """P values corrected for multiple tests (Holm, Scandinavian Journal of Statistics 6, 1979).

    NaN stays NaN and is not counted.
    """
    given = np.asarray(p, dtype=np.float64)
    known = np.flatnonzero(~np.isnan(given))
    order = known[np.argsort(given[known], kind="stable")]
    steps = given[order] * np.arange(len(order), 0, -1)
    corrected = np.full(given.shape, np.nan)
    corrected[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return corrected


def rank_ranges(is_better: ArrayLike) -> NDArray[np.intp]:
    """The best and the worst rank that each of n models may have, shape (n, 2), from 1.

    `is_better` (n, n) is true for pairs in which the first was found better than the second. With
    pairs tested together at a level, all ranges hold jointly at that level (Mogstad, Romano,
    Shaikh and Wilhelm, *Inference for ranks*, Review of Economic Studies 91, 2024).
    """
    known = np.asarray(is_better, dtype=bool)
    return np.stack([1 + known.sum(axis=0), len(known) - known.sum(axis=1)], axis=1)


_TAIL = (1 - CONFIDENCE) / 2


class Component(NamedTuple):
    """A standard deviation with its 95 % interval; NaN where it cannot be estimated."""

    sd: float
    lo: float
    hi: float


def shift(scores: Floats, clusters: Clusters) -> Component:
    """Standard deviation by which levels move the mean over items; (items, levels, blocks).

    The interval is that of the noncentrality of an F test of equal levels (Steiger, *Beyond the F
    test*, Psychological Methods 9, 2004), with the jackknife's error and its degrees of freedom; it
    begins at 0 where the test finds nothing.
    """
    from scipy.special import ncfdtr, ncfdtrinc

    items, levels, _ = scores.shape
    if items < 2 or levels < 2 or clusters.size < 2:
        return Component(np.nan, np.nan, np.nan)
    moved = (scores - scores.mean(axis=1, keepdims=True)).mean(axis=2)
    estimate = jackknife(
        np.concatenate([moved, np.ones((items, 1))], axis=1),
        clusters,
        lambda sums: sums[..., :-1] / sums[..., -1:],
    )
    df, df_error = levels - 1, clusters.size - 1
    total, error = float((estimate.value**2).sum()), float((estimate.se**2).sum())
    if error <= np.finfo(float).tiny:
        exact = np.sqrt(total / df)
        return Component(exact, exact, exact)
    f = total / error

    def end(p: float) -> float:
        """The end from the noncentrality at which F is at most `f` with probability `p`."""
        is_none = ncfdtr(df, df_error, 0.0, f) <= p
        noncentrality = 0.0 if is_none else float(ncfdtrinc(df, df_error, p, f))
        return float(np.sqrt(noncentrality * error) / df)

    return Component(float(np.sqrt(max(total - error, 0.0) / df)), end(1 - _TAIL), end(_TAIL))
