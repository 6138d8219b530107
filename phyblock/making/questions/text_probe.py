"""The text probe of the audit: a classifier that sees the texts of questions alone."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from typing import Any

from phyblock.domain.question import Question
from phyblock.errors import Problem, SpecError
from phyblock.text import plain_sum
from phyblock.tracks.questions import Rule, majority_rule

_SEED, _STRENGTH, _CROSSED = 0, 0.05, 0.25
_WORD = re.compile(r"[a-z]+|\d+(?:\.\d+)?")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


def text_rule(known: Sequence[Question]) -> Rule:
    """Learn a logistic regression over the words of question and option, their numbers and
    likeness: the option that it gives the highest odds. An order is the most frequent one.

    Raises SpecError where scikit-learn is not installed.
    """
    majority = majority_rule(known)
    single = [question for question in known if len(question.answer) == 1]
    if not single:
        return majority
    try:
        from sklearn.feature_extraction import DictVectorizer  # type: ignore[import-untyped]
        from sklearn.linear_model import LogisticRegression  # type: ignore[import-untyped]
    except ImportError as error:
        message = "the text probe needs scikit-learn, which is not installed"
        problem = Problem("text", message, hint="pip install 'phyblock[audit]'")
        raise SpecError(problem) from error
    vectorizer = DictVectorizer()
    regression = LogisticRegression(C=_STRENGTH, max_iter=1000, random_state=_SEED)
    rows = [features for q in single for features in text_features(q.text, q.options)]
    is_right = [index in q.answer for q in single for index in range(len(q.options))]
    regression.fit(vectorizer.fit_transform(rows), is_right)

    def guess(question: Question) -> tuple[int, ...]:
        if question.subtask == "OR":
            return majority(question)
        rows = vectorizer.transform(text_features(question.text, question.options))
        odds: Any = regression.decision_function(rows).tolist()
        return (max(range(len(odds)), key=odds.__getitem__),)

    return guess


def text_features(text: str, options: Sequence[str]) -> list[Mapping[str, float]]:
    """Return features of each option beside one another and the text that asks, by name; 0 where a
    name is missing.

    These are the shortcuts that multiple-choice questions are known for: words that are right
    often, the largest or the middle number, the option that shares most with the others, the
    longest one. Letters are not among them: how often each is right is counted, not learned.
    """
    words = [_WORD.findall(option.lower()) for option in options]
    asked = set(_WORD.findall(text.lower()))
    found = [_NUMBER.findall(option) for option in options]
    numbers = [float(one[0]) if len(one) == 1 else None for one in found]
    lengths = [len(option) for option in options]
    shared = [
        plain_sum(_overlap(one, other) for k, other in enumerate(words) if k != j)
        for j, one in enumerate(words)
    ]
    rows: list[Mapping[str, float]] = []
    for i, mine in enumerate(words):
        pairs = [" ".join(pair) for pair in itertools.pairwise(mine)]
        whole = " ".join(mine)
        rows.append(
            {
                **{f"option {word}": 1.0 for word in [*mine, *pairs, whole]},
                **{f"asked {one} option {whole}": _CROSSED for one in asked},
                "likeness": shared[i],
                "most alike": float(shared[i] == max(shared) > min(shared)),
                "least alike": float(shared[i] == min(shared) < max(shared)),
                **_rank("number", numbers, i),
                **_rank("length", lengths, i),
                "asked about": float(len(asked.intersection(mine))),
            }
        )
    return rows


def _rank(name: str, values: Sequence[float | None], i: int) -> dict[str, float]:
    known = [value for value in values if value is not None]
    mine = values[i]
    if mine is None or len(known) < len(values) or len(set(known)) < 2:
        return {}
    return {f"{name} rank {sum(value < mine for value in known)}": 1.0}


def _overlap(one: Sequence[str], other: Sequence[str]) -> float:
    union = set(one) | set(other)
    return len(set(one) & set(other)) / len(union) if union else 0.0
