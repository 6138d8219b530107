"""The VQA track: a question with its pictures in, a letter or an order out (paper section 3.3)."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from phyblock import parsing
from phyblock.datasets import QuestionSet, QuestionTask
from phyblock.digests import hex_digest
from phyblock.domain import LETTERS, Question, Scene, is_picture_option
from phyblock.domain.rotation import rotated, rotated_label
from phyblock.models.base import Image, Request
from phyblock.models.guesses import Guesses
from phyblock.tracks.elsewhere import Elsewhere
from phyblock.tracks.examples import Examples, Shots, WorkedExample, Working
from phyblock.tracks.prompts import Prompt, form_facts, response_format
from phyblock.tracks.vqa.baselines import ChoiceSubject
from phyblock.tracks.vqa.pictures import QuestionPictures, ShownQuestion
from phyblock.tracks.vqa.rules import VqaRules

__all__ = ["AskedQuestion", "ChoiceJudgement", "Vqa", "asked", "elsewhere_in", "subtask_of"]


@dataclass(frozen=True)
class AskedQuestion:
    """A question with its options in one order; `rotation` 0 is that of the data set."""

    shown: ShownQuestion
    rotation: int = 0
    is_one_of_many: bool = False

    @property
    def question(self) -> Question:
        """The question as it is shown."""
        return self.shown.question

    @property
    def key(self) -> str:
        """The question's id, with the rotation where all are asked."""
        return f"{self.question.id}-r{self.rotation}" if self.is_one_of_many else self.question.id

    @property
    def scene(self) -> Scene:
        """The scene as the question shows it."""
        return self.question.scene


def asked(task: QuestionTask, rotation: int = 0, *, is_one_of_many: bool = False) -> AskedQuestion:
    """A question with its options rotated."""
    n = len(task.question.options)
    files = {rotated_label(label, rotation, n): path for label, path in task.files.items()}
    shown = ShownQuestion(rotated(task.question, rotation), files)
    return AskedQuestion(shown, rotation, is_one_of_many)


@dataclass(frozen=True)
class ChoiceJudgement:
    """What a reply was read as, and whether that is right."""

    parsed: parsing.ParsedAnswer
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


class Vqa:
    """Prompt, parse and score of the track."""

    name = "vqa"

    def __init__(
        self,
        rules: VqaRules,
        questions: QuestionSet,
        tasks: Sequence[QuestionTask],
        prompt: Prompt | None = None,
        pictures: QuestionPictures | None = None,
        examples: Examples[QuestionTask] | None = None,
    ) -> None:
        """Ask `tasks` out of `questions`, of which all serve as wrong pictures and for baselines.

        `prompt` and `pictures` are None where every model is a recording. Raises SpecError where
        wrong pictures are wanted and some question has no other scene to take them from.
        """
        rotations = range(len(LETTERS)) if rules.circular else range(1)
        self.rules = rules
        self._tasks = {task.key: task for task in tasks}
        self.items: Sequence[AskedQuestion] = tuple(
            asked(task, rotation, is_one_of_many=rules.circular)
            for task in tasks
            for rotation in rotations
        )
        self.template = "" if prompt is None else prompt.name
        self._questions = questions
        self._prompt = prompt
        self._examples = examples or Examples((), 0)
        self._pictures = pictures
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
        facts: dict[str, Any] = {
            "questions": self._questions.sha256,
            "asked": hex_digest(json.dumps(keys)),
            "by_subtask": dict(counts),
            "prompt": None,
            "pictures": None,
        }
        if self._prompt is not None and self._pictures is not None:
            facts["prompt"] = {"name": self._prompt.name, "version": self._prompt.version}
            examples = [asked(task) for task in self._examples.used(self._tasks.values())]
            if examples:
                facts["examples"] = [example.key for example in examples]
            items = () if self.rules.blind else (*self.items, *examples)
            facts["pictures"] = hex_digest(
                json.dumps([self._pictures.keys(item.shown) for item in items])
            )
        return facts

    async def request(
        self, item: AskedQuestion, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Request:
        """The request of one sample; without messages for models that need none."""
        if not with_messages or self._prompt is None or self._pictures is None:
            return Request(item.key, seed, (), params, "", self._about(item))
        work = self._working(self._prompt, self._pictures)
        shots = await self._examples.shots(self._tasks[item.question.id], work)
        pictures: tuple[Image, ...] = ()
        if not self.rules.blind:
            pictures = await self._pictures.of(self._seen(item, seed))
        return self._request(item, seed, params, self._prompt, pictures, shots)

    def outlines(self, item: AskedQuestion) -> Iterator[tuple[Request, bool]]:
        """The one request, made without rendering, and whether its pictures are the real ones."""
        if self._prompt is None or self._pictures is None:
            yield Request(item.key, 0, (), {}, "", self._about(item)), True
            return
        pictures, are_real = self._outline(self._pictures, self._seen(item, 0))
        work = self._working(self._prompt, self._pictures)
        shots, is_real = self._examples.outlined(self._tasks[item.question.id], work)
        yield self._request(item, 0, {}, self._prompt, pictures, shots), are_real and is_real

    def _outline(
        self, pictures: QuestionPictures, shown: ShownQuestion
    ) -> tuple[tuple[Image, ...], bool]:
        return ((), True) if self.rules.blind else pictures.outline(shown)

    def _working(self, prompt: Prompt, pictures: QuestionPictures) -> Working[QuestionTask]:
        async def of(task: QuestionTask) -> tuple[Image, ...]:
            return () if self.rules.blind else await pictures.of(asked(task).shown)

        def outline(task: QuestionTask) -> tuple[tuple[Image, ...], bool]:
            return self._outline(pictures, asked(task).shown)

        return Working(of, outline, partial(self._example, prompt))

    def _example(
        self, prompt: Prompt, task: QuestionTask, pictures: tuple[Image, ...]
    ) -> WorkedExample:
        item = asked(task)
        *_, question = prompt.messages(pictures, self.facts(item, pictures))
        return WorkedExample(item.key, question, self.rules.right_answer(item.question))

    def facts(self, item: AskedQuestion, pictures: Sequence[Image]) -> dict[str, object]:
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
            **form_facts(self.rules.form(question)),
        }

    def judge(self, item: AskedQuestion, text: str | None) -> ChoiceJudgement:
        """Read and score a reply; None, where there is no reply, is no answer."""
        question = item.question
        parsed = parsing.ParsedAnswer(None, None)
        if text is not None:
            parsed = self.rules.read(question, text)
        return ChoiceJudgement(parsed, question.answer_letters)

    def close(self) -> None:
        """Stop the processes that draw pictures."""
        if self._pictures is not None:
            self._pictures.close()

    def _about(self, item: AskedQuestion) -> ChoiceSubject:
        return ChoiceSubject(item.question, self._guesses.of(item.question))

    def _request(
        self,
        item: AskedQuestion,
        seed: int,
        params: Mapping[str, object],
        prompt: Prompt,
        pictures: tuple[Image, ...],
        shots: Shots,
    ) -> Request:
        messages = prompt.messages(pictures, self.facts(item, pictures))
        return Request(
            item.key,
            seed,
            shots.before(messages),
            params,
            prompt.version,
            self._about(item),
            response_format(self.rules.form(item.question)),
            examples=shots.keys,
        )

    def _seen(self, item: AskedQuestion, seed: int) -> ShownQuestion:
        """What a question is shown with: its own pictures, or those of another scene.

        Which other one depends on the question and the seed alone, so it is the same for all
        models and for all rotations.
        """
        if self._elsewhere is None:
            return item.shown
        other = self._elsewhere.of(self._tasks[item.question.id], seed)
        return asked(other, item.rotation).shown


def elsewhere_in(questions: QuestionSet) -> Elsewhere[QuestionTask]:
    """What wrong pictures of a question are taken from: others that show what it shows."""
    return Elsewhere(questions.tasks, _sort_of)


def subtask_of(task: QuestionTask) -> str:
    """What a question and its worked examples share."""
    return task.question.subtask


def _sort_of(task: QuestionTask) -> tuple[object, ...]:
    """What pictures must share to stand in for one another: a text may speak of place B."""
    marks = sorted(
        (picture.label, *sorted(mark.letter for mark in picture.marks))
        for picture in task.question.pictures
    )
    return (task.question.subtask, ShownQuestion(task.question, task.files).labels, *marks)
