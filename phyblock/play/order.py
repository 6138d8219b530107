"""In which order a person is shown the items of a track: rows of a Williams design.

Over its rows every item stands in every place equally often and follows every other equally often,
so that neither practice nor what came just before favors an item (Williams, E. J. 1949,
"Experimental designs balanced for the estimation of residual effects of treatments", Australian
Journal of Scientific Research A 2, 149-168). An even number of items has as many rows, an odd one
twice as many.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from phyblock.stable import drawn_bytes
from phyblock.tracks import Item

__all__ = ["arranged", "row_of_name", "williams_row", "williams_rows"]

_ItemT = TypeVar("_ItemT", bound=Item)


def williams_rows(n: int) -> int:
    """How many rows the design of `n` items has."""
    return max(1, n if n % 2 == 0 else 2 * n)


def williams_row(n: int, row: int) -> tuple[int, ...]:
    """The items 0 to `n` - 1 in the order of a row, counted from 0; rows begin again at the end."""
    row %= williams_rows(n)
    # Neighbors differ by 1, -2, 3, ...: by every difference but 0, each once.
    first = [(place + 1) // 2 if place % 2 else -place // 2 for place in range(n)]
    turned = [(item + row) % n for item in first]
    return tuple(turned if row < n else reversed(turned))


def row_of_name(name: str) -> int:
    """A row for a person of whom only the name is known: by chance, the same every time."""
    return int.from_bytes(drawn_bytes("row", name)[:6], "big")


def arranged(items: Sequence[_ItemT], row: int) -> tuple[_ItemT, ...]:
    """The items in the order of a row; which of them is which in the design is drawn once for all
    people, by digests of their keys.
    """

    def drawn(item: _ItemT) -> bytes:
        return drawn_bytes("place", item.key)

    mixed = sorted(items, key=drawn)
    return tuple(mixed[place] for place in williams_row(len(mixed), row))
