"""A scene as numbers: what `observe="state"` shows beside the progress.

A block is a row of `TRAITS` numbers: 1 where there is a block, the indices of its type and color
in `phyblock.domain.BLOCK_TYPES` and `COLORS`, its Euler angles [degrees], and in the goal the
position of its center [m]. Rows that hold no block are 0.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from phyblock.domain import BLOCK_TYPES, COLORS, MAX_CANDIDATES, Block, Candidate

__all__ = [
    "LARGEST",
    "MOST_BLOCKS",
    "TRAITS",
    "block_rows",
    "candidate_rows",
    "goal_rows",
    "rows_space",
]

MOST_BLOCKS = 64
"""Rows of a goal; built-in ones have 22 blocks at most."""
TRAITS = 9
"""There, type, color, three angles, three coordinates."""
LARGEST = 360.0
"""No number of a row is larger, nor smaller than its negative."""


def rows_space(count: int) -> spaces.Box:
    """Rows of so many blocks, shape (count, TRAITS)."""
    return spaces.Box(-LARGEST, LARGEST, (count, TRAITS), np.float32)


def goal_rows(blocks: Sequence[Block]) -> NDArray[np.float32]:
    """The blocks of a goal in their order, shape (MOST_BLOCKS, TRAITS).

    Raises ValueError for more blocks than there are rows.
    """
    if len(blocks) > MOST_BLOCKS:
        raise ValueError(f"a goal of {len(blocks)} blocks; at most {MOST_BLOCKS} fit in a state")
    return block_rows(blocks)


def block_rows(blocks: Sequence[Block]) -> NDArray[np.float32]:
    """Blocks where they are, the first `MOST_BLOCKS` of them, shape (MOST_BLOCKS, TRAITS)."""
    return _rows(blocks, MOST_BLOCKS)


def candidate_rows(candidates: Sequence[Candidate]) -> NDArray[np.float32]:
    """The candidates by their numbers, the first in row 0, shape (16, TRAITS)."""
    return _rows(candidates, MAX_CANDIDATES)


def _rows(blocks: Sequence[Block] | Sequence[Candidate], most: int) -> NDArray[np.float32]:
    rows = np.zeros((most, TRAITS), dtype=np.float32)
    for row, block in zip(rows, blocks, strict=False):
        position = block.position_m if isinstance(block, Block) else (0.0, 0.0, 0.0)
        look = (BLOCK_TYPES.index(block.type), COLORS.index(block.color))
        row[:] = (1.0, *look, *block.euler_deg, *position)
    return rows
