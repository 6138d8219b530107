"""The messages of one step: goal, candidates, current picture, then text with the history.

The history is a text in one message, or the turns of a conversation, of which the first message
always holds the goal and the candidates.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from phyblock.models.base import Image, Message
from phyblock.parsing.move import MoveProblem, ParsedMove
from phyblock.parsing.structured import AnswerForm
from phyblock.scoring.steps import MoveOutcome
from phyblock.tracks.prompts import TemplatePrompt, form_facts
from phyblock.types import CandidateScale, Gating, Setting

__all__ = ["Feedback", "History", "PastStep", "StepOutcome", "StepPrompt"]

Feedback = Literal["none", "success", "error_type"]
History = Literal["text", "turns"]
StepOutcome = MoveOutcome | Literal["done"] | MoveProblem
"""What became of a step; a problem is a reply in which no single operation could be read."""

_FORMAT: Mapping[str, str] = {
    "empty": "the answer was empty",
    "thoughts_only": "the answer was empty",
    "no_move": "no operation could be read",
    "several_moves": "more than one operation was given",
}
_REASONS: Mapping[str, str] = {
    "shape_not_in_gt": "the goal has no block of this type and color",
    "overflow": "every such block of the goal is already placed",
    "incorrect_orientation": "no such block that is missing has this orientation",
    "dependency_not_met": "what must be there before it is not there yet",
    "invalid": "no candidate has this number",
}
_NO_TEXT = "(no answer)"


@dataclass(frozen=True)
class PastStep:
    """A step that was taken: the operation, what became of it, the reply that stands for it, and
    the picture that it was chosen from (None where none is sent).
    """

    operation: str
    outcome: StepOutcome
    reply: str
    seen: Image | None

    def report(self, feedback: Feedback) -> str:
        """What the model is told about it."""
        if feedback == "none":
            return ""
        if self.outcome == "placed":
            return "it worked, the block is placed"
        why = _FORMAT.get(self.outcome, "")
        if feedback == "error_type":
            why = why or _REASONS[self.outcome]
        return f"it failed, {why}" if why else "it failed, nothing was placed"


@dataclass(frozen=True)
class StepPrompt:
    """A template with its rules; `memory` is how many earlier steps are shown, None for all.

    By `gating` and the setting `accepts` a move succeeds, of which the model is told; with
    `is_blind` it is not shown the goal. `form` is that of an answer with so many candidates, None
    for text.
    """

    template: TemplatePrompt
    feedback: Feedback
    history: History
    memory: int | None
    cot: bool
    gating: Gating = "aov"
    accepts: Setting = "A"
    is_blind: bool = False
    form: Callable[[int], AnswerForm[ParsedMove] | None] = lambda _: None

    def __post_init__(self) -> None:
        """Raise PromptError where the template has no text for the turns of a conversation."""
        if self.history == "turns":
            self.template.require("turn", "for the later messages of history: turns")

    def messages(
        self,
        fixed: Sequence[Image],
        current: Image,
        past: Sequence[PastStep],
        n_candidates: int,
        max_steps: int,
        candidate_scale: CandidateScale | None = None,
    ) -> tuple[Message, ...]:
        """The messages of the step after `past`; `fixed` are the goal and the candidates.

        `candidate_scale` is None where the pictures are not drawn here.
        """
        hidden = 0 if self.memory is None else max(0, len(past) - self.memory)
        facts: dict[str, object] = {
            "n_candidates": n_candidates,
            "candidate_scale": candidate_scale,
            "max_steps": max_steps,
            "cot": self.cot,
            "gating": self.gating,
            "setting": self.accepts,
            "is_blind": self.is_blind,
            "n_hidden": hidden,
            **form_facts(self.form(n_candidates)),
        }
        facts["answer"] = self.template.text("answer", facts)
        if self.history == "text":
            return self._first(fixed, current, facts, past, hidden, len(past) + 1)
        shown = list(past[hidden:])
        seen = [step.seen or current for step in shown] + [current]
        messages = list(self._first(fixed, seen[0], facts, (), hidden, hidden + 1))
        for number, (step, picture) in enumerate(zip(shown, seen[1:], strict=True), hidden + 2):
            facts_of_turn = {"told": step.report(self.feedback), "step": number, "history": []}
            text = self.template.text(
                "turn", {**facts, **facts_of_turn, "pictures": [picture.label]}
            )
            messages.append(Message("assistant", (step.reply.strip() or _NO_TEXT,)))
            messages.append(Message("user", (picture, text)))
        return tuple(messages)

    def _first(
        self,
        fixed: Sequence[Image],
        current: Image,
        facts: Mapping[str, object],
        past: Sequence[PastStep],
        hidden: int,
        step: int,
    ) -> tuple[Message, ...]:
        """The message with the goal and the candidates, and a system message if there is one."""
        pictures = (*fixed, current)
        history = [
            {"step": number, "operation": one.operation, "told": one.report(self.feedback)}
            for number, one in enumerate(past[hidden:], hidden + 1)
        ]
        last = past[-1].report(self.feedback) if past else ""
        labels = [picture.label for picture in pictures]
        more = {"pictures": labels, "step": step, "history": history, "told": last}
        return self.template.messages(pictures, {**facts, **more})
