"""Guesses at questions from their texts alone.

Guesses are told the answers of other questions only: questions are split into folds by the base
scene they are about, and those of a fold are answered by rules learned from questions whose scenes
have no base scene of that fold. Where answers are balanced over the whole set, such a probe comes
out below chance: what is right more often than its share in the known questions is right less often
in those held out. Only what lies above chance tells of a shortcut.
"""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from phyblock.domain.question import Question, Subtask, is_picture_option
from phyblock.errors import Problem, SpecError
from phyblock.stable import plain_sum

Rule = Callable[[Question], tuple[int, ...]]
"""A guess: the indices that `Question.answer` would hold."""
FOLDS = 5
"""Parts that a set is learned in: each is answered by what the other four teach."""
_SEED, _STRENGTH, _CROSSED = 0, 0.05, 0.25
_WORD = re.compile(r"[a-z]+|\d+(?:\.\d+)?")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


class Folds:
    """Questions dealt into five folds by the base scene that they are filed under, in turn."""

    def __init__(self, questions: Sequence[Question]) -> None:
        self._questions = questions
        bases = sorted({_bases(question)[0] for question in questions})
        self._fold = {base: place % FOLDS for place, base in enumerate(bases)}

    def of(self, question: Question) -> int:
        """Return the fold of a question; KeyError where its base scene was not dealt."""
        return self._fold[_bases(question)[0]]

    def is_known(self, fold: int, question: Question) -> bool:
        """True if a question shares no base scene with those of a fold."""
        return all(self._fold.get(base) != fold for base in _bases(question))

    def known(self, fold: int, subtask: Subtask) -> list[Question]:
        """Return the questions of a subtask that share no base scene with those of a fold."""
        mine = (question for question in self._questions if question.subtask == subtask)
        return [question for question in mine if self.is_known(fold, question)]


class Guesses:
    """Guesses of each probe at questions of a set, or at rotations of them; made when asked."""

    def __init__(self, questions: Sequence[Question]) -> None:
        self._folds = Folds(questions)
        self._rules: dict[tuple[str, Subtask, int], Rule] = {}

    def guess(self, probe: str, question: Question) -> tuple[int, ...]:
        """Return the guess of one probe; KeyError for an unknown one, SpecError as `text_rule`."""
        name = (probe, question.subtask, self._folds.of(question))
        if name not in self._rules:
            self._rules[name] = PROBES[probe](self._folds.known(name[2], question.subtask))
        return self._rules[name](question)


def majority_rule(known: Sequence[Question]) -> Rule:
    """Learn to pick the option whose words are right most often where they are shown.

    Words that were never seen count as right one time in four. Options that are pictures or
    lettered places go by the letter that is right most often; an order is the most frequent one.
    """
    letters = Counter(question.answer for question in known)
    right = Counter(question.options[question.answer[0]] for question in known)
    shown = Counter(option for question in known for option in question.options)

    def guess(question: Question) -> tuple[int, ...]:
        options, is_ordering = list(question.options), question.subtask == "OR"
        places = [f"place {letter}" for letter in "ABCD"[: len(options)]]
        if is_ordering or all(map(is_picture_option, options)) or options == places:
            first = tuple(range(len(options))) if is_ordering else (0,)
            return min(letters, key=lambda answer: (-letters[answer], answer), default=first)
        rates = [(right[option] + 1) / (shown[option] + 4) for option in options]
        ties = [index for index, rate in enumerate(rates) if rate == max(rates)]
        return (max(ties, key=lambda index: (letters[(index,)], -index)),)

    return guess


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
        message = "the text-only probe needs scikit-learn, which is not installed"
        problem = Problem("text-only", message, hint="pip install 'phyblock[audit]'")
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


PROBES: Mapping[str, Callable[[Sequence[Question]], Rule]] = {
    "majority": majority_rule,
    "text-only": text_rule,
}
"""Learners of a rule from known questions of one subtask, by the name of the baseline."""


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


def _bases(question: Question) -> tuple[str, ...]:
    return question.scene.parents or (question.scene.id,)
