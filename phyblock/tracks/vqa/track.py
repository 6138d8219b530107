"""The VQA track: a question with its pictures in, a letter or an order out (paper section 3.3)."""

from __future__ import annotations

import functools
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from phyblock.data import QuestionSet, QuestionTask
from phyblock.domain import LETTERS, Question, Scene, is_picture_option
from phyblock.domain.question import rotated, rotated_label
from phyblock.models.base import Image
from phyblock.models.guesses import Guesses
from phyblock.parsing.answer import ParsedAnswer
from phyblock.parsing.structured import AnswerForm
from phyblock.stable import hex_digest
from phyblock.tracks.asked_once import AskedOnce
from phyblock.tracks.elsewhere import Elsewhere
from phyblock.tracks.examples import Examples
from phyblock.tracks.prompts import Prompt, form_facts
from phyblock.tracks.vqa.baselines import ChoiceSubject
from phyblock.tracks.vqa.pictures import QuestionPictures, ShownQuestion
from phyblock.tracks.vqa.rules import VqaRules

__all__ = ["AskedQuestion", "ChoiceJudgement", "Vqa", "elsewhere_in"]


@dataclass(frozen=True)
class AskedQuestion:
    """A question with its options in one order; `rotation` 0 is that of the data set."""

    task: QuestionTask
    rotation: int = 0
    is_one_of_many: bool = False

    @functools.cached_property
    def shown(self) -> ShownQuestion:
        """The question with its options and the files of their pictures rotated."""
        n = len(self.task.question.options)
        files = {rotated_label(at, self.rotation, n): path for at, path in self.task.files.items()}
        return ShownQuestion(rotated(self.task.question, self.rotation), files)

    @property
    def question(self) -> Question:
        """The question as it is shown."""
        return self.shown.question

    @property
    def key(self) -> str:
        """The question's id, with the rotation where all are asked."""
        return f"{self.task.key}-r{self.rotation}" if self.is_one_of_many else self.task.key

    @property
    def scene(self) -> Scene:
        """The scene as the question shows it."""
        return self.task.scene


@dataclass(frozen=True)
class ChoiceJudgement:
    """What a reply was read as, and whether that is right."""

    parsed: ParsedAnswer
    right: str

    @property
    def is_read(self) -> bool:
        """Whether a rule matched."""
        return self.parsed.rule is not None

    def fields(self) -> dict[str, Any]:
        """`parse`, `scores` (none: there are no steps) and `answer` of the record."""
        given = self.parsed.letters
        problem = {"problem": self.parsed.problem} if self.parsed.problem else {}
        return {
            "parse": {"rule": self.parsed.rule, "letters": given, **problem},
            "scores": [],
            "answer": {"right": self.right, "given": given, "correct": given == self.right},
        }


class Vqa(AskedOnce[AskedQuestion, QuestionPictures]):
    """Prompt, parse and score of the track."""

    name = "vqa"

    def __init__(
        self,
        rules: VqaRules,
        questions: QuestionSet,
        tasks: Sequence[QuestionTask],
        prompt: Prompt | None = None,
        pictures: QuestionPictures | None = None,
        examples: Examples[AskedQuestion] | None = None,
    ) -> None:
        """Ask `tasks` out of `questions`, of which all serve as wrong pictures and for baselines.

        `prompt` and `pictures` are None where every model is a recording. Raises SpecError where
        wrong pictures are wanted and some question has no other scene to take them from.
        """
        super().__init__(prompt, pictures, examples)
        rotations = range(len(LETTERS)) if rules.circular else range(1)
        self.rules = rules
        self.items = tuple(
            AskedQuestion(task, rotation, is_one_of_many=rules.circular)
            for task in tasks
            for rotation in rotations
        )
        self._questions = questions
        self._guesses = Guesses([task.question for task in questions.tasks])
        self._elsewhere: Elsewhere[QuestionTask] | None = None
        if rules.wrong_image:
            self._elsewhere = elsewhere_in(questions)
            self._elsewhere.check(tasks, "question", "vqa.wrong_image")

    def about(self, item: AskedQuestion) -> dict[str, Any]:
        """Which question it is and how it is shown."""
        return {
            "question": {
                "id": item.question.id,
                "subtask": item.question.subtask,
                "category": item.question.category,
                "rotation": item.rotation,
                "options_as": self.rules.options_as,
                "blind": self.rules.blind,
                "wrong_image": self.rules.wrong_image,
            }
        }

    def identity(self) -> dict[str, Any]:
        """Digests of all questions, of those asked, the prompt and the pictures."""
        counts = Counter(item.question.subtask for item in self.items)
        keys = [item.key for item in self.items]
        return {
            "questions": self._questions.sha256,
            "asked": hex_digest(json.dumps(keys)),
            "by_subtask": dict(counts),
            **super().identity(),
        }

    def facts(self, item: AskedQuestion, pictures: tuple[Image, ...]) -> dict[str, object]:
        """What templates may use; nothing in it gives the answer away."""
        question = item.question
        letters = LETTERS[: len(question.options)]
        return {
            "question": question.text,
            "options": [
                {"letter": letter, "text": option, "is_picture": is_picture_option(option)}
                for letter, option in zip(letters, question.options, strict=True)
            ],
            "letters": list(letters),
            "is_ordering": question.subtask == "OR",
            "pictures": [picture.label for picture in pictures],
            "is_blind": self.rules.blind,
            **form_facts(self._form(item)),
        }

    def judge(self, item: AskedQuestion, text: str | None) -> ChoiceJudgement:
        """Read and score a reply; None, where there is no reply, is no answer."""
        question = item.question
        parsed = ParsedAnswer(None, None)
        if text is not None:
            parsed = self.rules.read(question, text)
        return ChoiceJudgement(parsed, question.answer_letters)

    def _subject(self, item: AskedQuestion) -> ChoiceSubject:
        return ChoiceSubject(item.question, self._guesses.of(item.question))

    def _form(self, item: AskedQuestion) -> AnswerForm[str] | None:
        return self.rules.form(item.question)

    def _right_answer(self, item: AskedQuestion) -> str:
        return self.rules.right_answer(item.question)

    def _pictured(self, item: AskedQuestion) -> ShownQuestion | None:
        return None if self.rules.blind else item.shown

    def _pictured_for(self, item: AskedQuestion, seed: int) -> ShownQuestion | None:
        """The question with its own pictures, or with those of another scene.

        Which other one depends on the question and the seed alone, so it is the same for all
        models and for all rotations.
        """
        if self._elsewhere is None:
            return self._pictured(item)
        other = self._elsewhere.of(item.task, seed)
        return self._pictured(AskedQuestion(other, item.rotation))


def elsewhere_in(questions: QuestionSet) -> Elsewhere[QuestionTask]:
    """What wrong pictures of a question are taken from: others that show what it shows."""
    return Elsewhere(questions.tasks, _sort_of)


def _sort_of(task: QuestionTask) -> tuple[object, ...]:
    """What pictures must share to stand in for one another: a text may speak of place B."""
    marks = sorted(
        (picture.label, *sorted(mark.letter for mark in picture.marks))
        for picture in task.question.pictures
    )
    return (task.question.subtask, ShownQuestion(task.question, task.files).labels, *marks)
