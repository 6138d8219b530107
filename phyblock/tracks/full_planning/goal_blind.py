"""What is to be won without seeing the goal: plans learned from the candidate sets of other scenes.

A learner says of every unit of a candidate set how likely the goal has one such block, two, and so
on; it has seen scenes that share no base scene with the one it speaks of. A plan names what is
likely enough, low blocks before high ones. What is likely enough, and which learner is believed,
is whatever scores best on the other scenes.
"""

from __future__ import annotations

import functools
import math
from collections import defaultdict
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.domain import CandidateSet, Plan, Scene
from phyblock.scoring import Counts, Goal, match_plan
from phyblock.tracks.full_planning.offered import Unit, units
from phyblock.words import Setting

__all__ = ["FREQUENCIES", "MOST_COPIES", "Learner", "Lesson", "goal_blind_plans", "lessons"]

Floats = NDArray[np.float64]

MOST_COPIES = 6
"""More of one kind are never named."""
_THRESHOLDS = (0.0, 0.08, 0.12, 0.16, 0.2, 0.24, 0.28, 0.33, 0.4, 0.5)
_PRIOR = 4.0
"""So many units of the overall frequency are mixed into every row of a table."""


@dataclass(frozen=True)
class Lesson:
    """A scene to learn from, under a setting.

    `counts[i]` is how many blocks of the goal equal unit i; `heights[i]` the mean layer of these
    blocks over the number of layers, 0..1, not a number where there are none.
    """

    scene: Scene
    candidates: CandidateSet
    units: tuple[Unit, ...]
    counts: tuple[int, ...]
    heights: tuple[float, ...]


Learner = Callable[[Sequence[Lesson], Sequence[Sequence[int]]], list[Floats]]
"""From all lessons, and for each the places of those that it must not be learned from, for each
lesson the chances that the goal has at least 1, 2, ... of each unit, shape (units, MOST_COPIES).
"""


def goal_blind_plans(
    scenes: Sequence[Scene],
    candidates: Mapping[str, CandidateSet],
    setting: Setting,
    learners: Sequence[Learner] | None = None,
) -> dict[str, Plan]:
    """For each scene's id the plan that is expected to score best, by the other scenes.

    No scene that shares a base scene has a part in it. `learners` are the frequency tables unless
    given. A scene that shares a base scene with all others gets every candidate once.
    """
    known = lessons(scenes, candidates, setting)
    related = _related(scenes)
    order = _heights(known, related)
    ways: list[list[Plan]] = []
    for learner in FREQUENCIES if learners is None else learners:
        chances = learner(known, related)
        for least in _THRESHOLDS:
            for copies in (1, MOST_COPIES):
                ways.append(
                    [
                        _plan(lesson, chance[:, :copies], height, least)
                        for lesson, chance, height in zip(known, chances, order, strict=True)
                    ]
                )
    return _best(known, related, ways, setting)


def lessons(
    scenes: Sequence[Scene], candidates: Mapping[str, CandidateSet], setting: Setting
) -> list[Lesson]:
    """Each scene with its candidate set as learners see it."""
    found = []
    for scene in scenes:
        offered = units(candidates[scene.id], setting)
        goal = Goal(scene, candidates[scene.id], setting)
        layers = scene.graph.layers
        equal = [goal.equal_to[unit.number] for unit in offered]
        heights = tuple(
            sum(layers[v] for v in vertices) / len(vertices) / max(layers) if vertices else math.nan
            for vertices in equal
        )
        counts = tuple(len(vertices) for vertices in equal)
        found.append(Lesson(scene, candidates[scene.id], offered, counts, heights))
    return found


def _related(scenes: Sequence[Scene]) -> list[list[int]]:
    """For each scene the places of the scenes that share a base scene with it, its own too."""
    by_parent: dict[str, set[int]] = defaultdict(set)
    for place, scene in enumerate(scenes):
        for parent in (scene.id, *scene.parents):
            by_parent[parent].add(place)
    return [
        sorted(set().union(*(by_parent[parent] for parent in (scene.id, *scene.parents))))
        for scene in scenes
    ]


def _frequencies(
    key: Callable[[Unit], Hashable], known: Sequence[Lesson], related: Sequence[Sequence[int]]
) -> list[Floats]:
    """A table of how often units of one key were needed; rows that were rarely seen are drawn
    towards the overall frequency.
    """
    keys = [[key(unit) for unit in lesson.units] for lesson in known]
    at_least = [_at_least(lesson.counts) for lesson in known]
    return [
        (part[:, 1:] + _PRIOR * whole[1:] / max(whole[0], 1.0)) / (part[:, :1] + _PRIOR)
        for part, whole in _left_out(keys, at_least, related)
    ]


def _left_out(
    keys: Sequence[Sequence[Hashable]],
    values: Sequence[Floats],
    related: Sequence[Sequence[int]],
) -> list[tuple[Floats, Floats]]:
    """For each lesson the sums over unrelated lessons: of the rows with each unit's key, shape
    (units, 1 + columns), and of all rows, shape (1 + columns,); the first column counts rows.
    """
    rows = [np.hstack([np.ones((len(value), 1)), value]) for value in values]
    zero = np.zeros(rows[0].shape[1] if rows else 1)
    table: dict[Hashable, Floats] = defaultdict(lambda: zero.copy())
    for names, one in zip(keys, rows, strict=True):
        for name, row in zip(names, one, strict=True):
            table[name] += row
    whole = sum((one.sum(axis=0) for one in rows), zero)
    found = []
    for names, others in zip(keys, related, strict=True):
        own: dict[Hashable, Floats] = defaultdict(lambda: zero.copy())
        for other in others:
            for name, row in zip(keys[other], rows[other], strict=True):
                own[name] += row
        part = np.array([table[name] - own[name] for name in names]).reshape(len(names), -1)
        found.append((part, whole - sum((rows[other].sum(axis=0) for other in others), zero)))
    return found


def _at_least(counts: Sequence[int]) -> Floats:
    """Whether a count is at least 1, 2, ..., shape (units, MOST_COPIES)."""
    return (np.array(counts)[:, None] >= np.arange(1, MOST_COPIES + 1)).astype(np.float64)


def _heights(known: Sequence[Lesson], related: Sequence[Sequence[int]]) -> list[Floats]:
    """For each lesson the mean height at which blocks of each unit's type and pose stand in
    unrelated scenes, 0..1.
    """
    keys = [
        [(unit.candidate.type, unit.candidate.look[2]) for unit in lesson.units] for lesson in known
    ]
    values = []
    for lesson in known:
        height = np.array(lesson.heights)
        seen = ~np.isnan(height)
        values.append(np.column_stack([seen, np.where(seen, height, 0.0)]).astype(np.float64))
    return [
        (part[:, 2] + whole[2] / max(whole[1], 1.0)) / (part[:, 1] + 1.0)
        for part, whole in _left_out(keys, values, related)
    ]


def _plan(lesson: Lesson, chances: Floats, heights: Floats, least: float) -> Plan:
    """What is at least so likely, from low to high; the likeliest alone where nothing is."""
    named = [
        (heights[unit], copy, lesson.units[unit].number)
        for unit, copy in zip(*np.nonzero(chances >= least), strict=True)
        if least > 0 or copy == 0
    ]
    if not named:
        best = int(chances[:, 0].argmax())
        return Plan((lesson.units[best].number,))
    return Plan(tuple(number for _, _, number in sorted(named)))


def _best(
    known: Sequence[Lesson],
    related: Sequence[Sequence[int]],
    ways: Sequence[Sequence[Plan]],
    setting: Setting,
) -> dict[str, Plan]:
    """For each lesson the plan of the way that scores best on the unrelated ones."""
    score = functools.cache(lambda place, plan: _score(known[place], plan, setting))
    counts = np.array(
        [[score(place, plan) for place, plan in enumerate(way)] for way in ways], dtype=np.int64
    )
    total = counts.sum(axis=1)
    plans = {}
    for place, (lesson, others) in enumerate(zip(known, related, strict=True)):
        tp, wrong = (total - counts[:, list(others)].sum(axis=1)).T
        if not (tp + wrong).any():
            plans[lesson.scene.id] = Plan(tuple(range(1, len(lesson.candidates) + 1)))
            continue
        f1 = 2 * tp / np.maximum(2 * tp + wrong, 1)
        plans[lesson.scene.id] = ways[int(f1.argmax())][place]
    return plans


def _score(lesson: Lesson, plan: Plan, setting: Setting) -> tuple[int, int]:
    """True positives, and false positives with false negatives, of a plan."""
    goal = Goal(lesson.scene, lesson.candidates, setting)
    counts: Counts = match_plan(goal, plan, "optimal").counts
    return counts.tp, counts.fp + counts.fn


_KEYS: tuple[Callable[[Unit], Hashable], ...] = (
    lambda unit: unit.offered,
    lambda unit: unit.number,
    lambda unit: (unit.candidate.type, unit.poses, unit.rank),
    lambda unit: (unit.candidate.type, unit.candidate.color, unit.poses),
    lambda unit: unit.candidate.look,
    lambda unit: (unit.kinds, unit.poses, unit.rank),
    lambda unit: (unit.candidate.type, unit.kinds, unit.alike),
)
FREQUENCIES: tuple[Learner, ...] = tuple(functools.partial(_frequencies, key) for key in _KEYS)
"""Tables of frequencies: over the number of candidates, place, type with poses offered and place
among them, kind with poses offered, look, numbers of kinds with poses, type with numbers of kinds.
"""
