"""What the VQA track adds to a record: which question it was, and which answer was given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from phyblock.records import Line, Record
from phyblock.records.line import Whole

__all__ = ["ChoiceParse", "ChoiceRecord", "GivenAnswer", "QuestionShown"]


_QUESTION = ("id", "subtask", "category", "rotation")
_ANSWER = ("right", "given", "correct")


class ChoiceParse(Line):
    """The answer that was read in a reply."""

    rule: str | None
    """The rule that matched; null: nothing could be read."""
    letters: str | None = None
    """One letter, or for ordering all in order."""
    problem: str | None = None
    """Why no answer could be read in the JSON that was asked for."""


class QuestionShown(Line):
    """A question and how it was shown."""

    id: str
    """Its name in the question set."""
    subtask: str
    """Its subtask."""
    category: str = ""
    """The category of the subtask."""
    rotation: Whole = 0
    """Number of places by which its options were turned."""
    options_as: str = ""
    """Whether options that are pictures were sent as pictures or as letters in one."""
    blind: bool = False
    """Whether no picture was sent."""
    wrong_image: bool = False
    """Whether the pictures were those of another scene."""


class GivenAnswer(Line):
    """What was answered, and what is right."""

    right: str
    """The right letters."""
    given: str | None
    """The letters given, null: none."""
    correct: bool
    """Whether they are the same."""


class ChoiceRecord(Record):
    """An answer to a question."""

    track: Literal["vqa"]
    """`vqa`."""
    parse: ChoiceParse | None = None
    """The answer that was read."""
    question: QuestionShown
    """Which question it is and how it was shown."""
    answer: GivenAnswer | None = None
    """What was answered."""

    columns: ClassVar[Mapping[str, str]] = {
        "question": "object",
        "subtask": "object",
        "rotation": "Int64",
        "right": "object",
        "given": "object",
    }

    def row(self) -> Mapping[str, Any]:
        """Which question it is, the letters that are right and those given."""
        answer = self.answer
        return {
            "question": self.question.id,
            "subtask": self.question.subtask,
            "rotation": self.question.rotation,
            "right": answer and answer.right,
            "given": answer and answer.given,
        }

    exported: ClassVar[Mapping[str, str]] = {
        "question_id": "string",
        "question_subtask": "string",
        "question_category": "string",
        "question_rotation": "Int64",
        "answer_right": "string",
        "answer_given": "string",
        "answer_correct": "boolean",
    }

    def export_row(self) -> Mapping[str, Any]:
        """Which question it is, the right answer, and the one that was given."""
        question = {name: getattr(self.question, name) for name in _QUESTION}
        answer = {name: getattr(self.answer, name, None) for name in _ANSWER}
        return {
            **{f"question_{name}": value for name, value in question.items()},
            **{f"answer_{name}": value for name, value in answer.items()},
        }

    @property
    def part(self) -> str:
        """The subtask."""
        return self.question.subtask

    @property
    def is_correct(self) -> bool | None:
        """Whether the answer is right."""
        return None if self.answer is None else self.answer.correct

    @property
    def target(self) -> str:
        """The right letters."""
        return "" if self.answer is None else self.answer.right

    @property
    def said(self) -> str | None:
        """The letters given."""
        return None if self.answer is None else self.answer.given
