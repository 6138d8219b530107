"""How questions of the VQA track are shown, answered and read."""

from __future__ import annotations

from dataclasses import dataclass

from phyblock.domain import Question
from phyblock.parsing.answer import ParsedAnswer, choice_form, parse_answer
from phyblock.parsing.structured import AnswerForm
from phyblock.tracks.vqa.baselines import choice_text
from phyblock.tracks.vqa.pictures import OptionsAs
from phyblock.types import AnswerFormat

__all__ = ["VqaRules"]


@dataclass(frozen=True)
class VqaRules:
    """How questions are shown.

    `circular`: every rotation of the options is asked; `blind`: no picture is sent;
    `wrong_image`: the pictures are those of a question about another scene.
    """

    options_as: OptionsAs = "images"
    circular: bool = False
    blind: bool = False
    wrong_image: bool = False
    answer_format: AnswerFormat = "text"

    def form(self, question: Question) -> AnswerForm[str] | None:
        """The form in which an answer is asked for; None where that is text."""
        if self.answer_format == "text":
            return None
        return choice_form(question.options, question.subtask == "OR")

    def read(self, question: Question, text: str) -> ParsedAnswer:
        """What a reply to a question says."""
        return parse_answer(text, question.options, question.subtask == "OR")

    def right_answer(self, question: Question) -> str:
        """A right answer in the form that is asked for."""
        form, letters = self.form(question), question.answer_letters
        if form is None:
            return choice_text(question.answer)
        value = list(letters) if question.subtask == "OR" else letters
        return form.write(value, f"The right answer is {', '.join(letters)}.")
