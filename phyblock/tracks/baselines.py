"""Guesses at questions from other questions of their set.

Guesses use only the answers of other questions: questions are split into folds by base scene, and
those of a fold are answered by rules learned from questions whose scenes have no base scene of that
fold. If answers are balanced over the whole set, such a probe scores below chance: an option that
is right more often than its share in the known questions is right less often in the held-out ones.
Only a score above chance indicates a shortcut.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

from phyblock.domain.question import Question, Subtask, is_picture_option

Rule = Callable[[Question], tuple[int, ...]]
"""A guess at `Question.answer`: the indices of options."""
FOLDS = 5
"""Number of folds: each is answered by rules learned from the others."""


class Folds:
    """Questions dealt into five folds in turn, by their first base scene."""

    def __init__(self, questions: Sequence[Question]) -> None:
        self._questions = questions
        bases = sorted({_bases(question)[0] for question in questions})
        self._fold = {base: place % FOLDS for place, base in enumerate(bases)}

    def of(self, question: Question) -> int:
        """Return the fold of a question. Raises KeyError if its base scene was not dealt."""
        return self._fold[_bases(question)[0]]

    def is_known(self, fold: int, question: Question) -> bool:
        """True if a question shares no base scene with the questions of a fold."""
        return all(self._fold.get(base) != fold for base in _bases(question))

    def known(self, fold: int, subtask: Subtask) -> list[Question]:
        """Return the questions of a subtask that share no base scene with a fold."""
        mine = (question for question in self._questions if question.subtask == subtask)
        return [question for question in mine if self.is_known(fold, question)]


class Guesses:
    """Guesses at questions of a set, or at rotations of them, by rules that `learn` returns."""

    def __init__(
        self, questions: Sequence[Question], learn: Callable[[Sequence[Question]], Rule]
    ) -> None:
        self._folds, self._learn = Folds(questions), learn
        self._rules: dict[tuple[Subtask, int], Rule] = {}

    def guess(self, question: Question) -> tuple[int, ...]:
        """Return the guess of the rule that was learned from questions about other scenes."""
        name = (question.subtask, self._folds.of(question))
        if name not in self._rules:
            self._rules[name] = self._learn(self._folds.known(name[1], question.subtask))
        return self._rules[name](question)


def majority_rule(known: Sequence[Question]) -> Rule:
    """Learn to pick the option whose text is most often right when it is offered.

    An unseen text counts as right one time in four. For options that are pictures or lettered
    places, the letter counts instead of the text; for orders, the most frequent one is picked.
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


def _bases(question: Question) -> tuple[str, ...]:
    return question.scene.parents or (question.scene.id,)
