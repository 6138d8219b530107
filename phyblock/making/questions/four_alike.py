"""Three wrong options that no single measure tells from the right one, chosen from many.

Some measures are taken of every option: how large, where, how far off, how unlike the others. Ranks
are drawn as any one option would have them among any four, so that each is as likely and they go
together as they do by nature. Of all sets of a right option and three wrong ones that one is taken
in which the right one comes nearest to these ranks. Someone who picks the option with the least of
a measure is then right in about one case of four.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Four", "four_alike"]

_WRONG = 3
_MOST_OFF = 1.0
"""How many ranks the right option may be off, on average over the measures."""
_EQUAL = 0.02
_UNLIKE_STEPS = 5.0


class Four(NamedTuple):
    """Rows of a right option and three wrong ones, and the right one's ranks by the measures.

    `chosen` is empty where there are no four.
    """

    chosen: tuple[int, ...] = ()
    ranks: tuple[float, ...] = ()

    def halves(self, *measures: int) -> str:
        """Whether the right one is of the lesser or the greater half by each of some measures."""
        return "-".join("less" if self.ranks[i] < _WRONG / 2 else "more" for i in measures)


def four_alike(
    measures: NDArray[np.float64],
    apart: NDArray[np.bool_],
    rng: np.random.Generator,
    *,
    rights: int = 1,
    unlike: NDArray[np.float64] | None = None,
) -> Four:
    """A right row and three wrong ones, all apart, among which it has about the ranks drawn.

    `measures` has shape (n, k), its first `rights` rows are of options that are right. `apart` and
    `unlike` have shape (n, n); where `unlike` is given, the sum over the other three is one more
    measure. No four where none come near.
    """
    if not 0 < rights <= len(measures) - _WRONG:
        return Four()
    wanted = _drawn_ranks(measures, rng, unlike)
    threes = np.array(list(itertools.combinations(range(rights, len(measures)), _WRONG)))
    for i, j in itertools.combinations(range(_WRONG), 2):
        threes = threes[apart[threes[:, i], threes[:, j]]]
    best, nearest = Four(), _MOST_OFF
    for right in range(rights):
        fitting = threes[apart[right][threes].all(axis=1)]
        if not len(fitting):
            continue
        ranks = _ranks(measures, right, fitting, unlike)
        off = np.abs(ranks - wanted).mean(axis=1)
        place = int(off.argmin())
        if off[place] < nearest:
            nearest = float(off[place])
            best = Four((right, *fitting[place].tolist()), tuple(ranks[place].tolist()))
    return best


def _drawn_ranks(
    measures: NDArray[np.float64], rng: np.random.Generator, unlike: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    """The ranks of any one among any four: each rank as likely, by all measures together."""
    one, *others = rng.choice(len(measures), size=_WRONG + 1, replace=False).tolist()
    drawn: NDArray[np.float64] = _ranks(measures, one, np.array([others]), unlike)[0]
    return drawn


def _ranks(
    measures: NDArray[np.float64],
    right: int,
    threes: NDArray[np.int64],
    unlike: NDArray[np.float64] | None,
) -> NDArray[np.float64]:
    """How many of each three are below the right one, by measure; equal ones count half."""
    steps = measures[threes] - measures[right]
    if unlike is not None:
        four = np.column_stack([np.full(len(threes), right), threes])
        sums = unlike[four[:, :, None], four[:, None, :]].sum(axis=2)
        scale = max(float(unlike.max()), 1.0) / _UNLIKE_STEPS
        odd = (sums[:, 1:] - sums[:, :1]) / scale
        steps = np.concatenate([steps, odd[:, :, None]], axis=2)
    below: NDArray[np.float64] = (steps < -_EQUAL).sum(axis=1) + (np.abs(steps) <= _EQUAL).sum(
        axis=1
    ) / 2
    return below
