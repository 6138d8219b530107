"""The cheapest one-to-one assignment of rows to columns (the Hungarian method)."""

from __future__ import annotations

import numpy as np

from phyblock.scoring.ratios import Floats

__all__ = ["cheapest"]


def cheapest(cost: Floats) -> list[tuple[int, int]]:
    """Pairs of row and column of the least total cost, as many as the shorter side has, by row.

    Shortest augmenting paths with potentials (Jonker and Volgenant, *A shortest augmenting path
    algorithm*, Computing 38, 1987). Of equal totals it takes the same one on every machine.
    """
    rows, columns = cost.shape
    if rows > columns:
        return sorted((row, column) for column, row in cheapest(cost.T))
    # Column 0 stands for none, so that all others are numbered from 1.
    owner = np.zeros(columns + 1, dtype=np.intp)
    of_row, of_column = np.zeros(rows + 1), np.zeros(columns + 1)
    for row in range(1, rows + 1):
        owner[0] = row
        least = np.full(columns + 1, np.inf)
        before = np.zeros(columns + 1, dtype=np.intp)
        is_used = np.zeros(columns + 1, dtype=bool)
        at = 0
        while owner[at]:
            is_used[at] = True
            reduced = cost[owner[at] - 1] - of_row[owner[at]] - of_column[1:]
            is_nearer = ~is_used[1:] & (reduced < least[1:])
            least[1:][is_nearer] = reduced[is_nearer]
            before[1:][is_nearer] = at
            after = int(np.where(is_used, np.inf, least)[1:].argmin()) + 1
            step = least[after]
            of_row[owner[is_used]] += step
            of_column[is_used] -= step
            least[~is_used] -= step
            at = after
        while at:
            owner[at] = owner[before[at]]
            at = int(before[at])
    return sorted((int(row) - 1, column) for column, row in enumerate(owner[1:]) if row)
