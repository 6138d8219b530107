"""Variance components: what they are blind to, what they find, and how often intervals hold it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import gammaincinv  # type: ignore[import-untyped]

from phyblock.scoring.statistics import (
    Clusters,
    Component,
    interaction,
    shift,
    spread_of_items,
    within,
)

ITEMS, LEVELS, BLOCKS, REPEATS = 40, 2, 8, 2
TRUTH = {"shift": 0.04, "interaction": 0.08, "within": 0.1, "spread": 0.3}
RUNS = 150


def apart(items: int) -> Clusters:
    return Clusters.of([(str(n),) for n in range(items)])


def drawn(seed: int, items: int = 12) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(items, 3, 4))


def close(one: Component, other: Component, scale: float = 1.0) -> bool:
    a, b = ([part.sd, part.lo, part.hi] for part in (one, other))
    return np.allclose(np.array(a) * scale, b, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("component", [shift, interaction])
@given(seed=st.integers(0, 10**6))
def test_what_belongs_to_items_and_blocks_is_no_work_of_levels(
    component: Callable[..., Component], seed: int
) -> None:
    scores, rng = drawn(seed), np.random.default_rng(seed + 1)
    other = scores + rng.normal(size=(12, 1, 1)) + rng.normal(size=(1, 1, 4))
    assert close(component(scores, apart(12)), component(other, apart(12)))
    assert close(component(scores, apart(12)), component(100 * scores, apart(12)), 100)


@given(seed=st.integers(0, 10**6))
def test_an_effect_alike_on_all_items_is_shift_alone(seed: int) -> None:
    scores = drawn(seed)
    moved = scores + np.array([0.0, 5.0, -1.0])[None, :, None]
    assert close(interaction(scores, apart(12)), interaction(moved, apart(12)))
    assert shift(moved, apart(12)).sd > shift(scores, apart(12)).sd


def test_two_levels_are_half_their_squared_difference_less_its_error() -> None:
    scores = drawn(3)[:, :2]
    gap = (scores[:, 1] - scores[:, 0]).mean(axis=1)
    error = gap.var(ddof=1) / len(gap)
    assert shift(scores, apart(12)).sd ** 2 == pytest.approx(
        max(0.0, (gap.mean() ** 2 - error) / 2), abs=1e-12
    )


def test_components_of_a_crossed_design_are_those_of_the_analysis_of_variance() -> None:
    """By the sums of squares of a textbook: items x levels x blocks, one score a cell."""
    y = drawn(5)
    n, levels, blocks = y.shape
    mean = {axes: y.mean(axis=axes, keepdims=True) for axes in [(2,), (1,), (0,), (1, 2), (0, 2)]}
    mean |= {(0, 1): y.mean(axis=(0, 1), keepdims=True), (0, 1, 2): y.mean(keepdims=True)}
    two = mean[2,] - mean[1, 2] - mean[0, 2] + mean[0, 1, 2]
    three = y - mean[2,] - mean[1,] - mean[0,] + mean[1, 2] + mean[0, 2] + mean[0, 1]
    three = three - mean[0, 1, 2]
    df = (n - 1) * (levels - 1)
    square = blocks * (two**2).sum() / df
    rest = (three**2).sum() / (df * (blocks - 1))
    expected = max(0.0, (square - rest) / blocks)
    assert interaction(y, apart(n)).sd ** 2 == pytest.approx(expected)


def test_known_components_lie_in_their_intervals() -> None:
    rng = np.random.default_rng(2)
    hits = dict.fromkeys(TRUTH, 0)
    squares = dict.fromkeys(TRUTH, 0.0)
    for _ in range(RUNS):
        y = rng.normal(0, TRUTH["spread"], (ITEMS, 1, 1, 1))
        y = y + np.array([-1, 1])[None, :, None, None] * TRUTH["shift"] / np.sqrt(2)
        y = y + rng.normal(0, TRUTH["interaction"], (ITEMS, LEVELS, 1, 1))
        y = y + rng.normal(0, TRUTH["within"], (ITEMS, LEVELS, BLOCKS, REPEATS))
        clusters = apart(ITEMS)
        cells = y.mean(axis=3)
        found = {
            "shift": shift(cells, clusters),
            "interaction": interaction(cells, clusters),
            "within": within(y.reshape(ITEMS, -1, REPEATS), clusters),
        }
        for name, part in found.items():
            hits[name] += part.lo <= TRUTH[name] <= part.hi
            squares[name] += part.sd**2 / RUNS
    for name in found:
        # Three standard errors of a share of 0.95 in so many runs, and of their mean.
        assert hits[name] / RUNS > 0.89, name
        assert np.sqrt(squares[name]) == pytest.approx(TRUTH[name], rel=0.15), name


def test_scenes_that_agree_by_chance_are_no_certainty() -> None:
    """The error is 0 where every scene says the same, but there are four scenes of each alone."""
    alike = np.tile(np.array([0.0, 1.0, 0.0, 1.0]), (4, 3, 1))
    spread = np.array([0.0, 1.0, 0.0, 1.0])[:, None] * np.ones((4, 3))
    across = np.array([[[0.0, 0.0], [1.0, 1.0]], [[1.0, 1.0], [0.0, 0.0]]] * 2)
    parts = (
        within(alike, apart(4)),
        spread_of_items(spread, apart(4)),
        interaction(across, apart(4)),
    )
    for part, df in zip(parts, (4 * 3 * 3, 3, 3), strict=True):
        assert part.lo < part.sd < part.hi
        ends = part.sd * np.sqrt(df / (2 * gammaincinv(df / 2, [0.975, 0.025])))
        assert np.allclose([part.lo, part.hi], ends)


def test_nothing_to_tell_has_no_value() -> None:
    scores = drawn(1)
    assert np.isnan(interaction(scores[:, :, :1], apart(12)).sd)
    assert np.isnan(within(scores[:, :, :1], apart(12)).sd)
    assert np.isnan(shift(scores, Clusters.of([("one",)] * 12)).sd)
    assert np.isnan(spread_of_items(scores[:2], apart(2)).sd)
    alike = np.ones((12, 3, 4))
    assert [shift(alike, apart(12)).hi, interaction(alike, apart(12)).sd] == [0.0, 0.0]
