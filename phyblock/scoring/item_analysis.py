"""What an item of a test is worth: its difficulty, how well it tells models apart, and subsets.

Classical test theory (Lord and Novick, *Statistical Theories of Mental Test Scores*, 1968): an
item's difficulty is its mean score, its discrimination the correlation of its score with the rest
of the test (item-rest correlation), here over models.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit  # type: ignore[import-untyped]

from phyblock.scoring.ratios import Floats, Metric

__all__ = [
    "LEAST_MODELS",
    "discrimination",
    "explained",
    "least_correlation",
    "pairs_kept",
    "pairs_kept_by_choice",
]

LEAST_MODELS = 4
"""Fewer models leave a correlation over them without meaning."""
_LEVEL = 0.05


def discrimination(scores: Floats) -> Floats:
    """Correlation of each item's score with the mean of all other items, over models.

    `scores` has shape (models, items), NaN where a model has none; the result (items,), NaN where
    fewer than two models have a score, or all of them the same.
    """
    known = ~np.isnan(scores)
    filled = np.where(known, scores, 0.0)
    others = known.sum(axis=1, keepdims=True) - known
    rest = (filled.sum(axis=1, keepdims=True) - filled) / np.maximum(others, 1)
    return _correlation(filled, rest, known & (others > 0))


def _correlation(one: Floats, other: Floats, known: NDArray[np.bool_]) -> Floats:
    """Pearson's correlation of each column, over the rows that are known."""
    n = np.maximum(known.sum(axis=0), 1)
    apart = [
        np.where(known, values - np.where(known, values, 0).sum(axis=0) / n, 0)
        for values in (one, other)
    ]
    spread = np.sqrt((apart[0] ** 2).sum(axis=0) * (apart[1] ** 2).sum(axis=0))
    # Equal scores differ from their mean by what rounding leaves.
    is_defined = (known.sum(axis=0) > 1) & (spread > 1e-12)
    together = (apart[0] * apart[1]).sum(axis=0)
    out = np.full(spread.shape, np.nan)
    np.divide(together, spread, out=out, where=is_defined)
    return np.clip(out, -1.0, 1.0)


def least_correlation(models: int) -> float:
    """The least distance from 0 by which a correlation over so many models differs from none.

    Two-sided at 5 %, one item alone, by the t distribution; NaN for fewer than three models.
    """
    freedom = models - 2
    if freedom < 1:
        return float("nan")
    t = float(stdtrit(freedom, 1 - _LEVEL / 2))
    return float(t / np.sqrt(freedom + t**2))


def explained(values: ArrayLike, groups: Sequence[object]) -> float:
    """Share of the variance of `values` that lies between groups (eta squared); NaN without any."""
    numbers = np.asarray(values, dtype=np.float64)
    names = {group: place for place, group in enumerate(dict.fromkeys(groups))}
    places = np.array([names[group] for group in groups], dtype=np.intp)
    sizes = np.bincount(places, minlength=len(names))
    apart = numbers - numbers.mean() if len(numbers) else numbers
    total = float((apart**2).sum())
    if total <= 1e-12:
        return float("nan")
    means = np.bincount(places, weights=apart, minlength=len(names)) / sizes
    return float((sizes * means**2).sum() / total)


def pairs_kept(counts: Floats, value: Metric, chosen: Sequence[int], rest: bool = False) -> Floats:
    """How each pair of models stands on the chosen items, held against all items.

    `counts` has shape (models, items, columns), `value` makes a value of their sums. 1: in the same
    order, -1: in the other, 0: even in one of them; their mean is Kendall's tau-a. With `rest` the
    items that were not chosen stand in the place of all. In the order of `combinations`.
    """
    pairs = np.array(list(combinations(range(len(counts)), 2)), dtype=np.intp).reshape(-1, 2)
    subset = value(counts[:, list(chosen)].sum(axis=1))
    held = np.delete(counts, list(chosen), axis=1) if rest else counts
    whole = value(held.sum(axis=1))
    signs = [np.sign(values[pairs[:, 0]] - values[pairs[:, 1]]) for values in (subset, whole)]
    return np.asarray(signs[0] * signs[1], dtype=np.float64)


def pairs_kept_by_choice(
    counts: Floats,
    value: Metric,
    choose: Callable[[Floats], Sequence[int]],
    rest: bool = False,
) -> Floats:
    """`pairs_kept`, each pair on items that were chosen without its two models.

    `choose` gives the items for the counts of some models.
    """
    kept = []
    for pair in combinations(range(len(counts)), 2):
        chosen = choose(np.delete(counts, pair, axis=0))
        kept.append(pairs_kept(counts[list(pair)], value, chosen, rest)[0])
    return np.array(kept)
