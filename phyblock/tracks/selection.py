"""Selection of the scenes that a run asks about, and the order in which they are asked."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from phyblock.data import AssemblyTask
from phyblock.tracks.base import ItemT


def select_tasks(
    tasks: Sequence[AssemblyTask],
    levels: Sequence[int],
    limit: int | None,
) -> tuple[AssemblyTask, ...]:
    """Return the tasks counted in any of `levels`, at most `limit` of them, in their order.

    They are evenly spread, and a higher limit keeps all that a lower one keeps.
    """
    chosen = [task for task in tasks if set(task.scene.levels) & set(levels)]
    if limit is None or limit >= len(chosen):
        return tuple(chosen)
    kept = set(evenly([task.scene.level for task in chosen], limit))
    return tuple(task for position, task in enumerate(chosen) if position in kept)


def evenly(strata: Sequence[int], limit: int) -> list[int]:
    """Return `limit` positions, shared among the strata and evenly spread in each."""
    return sorted(_fair_order(strata)[:limit])


def interleaved(items: Sequence[ItemT]) -> list[ItemT]:
    """Return items in an order in which any first few are a fair sample of levels and scenes."""
    return [items[position] for position in _fair_order([item.scene.level for item in items])]


def _fair_order(strata: Sequence[int]) -> list[int]:
    """Return all positions: strata in turn by their sizes, positions of each evenly spread.

    Every stratum gets one place before any gets two; then each place goes to the stratum that has
    least for its size (Webster's method, which is monotone in the number of places).
    """
    members: dict[int, list[int]] = {}
    for position, stratum in enumerate(strata):
        members.setdefault(stratum, []).append(position)
    places = sorted(
        (rank > 0, Fraction(2 * rank + 1, len(of_stratum)), stratum, of_stratum[place])
        for stratum, of_stratum in members.items()
        for rank, place in enumerate(_spread_out(len(of_stratum)))
    )
    return [position for *_, position in places]


def spread(size: int, share: int) -> list[int]:
    """`share` of the positions 0 to `size` - 1, evenly spread; more hold all that fewer hold."""
    return sorted(_spread_out(size)[:share])


def _spread_out(size: int) -> list[int]:
    """The positions 0 to `size` - 1 in an order in which any first few are evenly spread.

    They are taken at 0, 1/2, 1/4, 3/4, 1/8, ... of the size: the sequence of van der Corput (1935).
    """
    digits = max(1, (size - 1).bit_length())
    parts = (int(f"{i:0{digits}b}"[::-1], 2) for i in range(2**digits))
    return list(dict.fromkeys(part * size // 2**digits for part in parts))


def stratified(sizes: Sequence[int], limit: int) -> list[int]:
    """`limit` places shared among groups of the given sizes; a higher limit takes from none.

    Every group gets one place before any gets two; then each place goes to the group that has
    least for its size (Webster's method, which is monotone in the number of places). None gets
    more than its size.
    """
    places = sorted(
        (rank > 0, Fraction(2 * rank + 1, size), group)
        for group, size in enumerate(sizes)
        for rank in range(size)
    )
    shares = [0] * len(sizes)
    for _, _, group in places[:limit]:
        shares[group] += 1
    return shares
