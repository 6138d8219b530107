"""Which scenes a run asks about."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from phyblock.tracks.selection import evenly, highest, spread, stratified

SIZES = st.lists(st.integers(1, 200), min_size=1, max_size=4)


@given(SIZES, st.integers(1, 900))
def test_shares_add_up_and_fit(sizes: list[int], limit: int) -> None:
    shares = stratified(sizes, limit)
    assert sum(shares) == min(limit, sum(sizes))
    assert all(0 <= share <= size for share, size in zip(shares, sizes, strict=True))


@given(SIZES, st.integers(1, 900))
def test_every_level_is_asked_about_where_the_limit_allows(sizes: list[int], limit: int) -> None:
    if limit >= len(sizes):
        assert min(stratified(sizes, limit)) >= 1


@given(SIZES, st.integers(1, 900))
def test_no_other_share_would_be_nearer_to_proportional(sizes: list[int], limit: int) -> None:
    # Webster's law: moving a place from one group to another never brings them nearer. Groups with
    # their first place alone hold it whatever their size.
    shares = stratified(sizes, limit)
    for size, share in zip(sizes, shares, strict=True):
        for other, held in zip(sizes, shares, strict=True):
            if share < size and held >= 2:
                assert (2 * share + 1) * other >= (2 * held - 1) * size


@given(SIZES, st.integers(1, 900))
def test_a_higher_limit_takes_from_no_group(sizes: list[int], limit: int) -> None:
    fewer, more = stratified(sizes, limit), stratified(sizes, limit + 1)
    assert all(a <= b for a, b in zip(fewer, more, strict=True))


@given(st.integers(1, 300), st.data())
def test_positions_are_spread_and_nest(size: int, data: st.DataObject) -> None:
    share = data.draw(st.integers(1, size))
    kept = spread(size, share)
    assert len(kept) == share
    assert set(kept) <= set(spread(size, min(size, share + 1)))
    gaps = [b - a for a, b in pairwise([*kept, size])]
    assert max(gaps) <= 4 * size / share


@given(
    st.lists(
        st.tuples(st.integers(1, 3), st.one_of(st.just(float("nan")), st.floats(-1, 1))),
        min_size=1,
        max_size=40,
    ),
    st.integers(1, 40),
)
def test_the_highest_of_each_level_are_kept_and_nest(
    scenes: list[tuple[int, float]], limit: int
) -> None:
    levels, values = [level for level, _ in scenes], [value for _, value in scenes]
    kept = highest(levels, values, limit)
    assert set(kept) <= set(highest(levels, values, limit + 1))
    assert Counter(levels[i] for i in kept) == Counter(levels[i] for i in evenly(levels, limit))
    for taken in kept:
        for left in set(range(len(levels))) - set(kept):
            if levels[taken] == levels[left] and values[left] == values[left]:
                assert values[taken] >= values[left]
