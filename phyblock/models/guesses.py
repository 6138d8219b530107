"""What can be guessed without looking: the most frequent answer, and a classifier of the texts.

Both are told the answers of other questions only: questions are split into folds by the base scene
they are about, and those of a fold are answered by rules learned from questions whose scenes have
no base scene of that fold.

Where answers are balanced over the whole set, such a probe comes out below chance: what is right
more often than its share in the known questions is right less often in those held out. Only what
lies above chance tells of a shortcut.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from phyblock.domain.question import Question, Subtask, is_picture_option
from phyblock.errors import Problem, SpecError
from phyblock.models.guess_features import option_features

__all__ = [
    "FOLDS",
    "PROBES",
    "Folds",
    "Guesses",
    "Likings",
    "majority_rule",
    "text_likings",
    "text_rule",
]

Rule = Callable[[Question], tuple[int, ...]]
"""A guess: the indices that `Question.answer` would hold."""
Likings = Callable[[Question], Sequence[float]]
"""How much each option of a question is taken to be right, on a scale of its own."""

FOLDS = 5
"""Parts that a set is learned in: each is answered by what the other four teach."""
_SEED = 0
_STRENGTH = 0.05


def majority_rule(known: Sequence[Question]) -> Rule:
    """The option whose words are right most often where they are shown, in the known questions.

    Words that were never seen count as right one time in four. Options that are pictures or
    lettered places go by the letter that is right most often; an order is the most frequent one.
    """
    letters = Counter(question.answer for question in known)
    right = Counter(question.options[question.answer[0]] for question in known)
    shown = Counter(option for question in known for option in question.options)

    def guess(question: Question) -> tuple[int, ...]:
        if question.subtask == "OR" or _name_letters(question.options):
            return _most_frequent(letters, question)
        rates = [(right[option] + 1) / (shown[option] + 4) for option in question.options]
        best = max(rates)
        ties = [index for index, rate in enumerate(rates) if rate == best]
        return (max(ties, key=lambda index: (letters[(index,)], -index)),)

    return guess


def text_likings(known: Sequence[Question], strength: float = _STRENGTH) -> Likings:
    """A logistic regression over the words of question and option, their numbers and likeness.

    It gives every option a log-odds of being right, from that option beside the other three. The
    larger `strength` (the inverse of the penalty on weights), the more it learns by heart. At
    least one of the known questions must have a single answer. Raises SpecError where scikit-learn
    is not installed.
    """
    single = [question for question in known if len(question.answer) == 1]
    vectorizer, regression = _models(strength)
    rows = [features for question in single for features in option_features(question)]
    is_right = [index in q.answer for q in single for index in range(len(q.options))]
    regression.fit(vectorizer.fit_transform(rows), is_right)

    def likings(question: Question) -> list[float]:
        rows = vectorizer.transform(option_features(question))
        found: list[float] = regression.decision_function(rows).tolist()
        return found

    return likings


def text_rule(known: Sequence[Question]) -> Rule:
    """The option that `text_likings` likes best; an order is the most frequent one.

    Raises SpecError where scikit-learn is not installed.
    """
    majority = majority_rule(known)
    if all(len(question.answer) != 1 for question in known):
        return majority
    likings = text_likings(known)

    def guess(question: Question) -> tuple[int, ...]:
        if question.subtask == "OR":
            return majority(question)
        liked = likings(question)
        return (max(range(len(liked)), key=lambda index: liked[index]),)

    return guess


PROBES: Mapping[str, Callable[[Sequence[Question]], Rule]] = {
    "majority": majority_rule,
    "text-only": text_rule,
}
"""What learns a rule from known questions of one subtask, by the name of the baseline."""


class Folds:
    """Questions dealt into five folds by the base scene that they are filed under, in turn."""

    def __init__(self, questions: Sequence[Question]) -> None:
        self._questions = questions
        bases = sorted({_base(question) for question in questions})
        self._fold = {base: place % FOLDS for place, base in enumerate(bases)}

    def of(self, question: Question) -> int:
        """The fold of a question; KeyError where its base scene was not dealt."""
        return self._fold[_base(question)]

    def is_known(self, fold: int, question: Question) -> bool:
        """Whether a question shares no base scene with those of a fold."""
        return all(self._fold.get(base) != fold for base in _bases(question))

    def known(self, fold: int, subtask: Subtask) -> list[Question]:
        """The questions of a subtask that share no base scene with those of a fold."""
        return [
            question
            for question in self._questions
            if question.subtask == subtask and self.is_known(fold, question)
        ]


class Guesses:
    """What each probe answers to questions of a set, or to rotations of them; made when asked."""

    def __init__(self, questions: Sequence[Question]) -> None:
        self._folds = Folds(questions)
        self._rules: dict[tuple[str, Subtask, int], Rule] = {}

    def of(self, question: Question) -> Mapping[str, tuple[int, ...]]:
        """Guesses by the name of the probe; each is worked out when it is looked up."""
        return _Lazy(self, question)

    def guess(self, probe: str, question: Question) -> tuple[int, ...]:
        """The guess of one probe; KeyError for an unknown one, SpecError as `text_rule`."""
        name = (probe, question.subtask, self._folds.of(question))
        if name not in self._rules:
            self._rules[name] = PROBES[probe](self._folds.known(name[2], question.subtask))
        return self._rules[name](question)


class _Lazy(Mapping[str, tuple[int, ...]]):
    def __init__(self, guesses: Guesses, question: Question) -> None:
        self._guesses = guesses
        self._question = question

    def __getitem__(self, probe: str) -> tuple[int, ...]:
        return self._guesses.guess(probe, self._question)

    def __iter__(self) -> Iterator[str]:
        return iter(PROBES)

    def __len__(self) -> int:
        return len(PROBES)


def _bases(question: Question) -> tuple[str, ...]:
    return question.scene.parents or (question.scene.id,)


def _base(question: Question) -> str:
    return _bases(question)[0]


def _name_letters(options: Sequence[str]) -> bool:
    places = [f"place {letter}" for letter in "ABCD"[: len(options)]]
    return all(map(is_picture_option, options)) or list(options) == places


def _most_frequent(answers: Counter[tuple[int, ...]], question: Question) -> tuple[int, ...]:
    """The most frequent answer of the known questions; of none, the first of all."""
    if not answers:
        return _first(question)
    return min(answers, key=lambda answer: (-answers[answer], answer))


def _first(question: Question) -> tuple[int, ...]:
    """Option A, or the order in which the pictures are shown."""
    return tuple(range(len(question.options))) if question.subtask == "OR" else (0,)


def _models(strength: float) -> tuple[Any, Any]:
    try:
        from sklearn.feature_extraction import DictVectorizer  # type: ignore[import-untyped]
        from sklearn.linear_model import LogisticRegression  # type: ignore[import-untyped]
    except ImportError as error:
        hint = "pip install 'phyblock[audit]'"
        message = "the text-only probe needs scikit-learn, which is not installed"
        raise SpecError(Problem("text-only", message, hint=hint)) from error
    return DictVectorizer(), LogisticRegression(C=strength, max_iter=1000, random_state=_SEED)
