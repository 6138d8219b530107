"""Scenes as learners take them, and sums over the scenes that one may learn from."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.domain import CandidateSet, Scene
from phyblock.scoring.plan import Goal
from phyblock.tracks.goal_blind.offered import Unit, units
from phyblock.types import Setting

__all__ = ["Lesson", "left_out", "lessons", "related"]

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
