"""PD: what can come next in an unfinished assembly, and what follows a slow push."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from phyblock.domain.question import Question, Subtask
from phyblock.domain.scene import Scene
from phyblock.making.questions.marked_blocks import TAKEN, marked_order
from phyblock.making.questions.next_steps import can_follow, next_drafts
from phyblock.making.questions.pictured_drafts import (
    of_kind,
    only_index,
    option_pictures,
    picture_of,
)
from phyblock.making.questions.pushes import meant_push, push_drafts, sure_push, what_happened
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.wording import slots_of

__all__ = ["PredictiveMaker"]


_PUSHED = 0.55
"""How often a push is looked for, which fewer scenes allow than a next step."""


class PredictiveMaker:
    """Kinds: `pd-next` (the next step) and `pd-push` (the settled scene after a push)."""

    subtask: Subtask = "PD"
    scenes_tried = 340
    drafts_a_scene = 1

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """A push or a next step, as drawn, where one is fair."""
        make = push_drafts if rng.random() < _PUSHED else next_drafts
        yield from make(scene, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By statics and simulation."""
        slots = slots_of(question)
        shown, options = picture_of(question, "scene"), option_pictures(question)
        if of_kind(question) == "pd-next":
            return only_index([can_follow(shown, one) for one in options])
        before = shown.blocks
        push = meant_push(shown, marked_order(shown, TAKEN), slots["direction"])
        outcome = sure_push(before, push)
        if outcome is None:
            raise UnfairError("it is not sure what follows the push")
        expected = what_happened(before, replace(shown, blocks=outcome.settled), push)
        return only_index([what_happened(before, one, push) == expected for one in options])
