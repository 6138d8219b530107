"""Ranks of the right option: as drawn, so that no measure of the pictures gives it away."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from phyblock.making.questions.pictured_drafts import four_alike, ranked_as_drawn

seeds = st.integers(0, 2**32 - 1)


def drawn(seed: int, n: int = 10, measures: int = 4) -> tuple[np.random.Generator, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng, rng.normal(size=(n, measures))


def everywhere(n: int) -> np.ndarray:
    return np.ones((n, n), dtype=bool)


@given(seed=seeds, held=st.integers(0, 3))
def test_a_rank_that_is_held_is_the_one_there_is(seed: int, held: int) -> None:
    rng, measures = drawn(seed)
    chosen = ranked_as_drawn(measures, everywhere(len(measures)), rng, {1: held})
    if chosen:
        below = sum(measures[i, 1] < measures[0, 1] for i in chosen)
        assert abs(below - held) <= 1
        assert len(set(chosen)) == 3
        assert 0 not in chosen


@given(seed=seeds)
def test_only_options_that_are_told_apart_are_taken(seed: int) -> None:
    rng, measures = drawn(seed)
    apart = rng.random((len(measures),) * 2) < 0.6
    apart &= apart.T
    taken = (0, *ranked_as_drawn(measures, apart, rng))
    assert all(apart[a, b] for a in taken for b in taken if a < b)


def test_a_right_option_that_is_extreme_in_the_pool_is_less_so_among_four() -> None:
    """A right one from the upper half would be the most of four in 47 cases of a hundred."""
    ranks = []
    for seed in range(300):
        rng, measures = drawn(seed)
        measures[0, 0] = abs(measures[0, 0])
        chosen = ranked_as_drawn(measures, everywhere(len(measures)), rng)
        if chosen:
            ranks.append(sum(measures[i, 0] < measures[0, 0] for i in chosen))
    shares = np.bincount(ranks, minlength=4) / len(ranks)
    assert len(ranks) > 200
    assert shares.max() < 0.42


@given(seed=seeds, rights=st.integers(1, 4))
def test_four_are_a_right_one_and_three_wrong_ones_all_apart(seed: int, rights: int) -> None:
    rng, measures = drawn(seed)
    apart = rng.random((len(measures),) * 2) < 0.7
    apart &= apart.T
    four = four_alike(measures, apart, rng, rights=rights)
    if four.chosen:
        right, *wrong = four.chosen
        assert right < rights <= min(wrong)
        assert all(apart[a, b] for a in four.chosen for b in four.chosen if a < b)
        ranks = [sum(measures[i, m] < measures[right, m] for i in wrong) for m in range(4)]
        assert np.abs(np.array(four.ranks) - ranks).max() <= 0.5


def test_a_right_one_that_stands_out_in_the_pool_has_any_rank_among_four() -> None:
    """It would be the most of four in 47 cases of a hundred."""
    ranks = []
    for seed in range(300):
        rng, measures = drawn(seed, n=16)
        measures[:4, 0] = np.abs(measures[:4, 0])
        four = four_alike(measures, everywhere(16), rng, rights=4)
        if four.chosen:
            ranks.append(round(four.ranks[0]))
    shares = np.bincount(ranks, minlength=4) / len(ranks)
    assert len(ranks) > 250
    assert shares.max() < 0.39
