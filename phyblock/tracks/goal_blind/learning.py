"""What is to be won without seeing the goal: plans learned from the candidate sets of other scenes.

A learner says of every unit of a candidate set how likely the goal has one such block, two, and so
on; it has seen scenes that share no base scene with the one it speaks of. A plan names what is
likely enough. What is likely enough, in which order it is named, and which learner is believed, is
whatever scores best on the other scenes.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phyblock.domain import CandidateSet, Plan, Scene
from phyblock.scoring.plan import most_placed
from phyblock.tracks.goal_blind.lessons import Lesson, left_out, lessons, related
from phyblock.tracks.goal_blind.offered import Unit
from phyblock.types import Setting

__all__ = ["CONSTANT", "FREQUENCIES", "MOST_COPIES", "Learner", "goal_blind_plans"]

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Learner = Callable[[Sequence[Lesson], Sequence[Sequence[int]]], list[Floats]]
"""From all lessons, and for each the places of those that it must not be learned from, for each
lesson the chances that the goal has at least 1, 2, ... of each unit, shape (units, MOST_COPIES).
"""
MOST_COPIES = 6
"""More of one unit are never named."""
_THRESHOLDS = (0.0, 0.1, 0.14, 0.18, 0.23, 0.3, 0.4)
_DIGITS = 9
"""Sums of which a part was taken away again are known so well."""
_PRIOR = 4.0
"""So many units of the overall frequency are mixed into every row of a table."""
_ORDERS: tuple[Callable[[Floats, Ints, Ints], tuple[NDArray[Any], ...]], ...] = (
    lambda height, copy, number: (height, copy, number),
    lambda height, copy, number: (copy, height, number),
    lambda _, copy, number: (copy, number),
)
"""By height; all once by height, then all a second time; the same as they are listed."""


def goal_blind_plans(
    scenes: Sequence[Scene],
    candidates: Mapping[str, CandidateSet],
    setting: Setting,
    learners: Sequence[Learner] | None = None,
    repeats: bool = True,
) -> dict[str, Plan]:
    """For each scene's id the plan that is expected to score best, by the other scenes.

    No scene that shares a base scene is learned from, nor is its score: it has a part only in the
    plans of unrelated scenes, by whose scores one of the ways is chosen. `learners` are the
    frequency tables unless given. Without `repeats` no candidate is named twice. A scene that
    shares a base scene with all others gets every candidate once.
    """
    known, kin = lessons(scenes, candidates, setting), related(scenes)
    ways = list(_ways(known, kin, FREQUENCIES if learners is None else learners, repeats))
    return _best(known, kin, ways)


def _ways(
    known: Sequence[Lesson],
    kin: Sequence[Sequence[int]],
    learners: Sequence[Learner],
    repeats: bool,
) -> Iterator[list[Plan]]:
    """Plans for all lessons, made in one way after another."""
    heights, offers = _heights(known, kin), [_Offer.of(lesson) for lesson in known]
    for learner in learners:
        chances = learner(known, kin)
        for least, order, again in product(_THRESHOLDS, _ORDERS, {False, repeats}):
            yield [
                _plan(offer, chance, height, least, order, again)
                for offer, chance, height in zip(offers, chances, heights, strict=True)
            ]


@dataclass(frozen=True)
class _Offer:
    """By unit and copy, shape (units, MOST_COPIES): the candidate that the copy is named by, and
    whether it is one of its own.
    """

    numbers: Ints
    is_first: NDArray[np.bool_]

    @classmethod
    def of(cls, lesson: Lesson) -> _Offer:
        """What a lesson offers."""
        held = [unit.numbers for unit in lesson.units]
        numbers = [[of[copy % len(of)] for copy in range(MOST_COPIES)] for of in held]
        first = np.arange(MOST_COPIES) < np.array([[len(of)] for of in held])
        return cls(np.array(numbers, dtype=np.intp), first)


def _plan(
    offer: _Offer,
    chances: Floats,
    heights: Floats,
    least: float,
    order: Callable[[Floats, Ints, Ints], tuple[NDArray[Any], ...]],
    again: bool,
) -> Plan:
    """What is at least so likely; every candidate once where `least` is 0, what is likeliest
    where nothing is likely enough.
    """
    least = min(least, chances[:, 0].max())
    likely = chances >= least
    at, copy = np.nonzero(likely if again and least > 0 else likely & offer.is_first)
    numbers = offer.numbers[at, copy]
    keys = order(heights[at], copy, numbers)
    # The last key is the one that lexsort goes by first.
    return Plan(tuple(numbers[np.lexsort(keys[::-1])].tolist()))


def _best(
    known: Sequence[Lesson],
    kin: Sequence[Sequence[int]],
    ways: Sequence[Sequence[Plan]],
) -> dict[str, Plan]:
    """For each lesson the plan made in the way that scores best on the unrelated ones."""

    @functools.cache
    def score(place: int, plan: Plan) -> tuple[int, int]:
        goal = known[place].goal
        tp = most_placed(goal, plan)
        return tp, len(plan) + len(goal.graph) - 2 * tp

    counts = np.array(
        [[score(place, plan) for place, plan in enumerate(way)] for way in ways], dtype=np.int64
    )
    total = counts.sum(axis=1)
    plans = {}
    for place, (lesson, others) in enumerate(zip(known, kin, strict=True)):
        tp, wrong = (total - counts[:, list(others)].sum(axis=1)).T
        if not (tp + wrong).any():
            plans[lesson.scene.id] = Plan(tuple(range(1, len(lesson.candidates) + 1)))
            continue
        f1 = 2 * tp / np.maximum(2 * tp + wrong, 1)
        plans[lesson.scene.id] = ways[int(f1.argmax())][place]
    return plans


def _heights(known: Sequence[Lesson], kin: Sequence[Sequence[int]]) -> list[Floats]:
    """For each lesson the mean height at which blocks of each unit's type and pose stand in
    unrelated scenes, 0..1.
    """
    keys = [[(u.candidate.type, u.candidate.look[2]) for u in lesson.units] for lesson in known]
    values = []
    for lesson in known:
        height = np.array(lesson.heights)
        seen = ~np.isnan(height)
        values.append(np.column_stack([seen, np.where(seen, height, 0.0)]).astype(np.float64))
    return [
        ((part[:, 2] + whole[2] / max(whole[1], 1.0)) / (part[:, 1] + 1.0)).round(_DIGITS)
        for part, whole in left_out(keys, values, kin)
    ]


def _frequencies(
    key: Callable[[Unit], Hashable], known: Sequence[Lesson], kin: Sequence[Sequence[int]]
) -> list[Floats]:
    """A table of how often units of one key were needed; rows that were rarely seen are drawn
    towards the overall frequency.
    """
    keys = [[key(unit) for unit in lesson.units] for lesson in known]
    at_least = [lesson.at_least(MOST_COPIES) for lesson in known]
    return [
        (part[:, 1:] + _PRIOR * whole[1:] / max(whole[0], 1.0)) / (part[:, :1] + _PRIOR)
        for part, whole in left_out(keys, at_least, kin)
    ]


_KEYS: tuple[Callable[[Unit], Hashable], ...] = (
    lambda unit: unit.place,
    lambda unit: (unit.candidate.type, unit.poses, unit.rank),
    lambda unit: (unit.candidate.kind, unit.poses),
    lambda unit: unit.candidate.look,
    lambda unit: (unit.kinds, unit.poses, unit.rank),
    lambda unit: (unit.candidate.type, unit.kinds, unit.alike),
)
FREQUENCIES: tuple[Learner, ...] = tuple(functools.partial(_frequencies, key) for key in _KEYS)
"""Tables of frequencies over place; type, poses offered and place among them; kind and poses
offered; look; numbers of kinds and poses; type and numbers of kinds.
"""
CONSTANT: Learner = functools.partial(_frequencies, lambda _: None)
"""Tells no unit from another: what is to be won by naming all of them equally often."""
