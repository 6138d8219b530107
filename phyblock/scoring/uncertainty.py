"""How sure a number is: intervals by resampling base scenes, paired differences, Holm's correction.

Scenes made from the same base scene succeed and fail together, so it is base scenes that are drawn
with replacement. A scene weighs the product of how often its base scenes were drawn: once in a
resample that draws each of them once, not at all where one of them is not drawn. This is the
pigeonhole bootstrap (Owen, *The pigeonhole bootstrap*, Annals of Applied Statistics 1, 2007; for
units with two memberships of one kind: Davezies, D'Haultfoeuille and Guyonvarch, Annals of
Statistics 49, 2021). For scenes of one base scene each it is the usual cluster bootstrap. With two
each, its standard errors are not too small, and too large where scenes of common origin have little
in common (docs/statistics.md has the simulation).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr, ndtri, stdtr, stdtrit  # type: ignore[import-untyped]

__all__ = [
    "CONFIDENCE",
    "RESAMPLES",
    "Clusters",
    "Estimate",
    "Floats",
    "Metric",
    "bootstrap",
    "f1_of",
    "holm",
    "precision_of",
    "ratio_of",
    "recall_of",
    "resample_weights",
]

Floats = NDArray[np.float64]
Metric = Callable[[Floats], Floats]
"""From summed counts, shape (..., counts), to what is measured, shape (...); NaN where undefined.
"""

CONFIDENCE = 0.95
RESAMPLES = 2_000
_CHUNK = 500


@dataclass(frozen=True, eq=False)
class Clusters:
    """Which base scenes each unit (scene, question) comes from.

    `members` has shape (units, most base scenes of a unit) and holds numbers of base scenes from 0
    to `size` - 1, with `size` where a unit has no further one.
    """

    members: NDArray[np.intp]
    size: int

    @classmethod
    def of(cls, parents: Sequence[Sequence[str]]) -> Clusters:
        """Clusters from the names of the base scenes of each unit; a name twice counts once.

        Raises ValueError for a unit without a base scene.
        """
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
        """How many base scenes are behind each column of `present` (units, columns)."""
        seen = np.zeros((self.size + 1, present.shape[1]), dtype=bool)
        for members in self.members.T:
            np.logical_or.at(seen, members, present)
        return np.asarray(seen[:-1].sum(axis=0))


@dataclass(frozen=True, eq=False)
class Estimate:
    """A measured value, or an array of them, with its uncertainty.

    `value` is of all units, `se` the standard deviation over resamples, `lo` and `hi` bound the
    interval, `p` is two-sided against zero and agrees with the interval. `n_clusters` are behind
    each value. All are of one shape; NaN where there is no value, and in all but `value` with
    fewer than two clusters.
    """

    value: Floats
    se: Floats
    lo: Floats
    hi: Floats
    p: Floats
    n_clusters: NDArray[np.intp]


def bootstrap(
    counts: ArrayLike,
    clusters: Clusters,
    metric: Metric,
    rng: np.random.Generator,
    *,
    resamples: int = RESAMPLES,
    n_clusters: ArrayLike | None = None,
) -> Estimate:
    """Estimate `metric` of the summed `counts`, with a percentile interval.

    `counts` has shape (units, *cells, counts of a cell); the result has that of `metric` of the
    sums, (*cells,) as a rule. All cells see the same resamples, so that a metric that subtracts
    one cell from another is a paired comparison. Percentiles are widened for few clusters
    (Hesterberg, *What teachers should know about the bootstrap*, The American Statistician 69,
    2015), so that the interval of a mean is as wide as Student's. `n_clusters`, of the result's
    shape, says how many clusters are behind each value where some cells lack units. Without units
    there is no value.
    """
    given = np.asarray(counts, dtype=np.float64)
    value = _measure(metric, given.sum(axis=0))
    behind = np.broadcast_to(
        np.asarray(clusters.size if n_clusters is None else n_clusters, dtype=np.intp), value.shape
    )
    if not len(given):
        none = np.full(value.shape, np.nan)
        return Estimate(none, none, none, none, none, behind)
    flat = given.reshape(len(given), -1)
    draws = np.concatenate(
        [
            _measure(metric, (weights @ flat).reshape(len(weights), *given.shape[1:]))
            for weights in resample_weights(clusters, rng, resamples)
        ]
    )
    unknown = np.isnan(value) | np.isnan(draws).all(axis=0) | (behind < 2)
    spread = np.full((4, *value.shape), np.nan)
    for n in np.unique(behind[~unknown]):
        cells = (behind == n) & ~unknown
        spread[:, cells] = _spread(draws[:, cells], int(n))
    se, lo, hi, p = spread
    return Estimate(value, se, lo, hi, p, behind)


def _spread(draws: Floats, n: int) -> Floats:
    """Standard error, interval and p value, shape (4, cells), of draws (resamples, cells)."""
    # The share of resamples to cut off on a side, for n clusters.
    tail = float(ndtr(np.sqrt(n / (n - 1)) * stdtrit(n - 1, (1 - CONFIDENCE) / 2)))
    whole = not np.isnan(draws).any()
    quantile, std = (np.quantile, np.std) if whole else (np.nanquantile, np.nanstd)
    lo, hi = quantile(draws, [tail, 1 - tail], axis=0)
    return np.stack([std(draws, axis=0, ddof=1), lo, hi, _p_value(draws, n)])


def resample_weights(
    clusters: Clusters, rng: np.random.Generator, resamples: int
) -> Iterator[Floats]:
    """Weights of all units, shape (some resamples, units), until there were `resamples` of them."""
    even = np.full(clusters.size, 1 / clusters.size)
    for start in range(0, resamples, _CHUNK):
        size = min(_CHUNK, resamples - start)
        times = np.ones((size, clusters.size + 1))
        times[:, :-1] = rng.multinomial(clusters.size, even, size=size)
        weights = times[:, clusters.members[:, 0]]
        for member in clusters.members.T[1:]:
            weights *= times[:, member]
        yield weights


def _measure(metric: Metric, sums: Floats) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(metric(sums), dtype=np.float64)


def _p_value(draws: Floats, n: int) -> Floats:
    """Twice the tail at which the interval would end at zero, at most 1; ties count half."""
    known = (~np.isnan(draws)).sum(axis=0)
    below = (draws < 0).sum(axis=0) + 0.5 * (draws == 0).sum(axis=0)
    # No resample beyond zero does not make it impossible: half a resample stands for that.
    tail = (np.minimum(below, known - below) + 0.5) / (known + 1)
    widened = stdtr(n - 1, ndtri(tail) * np.sqrt((n - 1) / n))
    return np.asarray(np.minimum(2 * widened, 1.0), dtype=np.float64)


def holm(p: ArrayLike) -> Floats:
    """P values corrected for their number (Holm, Scandinavian Journal of Statistics 6, 1979).

    NaN stays NaN and is not counted.
    """
    given = np.asarray(p, dtype=np.float64)
    known = np.flatnonzero(~np.isnan(given))
    order = known[np.argsort(given[known], kind="stable")]
    steps = given[order] * np.arange(len(order), 0, -1)
    corrected = np.full(given.shape, np.nan)
    corrected[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return corrected


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
    """Part / whole of counts (..., [part, whole]), as right answers of answers; NaN for no whole.

    The mean of such ratios over the axis before the last is a macro average.
    """
    part, whole = sums[..., 0], sums[..., 1]
    out = np.full(part.shape, np.nan)
    np.divide(part, whole, out=out, where=whole != 0)
    return out
