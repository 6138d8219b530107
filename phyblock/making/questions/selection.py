"""Choosing among drafts: answers are drawn, what a reader sees beside them is evened out.

Drafts of each sort are taken in turns from all scenes, so that none counts for more than another.
Of these, chance leaves out some until the texts of those kept tell nothing of what is right
(`keeping_odds`). Of those the greedy choice takes, out of a hundred or so at a time, the one that
evens out best what was taken so far. Where options are texts it goes by what the text itself says
alone, sort, wording and set of options: to choose by the scene as well would choose answers, for
large scenes have larger numbers, and to even out answers would make what is right often in some
questions rare in the others.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.question import LETTERS
from phyblock.making.questions.base import Draft
from phyblock.tracks.baselines import text_features

_LOOKED_AT = 100
_SPREAD = 20
"""So many times the drafts that are wanted of a sort are looked at, where the pool has them,"""
_SPARE = 2
"""and so many times the drafts that are wanted are kept at the least."""
_WEIGHTS = {"kind": 6.0, "wording": 2.0, "options": 0.2, "value": 4.0, "scene": 3.0, "level": 0.3}


def select(pool: Sequence[Draft], count: int, rng: np.random.Generator) -> list[Draft]:
    """At most `count` drafts of the pool, no two the same question about the same scene."""
    left = _kept(_spread(pool, count, rng), count, rng)
    members: dict[Hashable, set[Hashable]] = defaultdict(set)
    for one in left:
        for group, member, _ in _even(one):
            members[group].add(member)
    counts: Counter[tuple[Hashable, Hashable]] = Counter()

    def cost(one: Draft) -> float:
        """The unevenness that a further draft adds to those taken; the lower the better."""
        cost = 0.0
        for group, member, weight in _even(one):
            others = [counts[group, other] for other in members[group]]
            cost += weight * (counts[group, member] - sum(others) / len(others))
        return cost

    taken: dict[Hashable, Draft] = {}
    while left and len(taken) < count:
        size = min(_LOOKED_AT, len(left))
        drawn = rng.choice(len(left), size=size, replace=False).tolist()
        best = min(drawn, key=lambda i: cost(left[i]))
        chosen = left[best]
        left[best] = left[-1]
        left.pop()
        if _identity(chosen) not in taken:
            taken[_identity(chosen)] = chosen
            counts.update((group, member) for group, member, _ in _even(chosen))
    return list(taken.values())


def _spread(pool: Sequence[Draft], count: int, rng: np.random.Generator) -> list[Draft]:
    """Drafts of each sort, one of each scene in turns, several times as many as are wanted."""
    turns: dict[str, list[tuple[int, int, Draft]]] = defaultdict(list)
    of_scene: Counter[tuple[str, str]] = Counter()
    for place, i in enumerate(rng.permutation(len(pool)).tolist()):
        draft = pool[i]
        turns[draft.kind].append((of_scene[draft.kind, draft.scene.id], place, draft))
        of_scene[draft.kind, draft.scene.id] += 1
    most = -(-_SPREAD * count // max(len(turns), 1))
    ranked = (sorted(group, key=lambda entry: entry[:2])[:most] for group in turns.values())
    return [one for group in ranked for _, _, one in group]


def _kept(pool: Sequence[Draft], count: int, rng: np.random.Generator) -> list[Draft]:
    """The drafts that chance leaves; more likely ones as well where they would be too few."""
    odds = np.array(keeping_odds(pool))
    rank = rng.random(len(pool)) / np.maximum(odds, 1e-9)
    least = float(np.sort(rank)[: _SPARE * count][-1]) if len(pool) else 0.0
    return [one for one, place in zip(pool, rank, strict=True) if place <= max(1.0, least)]


def _even(draft: Draft) -> Iterator[tuple[Hashable, Hashable, float]]:
    """Groups, the draft's member of each, and weights: members should be equally frequent."""
    yield "kind", draft.kind, _WEIGHTS["kind"]
    yield ("wording", draft.kind), draft.wording, _WEIGHTS["wording"]
    if texts := _texts(draft):
        yield ("options", draft.kind), frozenset(texts), _WEIGHTS["options"]
        return
    for place, part in enumerate(draft.value.split(", ")):
        yield ("value", draft.kind, place), part, _WEIGHTS["value"]
    yield "scene", draft.scene.id, _WEIGHTS["scene"]
    yield "level", draft.scene.level, _WEIGHTS["level"]


def _texts(draft: Draft) -> tuple[str, ...]:
    """The options as texts; of pictures and places, whose texts tell nothing, none."""
    return tuple(option for option in draft.options if isinstance(option, str))


def _identity(draft: Draft) -> Hashable:
    """Scene, colors, what is asked about and pictures, but not the words around them."""
    colors = tuple(block.color for block in draft.scene.blocks)
    slots = sorted((name, str(slot)) for name, slot in draft.evidence.get("slots", {}).items())
    options = frozenset(option for option in draft.options if not isinstance(option, str))
    return (draft.scene.id, colors, draft.kind, tuple(slots), draft.pictures, options)


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


_STEPS, _RATE, _PENALTY = 60, 0.3, 2.0
_FITTED = 2000
"""So many drafts are learned from at most, spread over the pool."""
Floats = NDArray[np.float64]


class _Table(NamedTuple):
    """Features of options as a sparse matrix: entry `values[i]` at `rows[i]`, `columns[i]`.

    `starts` are the rows at which the options of each draft begin, the right one first.
    """

    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    values: Floats
    starts: NDArray[np.int64]

    def chances(self, weights: Floats) -> Floats:
        """Probability of each option, one after the other."""
        size = int(self.rows[-1]) + 1
        scores = np.bincount(self.rows, self.values * weights[self.columns], size)
        per_draft = np.diff(np.append(self.starts, size))
        raised = np.exp(scores - np.repeat(np.maximum.reduceat(scores, self.starts), per_draft))
        chances: Floats = raised / np.repeat(np.add.reduceat(raised, self.starts), per_draft)
        return chances


def keeping_odds(drafts: Sequence[Draft]) -> list[float]:
    """The probability with which each draft is kept; 1 where there is nothing to guess by.

    A reader without pictures learns from half of the base scenes, and guesses at the other half.
    """
    group_of = [(one.scene.parents or (one.scene.id,))[0] for one in drafts]
    telling = [i for i, one in enumerate(drafts) if _texts(one) or one.looks]
    half_of = {g: n % 2 for n, g in enumerate(sorted({group_of[i] for i in telling}))}
    halves = [[i for i in telling if half_of[group_of[i]] == half] for half in (0, 1)]
    odds = [1.0] * len(drafts)
    for mine, known in (halves, halves[::-1]) if all(halves) else ():
        names: dict[str, int] = {}
        learned = _table([drafts[i] for i in known[:: -(-len(known) // _FITTED)]], names, True)
        weights = _fit(learned, len(names))
        asked = _table([drafts[i] for i in mine], names, False)
        of_each = np.split(asked.chances(weights), asked.starts[1:])
        for i, chances in zip(mine, of_each, strict=True):
            odds[i] = float(chances.min() / chances[0])
    return odds


def _table(drafts: Sequence[Draft], names: dict[str, int], grows: bool) -> _Table:
    """The features of all options; unknown ones are added to `names`, or dropped."""
    rows, columns, values, starts = [], [], [], []
    row = 0
    for one in drafts:
        starts.append(row)
        for features in _features(one):
            for name, value in features.items():
                if grows or name in names:
                    rows.append(row)
                    columns.append(names.setdefault(name, len(names)))
                    values.append(value)
            row += 1
    return _Table(np.array(rows), np.array(columns), np.array(values), np.array(starts))


def _features(one: Draft) -> Iterator[Mapping[str, float]]:
    """Of each option, as they are and for its kind, with the others it stands beside."""
    if one.looks:
        # How far each measure is from the mean of the options, in standard deviations.
        values = np.array(one.looks)
        spread = values.std(axis=0)
        for steps in (values - values.mean(axis=0)) / np.where(spread > 0, spread, 1.0):
            yield {f"{one.kind}: {i}": step for i, step in enumerate(steps)} | {
                f"{one.kind}: off {i}": abs(step) for i, step in enumerate(steps)
            }
        return
    options = _texts(one)
    together = " / ".join(sorted(options))
    for option, features in zip(options, text_features(one.text, options), strict=True):
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
