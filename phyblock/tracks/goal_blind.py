"""Plans made without seeing the goal, from how often blocks like each candidate are needed.

They may also use how much of each color the picture of the goal shows, and nothing else in it. The
plan of a scene never uses scenes that share a base scene with it.
"""

from __future__ import annotations

import functools
import math
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from phyblock.config.suite import Suite
from phyblock.domain.scene import AssemblyTask, Candidate, CandidateSet, Kind, Plan, Scene
from phyblock.scoring.plan import Goal, most_placed
from phyblock.sim.pictures import PictureStyle, goal_camera, segments
from phyblock.tracks.base import presented
from phyblock.types import CandidateOrder, Setting, View

Floats = NDArray[np.float64]
_MOST_COPIES = 6
"""The most times that one unit is named."""
_PRIOR = 4.0
"""Weight of the overall frequency in every row of a table, in units."""
_THRESHOLDS = (0.0, 0.1, 0.14, 0.18, 0.23, 0.3, 0.4)
_SIDE_PX = 128
"""Side of the pictures in which colors are measured [pixels]."""
Areas = Mapping[str, float]
"""Share of each color in the area of blocks in a picture; colors that it does not show are absent.
"""


@dataclass(frozen=True)
class Unit:
    """A group of candidates that are equal under a setting: one in A, all of a kind in B.

    `numbers` are those of its candidates, `candidate` is the first of them. `poses` is how many
    candidates its kind has, `rank` its place among them from 0. `area` is the share of its color in
    the picture of the goal, if known.
    """

    numbers: tuple[int, ...]
    candidate: Candidate
    poses: int
    rank: int
    area: float = 0.0


Key = Callable[[Unit], Hashable]
KEYS: tuple[Key, ...] = (
    lambda unit: unit.candidate.look,
    lambda unit: (unit.candidate.type, unit.poses, unit.rank),
)
"""Rows of the table of frequencies: looks; types by the poses offered and the place among them."""
AREA_KEYS: tuple[Key, ...] = (
    lambda unit: math.ceil(10 * unit.area),
    lambda unit: (math.ceil(10 * unit.area), unit.candidate.type),
)
"""Rows where areas are known: tenths of the color, 0 for none; the same by type."""


def units(candidates: CandidateSet, setting: Setting, areas: Areas | None = None) -> list[Unit]:
    """Return the units of a candidate set under a setting, by their numbers."""
    numbers_of: dict[Kind, list[int]] = defaultdict(list)
    for number, one in enumerate(candidates.candidates, 1):
        numbers_of[one.kind].append(number)
    made = []
    for number, one in enumerate(candidates.candidates, 1):
        same = tuple(numbers_of[one.kind])
        if setting == "A" or number == same[0]:
            numbers, area = (number,) if setting == "A" else same, (areas or {}).get(one.color, 0.0)
            made.append(Unit(numbers, one, len(same), same.index(number), area))
    return made


def related(scenes: Sequence[Scene]) -> list[list[int]]:
    """Return for each scene the places of scenes that share a base scene with it, its own too."""
    bases = [{scene.id, *scene.parents} for scene in scenes]
    by_base: dict[str, set[int]] = defaultdict(set)
    for place, names in enumerate(bases):
        for name in names:
            by_base[name].add(place)
    return [sorted(set().union(*(by_base[name] for name in names))) for names in bases]


def goal_blind_plans(
    scenes: Sequence[Scene],
    candidates: Mapping[str, CandidateSet],
    setting: Setting,
    keys: Sequence[Key] = KEYS,
    repeats: bool = True,
    areas: Mapping[str, Areas] | None = None,
) -> dict[str, Plan]:
    """Return for each scene a plan learned from unrelated scenes.

    Every combination of key, threshold and order is a way to make plans; each scene uses the way
    that scores best on the unrelated scenes. Without `repeats` no candidate is named twice. `areas`
    are those of the colors of each goal, by scene.
    """
    if not scenes:
        return {}
    kin, seen = related(scenes), areas or {}
    goals = [Goal(scene, candidates[scene.id], setting) for scene in scenes]
    offered = [units(candidates[one.id], setting, seen.get(one.id)) for one in scenes]
    heights = _heights(offered, goals, kin)
    likely = zip(*(chances(offered, goals, kin, key) for key in keys), strict=True)
    plans_of = map(partial(_plans, repeats=repeats), offered, likely, heights)
    ways = list(zip(*plans_of, strict=True))

    @functools.cache
    def score(place: int, plan: Plan) -> tuple[int, int]:
        tp = most_placed(goals[place], plan)
        return tp, len(plan) + len(goals[place].graph) - 2 * tp

    counts = np.array(
        [[score(place, plan) for place, plan in enumerate(way)] for way in ways], dtype=np.int64
    )
    total = counts.sum(axis=1)
    plans = {}
    for place, (scene, others) in enumerate(zip(scenes, kin, strict=True)):
        tp, wrong = (total - counts[:, others].sum(axis=1)).T
        # Without unrelated scenes, nothing is learned.
        best = int((2 * tp / np.maximum(2 * tp + wrong, 1)).argmax())
        every = Plan(tuple(range(1, len(candidates[scene.id]) + 1)))
        plans[scene.id] = ways[best][place] if (tp + wrong).any() else every
    return plans


def chances(
    offered: Sequence[Sequence[Unit]], goals: Sequence[Goal], kin: Sequence[Sequence[int]], key: Key
) -> list[Floats]:
    """Return, for each scene, the probability that the goal has at least n copies of a unit.

    Shape (units, copies); rare rows of the table are shrunk towards the overall frequency.
    """

    def needed(unit: Unit, goal: Goal) -> list[bool]:
        count = len(goal.equal_to[unit.numbers[0]])
        return [count > copy for copy in range(_MOST_COPIES)]

    return [
        (part[:, 1:] + _PRIOR * whole[1:] / max(whole[0], 1.0)) / (part[:, :1] + _PRIOR)
        for part, whole in _left_out(offered, goals, kin, key, needed)
    ]


def _heights(
    offered: Sequence[Sequence[Unit]], goals: Sequence[Goal], kin: Sequence[Sequence[int]]
) -> list[Floats]:
    """Return for each unit the mean height, 0..1, of its type and pose in unrelated scenes."""

    def height(unit: Unit, goal: Goal) -> tuple[bool, float]:
        equal, layers = goal.equal_to[unit.numbers[0]], goal.graph.layers
        mean = sum(layers[v] for v in equal) / len(equal) / max(layers) if equal else 0.0
        return bool(equal), mean

    def key(unit: Unit) -> Hashable:
        return unit.candidate.type, unit.candidate.look[2]

    # Sums from which a part was subtracted are accurate to nine digits.
    return [
        ((part[:, 2] + whole[2] / max(whole[1], 1.0)) / (part[:, 1] + 1.0)).round(9)
        for part, whole in _left_out(offered, goals, kin, key, height)
    ]


def _left_out(
    offered: Sequence[Sequence[Unit]],
    goals: Sequence[Goal],
    kin: Sequence[Sequence[int]],
    key: Key,
    measure: Callable[[Unit, Goal], Sequence[float]],
) -> Iterator[tuple[Floats, Floats]]:
    """Yield for each scene the number and the summed measures of units in unrelated scenes, of
    those that have the key of each of its units, and of all.
    """
    row_of: dict[Hashable, int] = {}
    rows = [[row_of.setdefault(key(unit), len(row_of)) for unit in of] for of in offered]
    values = [
        np.array([(1.0, *measure(unit, goal)) for unit in of])
        for of, goal in zip(offered, goals, strict=True)
    ]
    table = np.zeros((len(rows), len(row_of), values[0].shape[1]))
    for of_scene, places, value in zip(table, rows, values, strict=True):
        np.add.at(of_scene, places, value)
    total = table.sum(axis=0)
    for place, others in enumerate(kin):
        rest = total - table[others].sum(axis=0)
        yield rest[rows[place]], rest.sum(axis=0)


def _plans(
    offered: Sequence[Unit], by_key: Sequence[Floats], heights: Floats, *, repeats: bool
) -> list[Plan]:
    """Return the plans of every way: all likely units by height, once or repeatedly."""
    own = np.array([len(unit.numbers) for unit in offered])
    unit, copy = (of.ravel() for of in np.indices(by_key[0].shape))
    number = np.array([one.numbers[n % len(one.numbers)] for one in offered
                       for n in range(_MOST_COPIES)])  # fmt: skip
    height, is_first = heights[unit], copy < own[unit]
    orders = (np.lexsort((number, copy, height)), np.lexsort((number, height, copy)))
    plans = []
    for likely in by_key:
        least = np.minimum(_THRESHOLDS, likely[:, 0].max())
        any_copy = likely.ravel() >= least[:, None]
        first = any_copy & is_first
        # If every unit is likely enough, none is named again.
        any_copy[0] = first[0]
        for n, by, again in product(range(len(least)), orders, {False, repeats}):
            named = (any_copy if again else first)[n, by]
            plans.append(Plan(tuple(number[by][named].tolist())))
    return plans


@functools.lru_cache(maxsize=4096)
def color_areas(scene: Scene, view: View) -> Areas:
    """Return the share of each color in the area of blocks in the picture of a goal."""
    camera = goal_camera(scene, PictureStyle.from_view(view, _SIDE_PX))
    seen = segments(scene.blocks, camera, _SIDE_PX)
    shown = [scene.blocks[vertex].color for vertex in seen[seen >= 0].tolist()]
    return {color: n / len(shown) for color, n in Counter(shown).items()}


def blind_guesses(
    suite: Suite, pool: Sequence[AssemblyTask], setting: Setting
) -> Callable[..., Plan]:
    """Return a function from a task of a pool to its plan, in the numbers that are shown.

    A plan that `sees_colors` also uses their areas in the picture of the goal. A place in the list
    is informative only in the file's order, so plans are learned separately for every order. The
    task's own goal is never used, in whatever order it is shown.
    """
    # A key of `_learned` holds all scenes, and hashing it takes milliseconds.
    learned = functools.cache(partial(_learned, tuple(pool), suite.candidates.order, setting))

    def plan(task: AssemblyTask, *, sees_colors: bool = False) -> Plan:
        return learned(task.seed, suite.images.view if sees_colors else None)[task.key]

    return plan


@functools.lru_cache(maxsize=32)
def _learned(
    pool: tuple[AssemblyTask, ...],
    order: CandidateOrder,
    setting: Setting,
    seed: int,
    view: View | None,
) -> dict[str, Plan]:
    shown = [presented(one, seed, order) for one in pool]
    scenes, candidates = [one.scene for one in shown], {one.key: one.candidates for one in shown}
    if view is None:
        return goal_blind_plans(scenes, candidates, setting)
    areas = {scene.id: color_areas(scene, view) for scene in scenes}
    return goal_blind_plans(scenes, candidates, setting, AREA_KEYS, areas=areas)
