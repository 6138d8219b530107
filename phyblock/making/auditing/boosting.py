"""Gradient boosting over what candidate sets show: the strongest of the learners without a goal."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from phyblock.tracks.goal_blind.learning import MOST_COPIES
from phyblock.tracks.goal_blind.lessons import Lesson

__all__ = ["boosted", "can_boost"]

Floats = NDArray[np.float64]
_GROUPS = 3
"""Base scenes are split into so many groups; a model has seen no scene with a parent in those of
the scenes that it speaks of.
"""
_COPIES = 4
"""More blocks alike are too rare to be learned."""
_TREES = 60


def can_boost() -> bool:
    """Whether scikit-learn is installed, which comes with `phyblock[audit]`."""
    try:
        import sklearn  # type: ignore[import-untyped]  # noqa: F401
    except ImportError:
        return False
    return True


def boosted(known: Sequence[Lesson], kin: Sequence[Sequence[int]]) -> list[Floats]:
    """A learner as `goal_blind_plans` takes it, by gradient boosting (Friedman 2001): chances that
    the goal has at least 1, 2, ... of each unit, shape (units, MOST_COPIES) a lesson.

    Where too little is left to learn from, all chances are even.
    """
    groups = _groups(known)
    by_place: dict[int, Floats] = {}
    for held in sorted(set(groups), key=sorted):
        asked = [place for place, group in enumerate(groups) if group == held]
        near = {other for place in asked for other in kin[place]}
        seen = [
            place for place, group in enumerate(groups) if not group & held and place not in near
        ]
        by_place.update(_fitted([known[p] for p in seen], {p: known[p] for p in asked}))
    return [by_place[place] for place in range(len(known))]


def _groups(known: Sequence[Lesson]) -> list[frozenset[int]]:
    """For each lesson the groups that its base scenes are in."""
    parents = [lesson.scene.parents or (lesson.scene.id,) for lesson in known]
    names = sorted({name for one in parents for name in one})
    group = {name: at % _GROUPS for at, name in enumerate(names)}
    return [frozenset(group[name] for name in one) for one in parents]


def _fitted(seen: Sequence[Lesson], asked: dict[int, Lesson]) -> dict[int, Floats]:
    from sklearn.ensemble import (  # type: ignore[import-untyped]
        HistGradientBoostingClassifier,
    )

    counts = np.array([count for lesson in seen for count in lesson.counts]).clip(max=_COPIES)
    if len(set(counts.tolist())) < 2:
        return {p: np.full((len(one.units), MOST_COPIES), 0.5) for p, one in asked.items()}
    model = HistGradientBoostingClassifier(
        max_iter=_TREES, learning_rate=0.08, max_leaf_nodes=12, early_stopping=False, random_state=0
    )
    model.fit(_features(seen), counts)
    fitted = {}
    for place, lesson in asked.items():
        exactly = np.zeros((len(lesson.units), MOST_COPIES + 1))
        exactly[:, model.classes_.astype(int)] = model.predict_proba(_features([lesson]))
        fitted[place] = exactly[:, ::-1].cumsum(axis=1)[:, ::-1][:, 1:]
    return fitted


def _features(lessons: Sequence[Lesson]) -> Floats:
    return np.array([unit.features for lesson in lessons for unit in lesson.units])
