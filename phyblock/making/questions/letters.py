"""Which letter is right: drawn, and drawn again until every one is right about as often."""

from __future__ import annotations

import math

import numpy as np

from phyblock.domain.question import LETTERS

__all__ = ["BALANCE", "even_letters"]

BALANCE = (0.22, 0.28)
"""Shares of right answers that every letter is to stay within."""


def even_letters(count: int, rng: np.random.Generator) -> list[int]:
    """Indices of the letters that are right in so many questions, each share within `BALANCE`.

    Of few questions the share that is nearest to it. Exactly equal shares would give the letters
    of some questions away by those of the others.
    """
    # Rounded, as 0.28 of 150 is a little more than 42 in floating point.
    low, high = (round(share * count, 6) for share in BALANCE)
    low, high = math.floor(low), math.ceil(high)
    while True:
        drawn = rng.integers(len(LETTERS), size=count)
        shares = np.bincount(drawn, minlength=len(LETTERS))
        if low <= shares.min() and shares.max() <= high:
            return [int(letter) for letter in drawn]
