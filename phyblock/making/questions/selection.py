"""Choosing among drafts: answers are drawn, what a reader sees beside them is evened out.

Drafts of each sort are taken in turns from all scenes, so that none counts for more than another.
Of these, chance leaves out some until the texts of those kept tell nothing of what is right
(`answer_odds`). Of those the greedy choice takes, out of a hundred or so at a time, the one that
evens out best what was taken so far. Where options are texts it goes by what the text itself says
alone, sort, wording and set of options: to choose by the scene as well would choose answers, for
large scenes have larger numbers, and to even out answers would make what is right often in some
questions rare in the others.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from phyblock.making.questions.answer_odds import Texts, keeping_odds
from phyblock.making.questions.question_draft import Draft

__all__ = ["Pooled", "select"]

_LOOKED_AT = 100
_SPREAD = 20
"""So many times the drafts that are wanted of a sort are looked at, where the pool has them,"""
_SPARE = 2
"""and so many times the drafts that are wanted are kept at the least."""
_WEIGHTS = {"kind": 6.0, "wording": 2.0, "options": 0.2, "value": 4.0, "scene": 3.0, "level": 0.3}


@dataclass(frozen=True)
class Pooled:
    """A draft in the pool; `identity` is equal for questions that ask the same of one scene."""

    draft: Draft
    option_texts: tuple[str, ...]

    @property
    def identity(self) -> Hashable:
        """Scene, colors, what is asked about and pictures, but not the words around them."""
        draft = self.draft
        colors = tuple(block.color for block in draft.scene.blocks)
        slots = tuple(sorted((name, str(slot)) for name, slot in _slots(draft).items()))
        options = frozenset(o for o in draft.options if not isinstance(o, str))
        return (draft.scene.id, colors, draft.kind, slots, draft.pictures, options)

    @property
    def texts(self) -> Texts:
        """What a reader without pictures sees."""
        scene = self.draft.scene
        group = (scene.parents or (scene.id,))[0]
        return Texts(group, self.draft.kind, self.draft.text, self.option_texts, self.draft.looks)


def select(pool: Sequence[Pooled], count: int, rng: np.random.Generator) -> list[Pooled]:
    """At most `count` drafts of the pool, no two the same question about the same scene."""
    left = _kept(_spread(pool, count, rng), count, rng)
    tally = _Tally(left)
    taken: list[Pooled] = []
    keys: set[Hashable] = set()
    while left and len(taken) < count:
        size = min(_LOOKED_AT, len(left))
        drawn = rng.choice(len(left), size=size, replace=False).tolist()
        best = min(drawn, key=lambda i: tally.cost(left[i]))
        chosen = left[best]
        left[best] = left[-1]
        left.pop()
        if chosen.identity not in keys:
            keys.add(chosen.identity)
            taken.append(chosen)
            tally.add(chosen)
    return taken


def _spread(pool: Sequence[Pooled], count: int, rng: np.random.Generator) -> list[Pooled]:
    """Drafts of each sort, one of each scene in turns, several times as many as are wanted."""
    turns: dict[str, list[tuple[int, int, Pooled]]] = defaultdict(list)
    of_scene: Counter[tuple[str, str]] = Counter()
    for place, i in enumerate(rng.permutation(len(pool)).tolist()):
        draft = pool[i].draft
        turns[draft.kind].append((of_scene[draft.kind, draft.scene.id], place, pool[i]))
        of_scene[draft.kind, draft.scene.id] += 1
    most = -(-_SPREAD * count // max(len(turns), 1))
    ranked = (sorted(group, key=lambda entry: entry[:2])[:most] for group in turns.values())
    return [one for group in ranked for _, _, one in group]


def _kept(pool: Sequence[Pooled], count: int, rng: np.random.Generator) -> list[Pooled]:
    """The drafts that chance leaves; more likely ones as well where they would be too few."""
    odds = np.array(keeping_odds([one.texts for one in pool]))
    rank = rng.random(len(pool)) / np.maximum(odds, 1e-9)
    least = float(np.sort(rank)[: _SPARE * count][-1]) if len(pool) else 0.0
    return [one for one, place in zip(pool, rank, strict=True) if place <= max(1.0, least)]


class _Tally:
    """What was taken so far, and how much less even a further draft would make it."""

    def __init__(self, pool: Sequence[Pooled]) -> None:
        self._members: dict[Hashable, set[Hashable]] = defaultdict(set)
        self._counts: Counter[tuple[Hashable, Hashable]] = Counter()
        for one in pool:
            for group, member, _ in _even(one):
                self._members[group].add(member)

    def cost(self, one: Pooled) -> float:
        """The lower the better."""
        cost = 0.0
        for group, member, weight in _even(one):
            counts = [self._counts[group, other] for other in self._members[group]]
            cost += weight * (self._counts[group, member] - sum(counts) / len(counts))
        return cost

    def add(self, one: Pooled) -> None:
        """Count a draft as taken."""
        for group, member, _ in _even(one):
            self._counts[group, member] += 1


def _even(one: Pooled) -> Iterator[tuple[Hashable, Hashable, float]]:
    """Groups, the draft's member of each, and weights: members should be equally frequent."""
    draft = one.draft
    yield "kind", draft.kind, _WEIGHTS["kind"]
    yield ("wording", draft.kind), draft.wording, _WEIGHTS["wording"]
    if one.option_texts:
        yield ("options", draft.kind), frozenset(one.option_texts), _WEIGHTS["options"]
        return
    for place, part in enumerate(draft.value.split(", ")):
        yield ("value", draft.kind, place), part, _WEIGHTS["value"]
    yield "scene", draft.scene.id, _WEIGHTS["scene"]
    yield "level", draft.scene.level, _WEIGHTS["level"]


def _slots(draft: Draft) -> Mapping[str, object]:
    slots: Mapping[str, object] = draft.evidence.get("slots", {})
    return slots
