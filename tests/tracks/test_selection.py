"""Which scenes a run asks about."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from phyblock.tracks.selection import stratified

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
def test_shares_are_within_one_of_proportional(sizes: list[int], limit: int) -> None:
    # Exact but for the places given to levels that would have none.
    total = sum(sizes)
    exact = [min(limit, total) * size / total for size in sizes]
    if min(exact) >= 1:
        shares = stratified(sizes, limit)
        assert all(abs(have - want) < 1 for have, want in zip(shares, exact, strict=True))
