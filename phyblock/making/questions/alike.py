"""Wrong pictures that no look at the pictures alone tells from the right one.

Eight measures are taken of every option: how much is colored and where, how far it reaches, how
much changed against the first picture and where. For each a rank of the right option among the
four is drawn beforehand, every rank as likely, and of all sets of three wrong ones that one is
taken which comes nearest to these ranks. Someone who picks the picture with the least change, say,
is then right in one case of four.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.question import QuestionPicture
from phyblock.making.questions.pictured_drafts import LEAST_PIXELS
from phyblock.sim.render import Shot
from phyblock.sim.seeing import changed_pixels, differing_pixels, is_inside, seen

__all__ = ["AREA", "alike_wrong", "looks", "ranked_as_drawn"]

_WRONG = 3
_MOST_POOL = 11
_MOST_OFF = 1.0
"""How many ranks the right option may be off, on average over the measures."""
_EQUAL = 0.02
AREA = 0
"""Place of the measure how much is colored."""
_HELD_OFF = 0.5


def alike_wrong(
    first: QuestionPicture,
    right: QuestionPicture,
    pool: Sequence[QuestionPicture],
    rng: np.random.Generator,
    held: Mapping[int, int] = MappingProxyType({}),
) -> list[QuestionPicture]:
    """Three of the pool, told apart from one another and the rest, or none.

    `held` gives ranks that hold exactly, by measure: `AREA`.
    """
    whole = [one for one in (right, *pool) if is_inside(one)][: 1 + _MOST_POOL]
    if not whole or whole[0] is not right:
        return []
    start, shots = seen(first), [seen(one) for one in whole]
    together = [start, *shots]
    apart = np.zeros((len(together), len(together)), dtype=np.bool_)
    for (i, one), (j, other) in itertools.combinations(enumerate(together), 2):
        # A picture like the first one is none that could be chosen.
        is_worth_it = i == 0 or (apart[0, i] and apart[0, j])
        apart[i, j] = apart[j, i] = is_worth_it and differing_pixels(one, other) >= LEAST_PIXELS
        if (i, j) == (0, 1) and not apart[i, j]:
            return []
    measures = np.array([looks(start, shot) for shot in shots])
    chosen = ranked_as_drawn(measures, apart[1:, 1:], rng, held)
    return [whole[i] for i in chosen]


def ranked_as_drawn(
    measures: NDArray[np.float64],
    apart: NDArray[np.bool_],
    rng: np.random.Generator,
    held: Mapping[int, int] = MappingProxyType({}),
) -> tuple[int, ...]:
    """Three rows after the first, all apart, among which the first has about the ranks drawn.

    `measures` has shape (n, k), `apart` (n, n). `held` gives ranks that hold exactly for some of
    the k measures. Empty where no three come near enough.
    """
    wanted = np.array(rng.integers(_WRONG + 1, size=measures.shape[1]), dtype=np.int64)
    fixed = sorted(held)
    for one in fixed:
        wanted[one] = held[one]
    best: tuple[float, tuple[int, ...]] = (_MOST_OFF, ())
    for chosen in itertools.combinations(range(1, len(measures)), _WRONG):
        if all(apart[a, b] for a, b in itertools.combinations((0, *chosen), 2)):
            off = np.abs(_rank(measures, chosen) - wanted)
            if (off[fixed] <= _HELD_OFF).all():
                best = min(best, (float(off.mean()), chosen))
    return best[1]


def _rank(measures: NDArray[np.float64], chosen: Sequence[int]) -> NDArray[np.float64]:
    """How many of those chosen are below the first in each measure; equal ones count half."""
    step = measures[list(chosen)] - measures[0]
    is_equal = np.abs(step) <= _EQUAL
    below: NDArray[np.float64] = (step < -_EQUAL).sum(axis=0) + is_equal.sum(axis=0) / 2
    return below


def looks(first: Shot, shot: Shot) -> tuple[float, ...]:
    """Eight measures of a picture, most of them shares of its side or of what is colored.

    What is colored: how much, its middle across and down, its width and its top. What changed
    against the first picture: how much, and its middle across and down.
    """
    rows, columns = np.nonzero(shot.block >= 0)
    side, area = len(shot.block), max(int((first.block >= 0).sum()), 1)
    changed_rows, changed_columns = np.nonzero(changed_pixels(first, shot))
    if not len(changed_rows):
        changed_rows, changed_columns = rows, columns
    return (
        5 * len(rows) / area,
        10 * float(columns.mean()) / side,
        10 * float(rows.mean()) / side,
        5 * float(np.ptp(columns)) / side,
        5 * float(rows.min()) / side,
        2 * len(changed_rows) / area,
        2 * float(changed_columns.mean()) / side,
        2 * float(changed_rows.mean()) / side,
    )
