"""Which scenes a run asks about."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from phyblock.tracks.items import spread, stratified

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
