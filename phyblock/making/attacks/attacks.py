"""The list of attacks, and what each reaches on a set, with the aim that it is held against.

An attack likes some options of a question more than others. Whoever knows of it can pick what it
likes most as well as what it likes least, so both are counted, and the better one is judged.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from phyblock.domain.question import SUBTASKS, Question, Subtask
from phyblock.making.attacks.cues import CUES, Floats
from phyblock.making.attacks.observed import RULES, Observed, credit, kind_of
from phyblock.making.attacks.probes import (
    Likes,
    boosted_cues,
    linear_cues,
    text_within,
    unseen_text,
)
from phyblock.scoring.ratios import ratio_of
from phyblock.scoring.uncertainty import Clusters, in_range, jackknife
from phyblock.stable import plain_sum

__all__ = [
    "ATTACKS",
    "UNSEEN_TEXT",
    "Attack",
    "Attacked",
    "Rate",
    "Verdict",
    "all_attacks",
    "attack",
    "by_cue",
    "by_rule",
]

UNSEEN_TEXT = "text, unseen set"
"""The attack that learns from another set alone."""
Verdict = Literal["met", "over, in noise", "missed"]
"""At most the aim; above it, but the interval reaches down to it; or all of it above."""

_PICTURES, _TEXTS, _INVERTED_TEXTS, _NAIVE = 0.35, 0.30, 0.33, 0.60
_ORDERS = 0.12
"""Aims: the largest share of right answers that an attack may reach; `_ORDERS` of orderings."""
_FEWEST = 25
"""Questions of a kind that are judged apart."""


@dataclass(frozen=True)
class Attack:
    """A way to answer without understanding.

    `likes` gives each question a liking for each option, or None where it has no say; `aim` is
    what picking the most liked option may reach, `aim_inverted` what picking the least liked may:
    None where nobody would. `rule` says what it goes by.
    """

    name: str
    rule: str
    likes: Likes
    aim: float = _PICTURES
    aim_inverted: float | None = _PICTURES
    is_of_texts: bool = False


class Rate(NamedTuple):
    """A share of right answers, with its 95 % interval over base scenes."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Attacked:
    """What an attack reaches on `n` questions: of a subtask, of one kind of it, or of all.

    `subtask` is empty for all, `kind` for all kinds. `most` and `least` are by picking what is
    liked most and least; of orderings `most` is the way round that is right more often in each
    kind, as its text tells which is asked.
    """

    attack: Attack
    subtask: Subtask | Literal[""]
    kind: str
    n: int
    chance: float
    most: Rate
    least: Rate
    aim: float
    aim_inverted: float | None

    @property
    def sides(self) -> tuple[tuple[Rate, float], ...]:
        """Both ways to read the attack, or the one that there is, with their aims."""
        if self.aim_inverted is None:
            return ((self.most, self.aim),)
        return ((self.most, self.aim), (self.least, self.aim_inverted))

    @property
    def best(self) -> tuple[Rate, float]:
        """The way that is right more often, with its aim."""
        return max(self.sides, key=lambda side: side[0].value)

    @property
    def verdict(self) -> Verdict:
        """The worse one of both ways."""
        return max((_verdict(rate, aim) for rate, aim in self.sides), key=_VERDICTS.index)


_VERDICTS: tuple[Verdict, ...] = ("met", "over, in noise", "missed")


def by_cue(name: str) -> Likes:
    """The numbers of one cue; raises ValueError for a name that no cue has."""
    if name not in CUES:
        raise ValueError(f"{name!r} is no cue; there are {', '.join(CUES)}")
    return lambda observed: [one.cues.get(name) for one in observed]


def by_rule(name: str) -> Likes:
    """The likings by one rule; raises ValueError for a name that no rule has."""
    if name not in RULES:
        raise ValueError(f"{name!r} is no rule; there are {', '.join(RULES)}")
    return lambda observed: [one.rules.get(name) for one in observed]


ATTACKS: tuple[Attack, ...] = (
    Attack("area", "colored area of the option's picture", by_cue("colored area")),
    Attack("colors", "how far its colors are from the scene's", by_cue("colors unlike the scene")),
    Attack("change", "pixels that differ from the scene", by_cue("unlike the scene")),
    Attack("odd one out", "pixels that differ from other options", by_cue("unlike the others")),
    Attack("central", "the mark's distance from the middle of its block", by_cue("off center")),
    Attack("central and flat", "the same, on level faces first", by_cue("off center or not level")),
    Attack("alone", "the mark's distance from the other three", by_cue("apart from the others")),
    Attack("linear probe", "ridge regression on all cues, by folds", linear_cues),
    Attack("boosted probe", "gradient boosting on all cues, by folds", boosted_cues),
    Attack("support", "what rests on X moves, nothing else", by_rule("support"), _NAIVE, None),
    Attack(
        "sole support",
        "what rests on X and on nothing else moves",
        by_rule("sole support"),
        *(_NAIVE, None),
    ),
)
"""Those that look at pictures and need no other set."""


def all_attacks(unseen: Sequence[Question] = (), *, with_texts: bool = True) -> tuple[Attack, ...]:
    """The attacks, those by texts included; the one that learns from `unseen` where there are any.

    Without `with_texts` those are left out that need scikit-learn.
    """
    if not with_texts:
        return tuple(one for one in ATTACKS if one.likes is not boosted_cues)
    within = Attack(
        *("text, within the set", "a classifier of texts, by folds", text_within),
        *(_TEXTS, _INVERTED_TEXTS, True),
    )
    what = "the same, learned from the other set alone"
    beyond = Attack(UNSEEN_TEXT, what, unseen_text(unseen), _TEXTS, _INVERTED_TEXTS, True)
    return (*ATTACKS, within, *([beyond] if unseen else []))


def attack(one: Attack, observed: Sequence[Observed]) -> Iterator[Attacked]:
    """What an attack reaches, by subtask and by kind; of texts also on all questions together.

    Raises SpecError for a probe that needs scikit-learn where that is not installed.
    """
    tried = [
        (seen.question, likings)
        for seen, likings in zip(observed, one.likes(observed), strict=True)
        if likings is not None
    ]
    if not tried:
        return
    questions = [question for question, _ in tried]
    sides = _sides(tried)
    if one.is_of_texts:
        yield _attacked(one, "", "", questions, sides)
    for subtask in SUBTASKS:
        mine = [place for place, question in enumerate(questions) if question.subtask == subtask]
        kinds = list(dict.fromkeys(kind_of(questions[place]) for place in mine))
        groups = [("", mine)] if mine else []
        for kind in kinds if len(kinds) > 1 and not one.is_of_texts else ():
            of_kind = [place for place in mine if kind_of(questions[place]) == kind]
            groups += [(kind, of_kind)] if len(of_kind) >= _FEWEST else []
        for kind, places in groups:
            some = [questions[place] for place in places]
            yield _attacked(one, subtask, kind, some, sides[places])


def _sides(tried: Sequence[tuple[Question, Floats]]) -> Floats:
    """Credits, shape (questions, 2), for picking what is liked most and least."""
    sides = np.array(
        [
            [credit(likings, question.answer), credit(-likings, question.answer)]
            for question, likings in tried
        ]
    )
    orders: dict[str, list[int]] = {}
    for place, (question, _) in enumerate(tried):
        if question.subtask == "OR":
            orders.setdefault(kind_of(question), []).append(place)
    for places in orders.values():
        most, least = sides[places].sum(axis=0)
        if least > most:
            sides[places] = sides[places][:, ::-1]
    return sides


def _attacked(
    one: Attack,
    subtask: Subtask | Literal[""],
    kind: str,
    questions: Sequence[Question],
    sides: Floats,
) -> Attacked:
    clusters = Clusters.of(
        [question.scene.parents or (question.scene.id,) for question in questions]
    )
    counts = np.stack([sides, np.ones_like(sides)], axis=-1)
    estimate = in_range(jackknife(counts, clusters, ratio_of))
    most, least = (
        Rate(float(estimate.value[side]), float(estimate.lo[side]), float(estimate.hi[side]))
        for side in (0, 1)
    )
    is_order = subtask == "OR"
    chances = [1 / math.factorial(len(q.answer)) if is_order else 1 / len(q.options)
               for q in questions]  # fmt: skip
    return Attacked(
        one,
        subtask,
        kind,
        len(questions),
        plain_sum(chances) / len(chances),
        most,
        least,
        _ORDERS if is_order else one.aim,
        _ORDERS if is_order and one.aim_inverted is not None else one.aim_inverted,
    )


def _verdict(rate: Rate, aim: float) -> Verdict:
    if rate.value <= aim:
        return "met"
    return "over, in noise" if rate.low <= aim else "missed"
