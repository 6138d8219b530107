"""What a candidate set shows before the goal is seen: its units, and what is to be told of each."""

from __future__ import annotations

import functools
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phyblock.data import AssemblyTask
from phyblock.domain import BLOCK_TYPES, COLORS, Candidate, CandidateSet, Kind, Plan, Scene
from phyblock.scoring.plan import Goal, most_placed
from phyblock.tracks.showing import Showing, ShownTask, TaskShowing
from phyblock.types import CandidateOrder, Setting


@dataclass(frozen=True)
class Unit:
    """What a setting takes for one thing: a candidate in A, all candidates of a kind in B.

    `numbers` are those of its candidates, `candidate` the first of them. `poses` is how many
    candidates its kind has, `rank` its place among them from 0, `kinds` and `offered` how many
    kinds and candidates the whole set has, `alike` how many kinds of its type.
    """

    numbers: tuple[int, ...]
    candidate: Candidate
    poses: int
    rank: int
    kinds: int
    offered: int
    alike: int

    @property
    def place(self) -> int:
        """The number of its first candidate, from 1."""
        return self.numbers[0]

    @property
    def features(self) -> tuple[float, ...]:
        """All of it as numbers, 17 of them, for learners that take no words."""
        one = self.candidate
        known = (self.place, self.poses, self.rank, self.kinds, self.offered, self.alike)
        words = (BLOCK_TYPES.index(one.type), COLORS.index(one.color))
        return (*map(float, (*known, *words)), *one.look[2])


def units(candidates: CandidateSet, setting: Setting) -> tuple[Unit, ...]:
    """The units of a candidate set under a setting, by their numbers."""
    numbers: dict[Kind, list[int]] = {}
    for number, one in enumerate(candidates.candidates, 1):
        numbers.setdefault(one.kind, []).append(number)
    alike = Counter(block_type for block_type, _ in numbers)
    made = []
    for number, one in enumerate(candidates.candidates, 1):
        same = numbers[one.kind]
        rank = same.index(number)
        if setting == "A" or rank == 0:
            named = (number,) if setting == "A" else tuple(same)
            shown = (len(same), rank, len(numbers), len(candidates), alike[one.type])
            made.append(Unit(named, one, *shown))
    return tuple(made)


Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Lesson:
    """A scene to learn from, under a setting.

    `counts[i]` is how many blocks of the goal equal unit i; `heights[i]` the mean layer of these
    blocks over the number of layers, 0..1, not a number where there are none.
    """

    scene: Scene
    candidates: CandidateSet
    goal: Goal
    units: tuple[Unit, ...]
    counts: tuple[int, ...]
    heights: tuple[float, ...]

    def at_least(self, most: int) -> Floats:
        """Whether the goal has at least 1, 2, ... `most` of each unit, shape (units, most)."""
        return (np.array(self.counts)[:, None] >= np.arange(1, most + 1)).astype(np.float64)


def lessons(
    scenes: Sequence[Scene], candidates: Mapping[str, CandidateSet], setting: Setting
) -> list[Lesson]:
    """Each scene with its candidate set, which `candidates` has by the scene's id."""
    made = []
    for scene in scenes:
        offered = units(candidates[scene.id], setting)
        goal = Goal(scene, candidates[scene.id], setting)
        equal = [goal.equal_to[unit.place] for unit in offered]
        heights = tuple(_height(scene, vertices) for vertices in equal)
        counts = tuple(len(vertices) for vertices in equal)
        made.append(Lesson(scene, candidates[scene.id], goal, offered, counts, heights))
    return made


def related(scenes: Sequence[Scene]) -> list[list[int]]:
    """For each scene the places of the scenes that share a base scene with it, its own too."""
    by_parent: dict[str, set[int]] = defaultdict(set)
    for place, scene in enumerate(scenes):
        for parent in (scene.id, *scene.parents):
            by_parent[parent].add(place)
    return [
        sorted(set().union(*(by_parent[parent] for parent in (scene.id, *scene.parents))))
        for scene in scenes
    ]


def left_out(
    keys: Sequence[Sequence[Hashable]],
    values: Sequence[Floats],
    kin: Sequence[Sequence[int]],
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
    sums = []
    for names, others in zip(keys, kin, strict=True):
        own: dict[Hashable, Floats] = defaultdict(lambda: zero.copy())
        for other in others:
            for name, row in zip(keys[other], rows[other], strict=True):
                own[name] += row
        part = np.array([table[name] - own[name] for name in names]).reshape(len(names), -1)
        sums.append((part, whole - sum((rows[other].sum(axis=0) for other in others), zero)))
    return sums


def _height(scene: Scene, vertices: Sequence[int]) -> float:
    layers = scene.graph.layers
    if not vertices:
        return math.nan
    return sum(layers[vertex] for vertex in vertices) / len(vertices) / max(layers)


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


class BlindGuesses:
    """The goal-blind plans of tasks, learned from all of `pool` in the form that each seed shows.

    A place in the list tells something only where the order is the file's, so plans are learned
    anew for every order.
    """

    def __init__(
        self, showing: TaskShowing, pool: Sequence[AssemblyTask], setting: Setting
    ) -> None:
        self._order = showing.how.order
        self._pool = pool
        self._setting = setting
        self._plans: dict[int, dict[str, Plan]] = {}

    def plan(self, task: AssemblyTask) -> Plan:
        """The plan for a task of the pool as it is shown, in the numbers that are shown."""
        is_shuffled = self._order == "shuffled"
        seed = task.seed if is_shuffled and isinstance(task, ShownTask) else 0
        if seed not in self._plans:
            self._plans[seed] = _learned(tuple(self._pool), self._order, seed, self._setting)
        return self._plans[seed][task.key]


@functools.lru_cache(maxsize=8)
def _learned(
    pool: tuple[AssemblyTask, ...], order: CandidateOrder, seed: int, setting: Setting
) -> dict[str, Plan]:
    """Plans for all of `pool` by name; ways of asking that show the same order share them."""
    # A goal is not learned from, whichever is shown.
    showing = TaskShowing(Showing(order))
    shown = [showing.of(one, seed) for one in pool]
    candidates = {one.key: one.candidates for one in shown}
    return goal_blind_plans([one.scene for one in shown], candidates, setting)
