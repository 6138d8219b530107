"""The design that orders what people are shown is balanced, and every person sees all items."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from phyblock.web.session import Person, arranged, williams_row, williams_rows


@given(st.integers(1, 24))
def test_over_the_rows_every_item_has_every_place_and_every_predecessor_equally_often(
    n: int,
) -> None:
    rows = [williams_row(n, row) for row in range(williams_rows(n))]
    places = Counter((item, place) for row in rows for place, item in enumerate(row))
    follows = Counter(pair for row in rows for pair in pairwise(row))
    assert len(places) == n * n
    assert len(set(places.values())) == 1
    assert len(follows) == n * (n - 1)
    assert len(set(follows.values())) <= 1


@dataclass(frozen=True)
class Thing:
    key: str


@given(st.sets(st.text(max_size=4), max_size=20), st.integers(0, 2**40), st.randoms())
def test_a_row_holds_every_item_once_in_whatever_order_they_come(
    keys: set[str], row: int, random: object
) -> None:
    things = [Thing(key) for key in sorted(keys)]
    mixed = list(things)
    random.shuffle(mixed)  # type: ignore[attr-defined]
    shown = arranged(things, row)  # type: ignore[type-var]
    assert sorted(thing.key for thing in shown) == sorted(keys)
    assert shown == arranged(mixed, row)  # type: ignore[type-var]


def test_a_name_alone_draws_a_row_that_stays() -> None:
    ada, again, bob = (Person(name, None, "May we?").row for name in ("ada", "ada", "bob"))
    assert ada == again != bob
