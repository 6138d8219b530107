"""Attacks that learn: from cues of pictures, and from texts, on questions of other base scenes.

Questions of one kind are learned from together: what gives away the result of a push says nothing
of the next step. Ties and orders are handled by whoever takes the likings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from phyblock.domain.question import Question
from phyblock.errors import Problem, SpecError
from phyblock.making.attacks.cues import Floats
from phyblock.making.attacks.observed import Observed, kind_of
from phyblock.models.guesses import FOLDS, Folds, text_likings

__all__ = ["Likes", "boosted_cues", "linear_cues", "text_within", "unseen_text"]

Likes = Callable[[Sequence[Observed]], list[Floats | None]]
"""How much each option of each question is liked, shape (options,); None where there is no say."""
Fitted = Callable[[Floats], Floats]
"""From features, shape (n, features), to values, shape (n,)."""

_FEWEST = 12
"""Questions that something can be learned from."""
_RIDGE = 4.0
_BY_HEART = 1.0
_TREES, _DEPTH, _SEED = 60, 2, 0


def linear_cues(observed: Sequence[Observed]) -> list[Floats | None]:
    """Ridge regression of being right (of an order: of the place in it) on the cues."""
    return _learned(observed, _ridge)


def boosted_cues(observed: Sequence[Observed]) -> list[Floats | None]:
    """Gradient boosting of the same; raises SpecError where scikit-learn is not installed."""
    return _learned(observed, _boosting)


def text_within(observed: Sequence[Observed]) -> list[Floats | None]:
    """The text probe, in five folds by base scene; raises SpecError as `text_likings`.

    It learns by heart: where a set was balanced as a whole, the answers held out are the rare ones
    of what it learned, and what it likes least shows that best.
    """
    folds = Folds([one.question for one in observed])
    rules = {}
    for one in observed:
        name = (one.question.subtask, folds.of(one.question))
        if name not in rules and one.question.subtask != "OR":
            known = folds.known(name[1], name[0])
            rules[name] = text_likings(known, _BY_HEART) if known else None
    return [_liked(rules.get((o.question.subtask, folds.of(o.question))), o) for o in observed]


def unseen_text(other: Sequence[Question]) -> Likes:
    """The text probe that has learned from another set alone."""

    def likes(observed: Sequence[Observed]) -> list[Floats | None]:
        rules = {}
        for subtask in {one.question.subtask for one in observed} - {"OR"}:
            known = [question for question in other if question.subtask == subtask]
            rules[subtask] = text_likings(known) if known else None
        return [_liked(rules.get(one.question.subtask), one) for one in observed]

    return likes


def _liked(likings: Callable[[Question], Sequence[float]] | None, one: Observed) -> Floats | None:
    return None if likings is None else np.asarray(likings(one.question), dtype=np.float64)


def _learned(
    observed: Sequence[Observed], fit: Callable[[Floats, Floats], Fitted]
) -> list[Floats | None]:
    """Likings of each question by what was fitted to those that share no base scene with it."""
    folds = Folds([one.question for one in observed])
    likings: list[Floats | None] = [None] * len(observed)
    groups: dict[tuple[str, ...], list[int]] = {}
    for place, one in enumerate(observed):
        if one.cues:
            group = (one.question.subtask, kind_of(one.question), *one.cues)
            groups.setdefault(group, []).append(place)
    for members in groups.values():
        for fold in range(FOLDS):
            held_out = [m for m in members if folds.of(observed[m].question) == fold]
            known = [observed[m] for m in members if folds.is_known(fold, observed[m].question)]
            if held_out and len(known) >= _FEWEST:
                features = np.vstack([_features(one) for one in known])
                fitted = fit(features, np.concatenate([_worth(one.question) for one in known]))
                for member in held_out:
                    likings[member] = fitted(_features(observed[member]))
    return likings


def _features(one: Observed) -> Floats:
    """Cues against the mean of the question's options, in its standard deviations; how far off.

    Shape (options, 2 * cues).
    """
    values = np.stack(list(one.cues.values()), axis=1)
    spread = values.std(axis=0)
    steps = (values - values.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    return np.hstack([steps, np.abs(steps)])


def _worth(question: Question) -> Floats:
    """1 for the right option and 0 for others; in an order, the first is worth most."""
    worth = np.zeros(len(question.options))
    worth[list(question.answer)] = np.arange(len(question.answer), 0, -1)
    return worth


def _ridge(features: Floats, worth: Floats) -> Fitted:
    """Least squares with a penalty on the weights; options of a question are centered already."""
    penalty = _RIDGE * np.eye(features.shape[1])
    middle, mean = features.mean(axis=0), worth.mean()
    centered = features - middle
    weights = np.linalg.solve(centered.T @ centered + penalty, centered.T @ (worth - mean))
    return lambda rows: np.asarray((rows - middle) @ weights)


def _boosting(features: Floats, worth: Floats) -> Fitted:
    try:
        from sklearn.ensemble import GradientBoostingRegressor  # type: ignore[import-untyped]
    except ImportError as error:
        hint = "pip install 'phyblock[audit]'"
        message = "the boosted probe needs scikit-learn, which is not installed"
        raise SpecError(Problem("boosted probe", message, hint=hint)) from error
    model: Any = GradientBoostingRegressor(
        n_estimators=_TREES, max_depth=_DEPTH, random_state=_SEED
    )
    model.fit(features, worth)
    return lambda rows: np.asarray(model.predict(rows))
