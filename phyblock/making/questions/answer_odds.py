"""What texts, or looks, alone tell of answers, and which drafts to keep so that they tell nothing.

In any pool of drafts some words are right more often than others: an arch lies on top, a count is
rarely the largest number offered. Evening out what was taken would hide that from a reader of one
half of the questions and hand it, upside down, to a reader of the other. So answers are drawn
instead. A conditional logit (McFadden 1974) tells how likely each option of a draft is to be right
from the texts, learned from drafts about other scenes, and a draft whose options have the
probabilities p is kept with probability min(p) / p[right]. Among those kept that have the same
texts each option is right equally often, whatever it says (rejection sampling), and what is right
in one question tells nothing of the next. Of options that are places the same is done by measures
of where they are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.models.guess_features import text_features

__all__ = ["Texts", "keeping_odds"]

_STEPS = 60
_RATE = 0.3
_PENALTY = 2.0
_FITTED = 2000
"""So many drafts are learned from at most, spread over the pool."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Texts:
    """What a reader without pictures sees of a draft; the right option stands first.

    `group` is equal for drafts about scenes that share parts, `kind` for those that ask the same.
    `looks` are measures of options that are no texts, as many of each.
    """

    group: str
    kind: str
    question: str
    options: tuple[str, ...]
    looks: tuple[tuple[float, ...], ...] = ()

    @property
    def tells(self) -> bool:
        """Whether there is anything to go by."""
        return bool(self.options or self.looks)


@dataclass(frozen=True)
class _Table:
    """Features of options as a sparse matrix: entry `values[i]` at `rows[i]`, `columns[i]`."""

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    values: Floats
    starts: NDArray[np.int64]
    """Where the options of each draft begin, the right one first."""

    def chances(self, weights: Floats) -> Floats:
        """Probability of each option, one after the other."""
        size = int(self.rows[-1]) + 1
        scores = np.bincount(self.rows, self.values * weights[self.columns], size)
        per_draft = np.diff(np.append(self.starts, size))
        raised = np.exp(scores - np.repeat(np.maximum.reduceat(scores, self.starts), per_draft))
        chances: Floats = raised / np.repeat(np.add.reduceat(raised, self.starts), per_draft)
        return chances


def keeping_odds(texts: Sequence[Texts]) -> list[float]:
    """For each draft, with which probability it is kept; 1 where there is nothing to go by."""
    groups = sorted({one.group for one in texts if one.tells})
    half_of = {group: place % 2 for place, group in enumerate(groups)}
    odds = [1.0] * len(texts)
    for half in (0, 1):
        known = [one for one in texts if one.tells and half_of[one.group] != half]
        mine = [i for i, one in enumerate(texts) if one.tells and half_of[one.group] == half]
        if known and mine:
            for i, kept in zip(mine, _judged(known, [texts[i] for i in mine]), strict=True):
                odds[i] = kept
    return odds


def _judged(known: Sequence[Texts], asked: Sequence[Texts]) -> list[float]:
    names: dict[str, int] = {}
    step = -(-len(known) // _FITTED)
    learned = _table(known[::step], names, grows=True)
    weights = _fit(learned, len(names))
    table = _table(asked, names, grows=False)
    chances = table.chances(weights)
    return [float(of_one.min() / of_one[0]) for of_one in np.split(chances, table.starts[1:])]


def _table(texts: Sequence[Texts], names: dict[str, int], grows: bool) -> _Table:
    """The features of all options; unknown ones are added to `names`, or left out."""
    rows, columns, values, starts = [], [], [], []
    row = 0
    for one in texts:
        starts.append(row)
        for features in _features(one):
            for name, value in features.items():
                if not (grows or name in names):
                    continue
                rows.append(row)
                columns.append(names.setdefault(name, len(names)))
                values.append(value)
            row += 1
    return _Table(np.array(rows), np.array(columns), np.array(values), np.array(starts))


def _features(one: Texts) -> Iterator[Mapping[str, float]]:
    """Of each option, as they are and for its kind, with the others it stands beside.

    Of looks, how far each measure is from the mean of the options, in standard deviations.
    """
    if one.looks:
        values = np.array(one.looks)
        spread = values.std(axis=0)
        for steps in (values - values.mean(axis=0)) / np.where(spread > 0, spread, 1.0):
            yield {f"{one.kind}: {i}": step for i, step in enumerate(steps)} | {
                f"{one.kind}: off {i}": abs(step) for i, step in enumerate(steps)
            }
        return
    together = " / ".join(sorted(one.options))
    for option, features in zip(one.options, text_features(one.question, one.options), strict=True):
        own = {f"{one.kind}: {name}": value for name, value in features.items()}
        yield {"": 1.0, **features, **own, f"{one.kind}: {option} of {together}": 1.0}


def _fit(table: _Table, size: int) -> Floats:
    """Weights of greatest penalized likelihood, by steps of AdaGrad (Duchi et al. 2011)."""
    is_right = np.zeros(int(table.rows[-1]) + 1)
    is_right[table.starts] = 1.0
    weights, squares = np.zeros(size), np.full(size, 1e-9)
    for _ in range(_STEPS):
        missed = is_right - table.chances(weights)
        gain = np.bincount(table.columns, table.values * missed[table.rows], size)
        slope = gain - _PENALTY * weights
        squares += slope**2
        weights += _RATE * slope / np.sqrt(squares)
    return weights
