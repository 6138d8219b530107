"""Audit of a question set: balance of answers, repeated questions, and blind probes.

Two probes learn from questions about other base scenes and answer the rest: one reads only the
texts (logistic regression over words, numbers and likeness), one measures the pictures without
knowing what is in them (ridge regression): outlines, colors by height, what an option changes and
whether something is below that, where marks are. If either is right much more often than chance,
the set gives its answers away.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from phyblock.domain.question import LETTERS, SUBTASKS, Question, Subtask
from phyblock.errors import Problem, SpecError
from phyblock.making.questions.guesses import measures_of, text_features
from phyblock.making.questions.production import BALANCE
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_key
from phyblock.tracks.questions import FOLDS, Folds, Rule, guesses_of, majority_rule

GUESSABLE = 0.35
"""Accuracy that no probe of a sound set exceeds, unless chance is within its interval."""
_FEWEST, _RIDGE = 12, 4.0
_SEED, _STRENGTH = 0, 0.05


class Probe(NamedTuple):
    """The number of questions that a probe answered correctly, of `n`."""

    right: int
    n: int

    @property
    def accuracy(self) -> float:
        """Share of questions answered correctly."""
        return self.right / self.n

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson score interval of 95 %."""
        z, n, p = 1.96, self.n, self.accuracy
        middle = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        return middle - half, middle + half


@dataclass(frozen=True)
class SubtaskAudit:
    """Facts about the questions of one subtask.

    `letters` are shares of right answers by letter (ordering: by the letter that comes first),
    `repeats` the questions that ask the same as an earlier one. `probes` are `majority`, `text`
    and, if options are pictures, places or effects of removing a marked block, `pictures`, which is
    also reported by kind of question.
    """

    subtask: Subtask
    n: int
    letters: tuple[float, ...]
    chance: float
    probes: Mapping[str, Probe]
    repeats: tuple[str, ...]

    def findings(self) -> Iterator[str]:
        """Yield a sentence on each problem."""
        low, high = BALANCE
        if self.subtask != "OR" and not low <= min(self.letters) <= max(self.letters) <= high:
            yield f"{self.subtask}: a letter is right outside {low:.0%} to {high:.0%}"
        for name, probe in self.probes.items():
            if probe.accuracy > GUESSABLE and probe.interval[0] > self.chance:
                yield f"{self.subtask}: the {name} probe reaches {100 * probe.accuracy:.0f} %"
        yield from (f"{name}: asks what an earlier question asks" for name in self.repeats)


def audit_questions(questions: Sequence[Question]) -> Iterator[SubtaskAudit]:
    """Yield an audit of each subtask that has questions, in the paper's order.

    Raises SpecError if scikit-learn, which the text probe uses, is not installed.
    """
    folds = Folds(questions)
    rules = {"majority": majority_rule, "text": text_rule}
    readers = {name: guesses_of(questions, rule) for name, rule in rules.items()}
    repeated = duplicates_of(questions)
    for subtask in SUBTASKS:
        mine = [question for question in questions if question.subtask == subtask]
        if not mine:
            continue
        n, first = len(mine), Counter(question.answer[0] for question in mine)
        probes = {
            name: Probe(sum(guesses(q) == q.answer for q in mine), n)
            for name, guesses in readers.items()
        }
        by_kind = picture_probe(mine, folds)
        if by_kind:
            right, shown = (sum(counts) for counts in zip(*by_kind.values(), strict=True))
            probes["pictures"] = Probe(right, shown)
        if len(by_kind) > 1:
            probes |= {f"pictures, {kind}": probe for kind, probe in by_kind.items()}
        chances = [1 / math.factorial(4) if subtask == "OR" else 1 / len(q.options) for q in mine]
        yield SubtaskAudit(
            subtask=subtask,
            n=n,
            letters=tuple(first[i] / n for i in range(len(LETTERS))),
            chance=math.fsum(chances) / n,
            probes=probes,
            repeats=tuple(q.id for q in mine if q.id in repeated),
        )


def text_rule(known: Sequence[Question]) -> Rule:
    """Return the rule that picks the option with the highest odds of a logistic regression over
    words, numbers and likeness of texts; for an order, the most frequent one.

    Raises SpecError if scikit-learn is not installed.
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


def duplicates_of(questions: Sequence[Question]) -> dict[str, str]:
    """Return the ids of questions that repeat an earlier one, with options in any order, and the
    id of that one.
    """
    first: dict[Hashable, str] = {}
    earlier = {one.id: first.setdefault(_content(one), one.id) for one in questions}
    return {name: twin for name, twin in earlier.items() if twin != name}


def _content(question: Question) -> Hashable:
    """Return everything that a reader of the question sees, but for backgrounds, options sorted."""
    shown = {
        one.label: question_key(replace(one, background=None), PictureStyle())
        for one in question.pictures
    }
    options = [shown.pop(a, b) for a, b in zip(LETTERS, question.options, strict=False)]
    return question.subtask, question.text, tuple(sorted(options)), tuple(shown.values())


def picture_probe(questions: Sequence[Question], folds: Folds) -> dict[str, Probe]:
    """Answer questions by measures of their pictures alone, and return a probe for each kind.

    Ridge regression of being right (ordering: of the place in the order), learned from questions
    of the same kind that share no base scene. Kinds without measures are omitted.
    """
    rows_of = {q.id: measures_of(q) for q in questions}
    kinds: dict[str, list[Question]] = {}
    for question in questions:
        if len(rows_of[question.id]):
            kinds.setdefault(question.wording.rstrip("-0123456789"), []).append(question)
    found: dict[str, Probe] = {}
    for kind, members in kinds.items():
        right = n = 0
        for fold in range(FOLDS):
            held_out = [q for q in members if folds.of(q) == fold]
            known = [q for q in members if folds.is_known(fold, q)]
            if not held_out or len(known) < _FEWEST:
                continue
            # Measures and values have a mean of zero over the four options. The right one has the
            # highest value, or in an order the first one.
            rows = np.vstack([rows_of[q.id] for q in known])
            values = np.zeros((len(known), len(LETTERS)))
            for value, q in zip(values, known, strict=True):
                value[list(q.answer)] = np.arange(len(q.answer), 0, -1)
            worth = (values - values.mean(axis=1, keepdims=True)).ravel()
            gram = rows.T @ rows + _RIDGE * np.eye(rows.shape[1])
            weights = np.linalg.solve(gram, rows.T @ worth)
            for question in held_out:
                order = np.argsort(-(rows_of[question.id] @ weights), kind="stable")
                right += tuple(order[: len(question.answer)]) == question.answer
                n += 1
        if n:
            found[kind] = Probe(right, n)
    return found
