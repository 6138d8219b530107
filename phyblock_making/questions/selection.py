"""Choosing among drafts: even shares of sorts, values and scenes; texts that tell nothing.

Greedy: of a few hundred drafts drawn from the pool, the one is taken that evens out best what was
taken so far. Two rules are at work. Of what should be even (sorts, values in a sort, values given
the set of options, values given a word of the question, wordings, scenes, levels), the rarer is
preferred. And every option text, and every word in one, should be right in one of four cases in
which it is offered: then no reader of texts alone does better than chance.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from phyblock_making.questions.question_draft import Draft

__all__ = ["Pooled", "select"]

_LOOKED_AT = 300
_OPTIONS = 4
_WEIGHTS = {
    "kind": 6.0,
    "value": 4.0,
    "options": 2.0,
    "word": 0.5,
    "wording": 1.0,
    "scene": 3.0,
    "level": 0.3,
}
_RIGHT_WEIGHT = 0.25
_WORD_WEIGHT = 0.04
_WORD = re.compile(r"[\w.]+")


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


def select(pool: Sequence[Pooled], count: int, rng: np.random.Generator) -> list[Pooled]:
    """At most `count` drafts of the pool, no two the same question about the same scene."""
    tally = _Tally(pool)
    left = list(pool)
    taken: list[Pooled] = []
    keys: set[Hashable] = set()
    while left and len(taken) < count:
        size = min(_LOOKED_AT, len(left))
        drawn = sorted(rng.choice(len(left), size=size, replace=False).tolist())
        best = min(drawn, key=lambda i: tally.cost(left[i]))
        chosen = left[best]
        left[best] = left[-1]
        left.pop()
        if chosen.identity not in keys:
            keys.add(chosen.identity)
            taken.append(chosen)
            tally.add(chosen)
    return taken


class _Tally:
    """What was taken so far, and how much less even a further draft would make it."""

    def __init__(self, pool: Sequence[Pooled]) -> None:
        self._members: dict[Hashable, set[Hashable]] = defaultdict(set)
        self._counts: Counter[tuple[Hashable, Hashable]] = Counter()
        self._balance: Counter[Hashable] = Counter()
        for one in pool:
            for group, member, _ in _even(one):
                self._members[group].add(member)

    def cost(self, one: Pooled) -> float:
        """The lower the better."""
        cost = 0.0
        for group, member, weight in _even(one):
            counts = [self._counts[group, other] for other in self._members[group]]
            cost += weight * (self._counts[group, member] - sum(counts) / len(counts))
        for text, step, weight in _right_and_wrong(one):
            cost += weight * step * (2 * self._balance[text] + step)
        return cost

    def add(self, one: Pooled) -> None:
        """Count a draft as taken."""
        for group, member, _ in _even(one):
            self._counts[group, member] += 1
        for text, step, _ in _right_and_wrong(one):
            self._balance[text] += step


def _even(one: Pooled) -> Iterator[tuple[Hashable, Hashable, float]]:
    """Groups, the draft's member of each, and weights: members should be equally frequent."""
    draft = one.draft
    yield "kind", draft.kind, _WEIGHTS["kind"]
    yield ("value", draft.kind), draft.value, _WEIGHTS["value"]
    yield ("options", frozenset(one.option_texts)), draft.value, _WEIGHTS["options"]
    yield ("wording", draft.kind), draft.wording, _WEIGHTS["wording"]
    yield ("value", draft.wording), draft.value, _WEIGHTS["wording"]
    yield "scene", draft.scene.id, _WEIGHTS["scene"]
    yield "level", draft.scene.level, _WEIGHTS["level"]
    for word in sorted(_slot_words(draft)):
        yield ("word", draft.kind, word), draft.value, _WEIGHTS["word"]


def _right_and_wrong(one: Pooled) -> Iterator[tuple[Hashable, int, float]]:
    """Texts and words of options: +3 where right, -1 where wrong, so that chance adds to 0."""
    kind = one.draft.kind
    for i, option in enumerate(one.option_texts):
        step = _OPTIONS - 1 if i == 0 else -1
        yield option, step, _RIGHT_WEIGHT
        yield (kind, option), step, _RIGHT_WEIGHT
        for word in sorted(set(_WORD.findall(option))):
            yield ("word", word), step, _WORD_WEIGHT
            yield ("word", kind, word), step, _WORD_WEIGHT


def _slot_words(draft: Draft) -> set[str]:
    return {word for slot in _slots(draft).values() for word in _WORD.findall(str(slot))}


def _slots(draft: Draft) -> Mapping[str, object]:
    slots: Mapping[str, object] = draft.evidence.get("slots", {})
    return slots
