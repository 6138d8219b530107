"""What makes questions: drafts, and the makers that draw them and derive their answers anew."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from phyblock.domain.question import Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Scene
from phyblock.errors import PhyblockError

__all__ = ["Draft", "Maker", "Option", "UnfairError"]

Option = str | QuestionPicture | Mark
"""A text; a picture, labeled later; or a place, which is marked in the first picture."""


class UnfairError(PhyblockError):
    """A question has no answer, more than one, or names what cannot be told from the picture."""


@dataclass(frozen=True)
class Draft:
    """A fair question whose options have no letters yet.

    `scene` is the scene as shown, recolored where that is needed; `options` has the right one
    first, or for ordering all four in the right order. `wording` is the id of the template that
    `text` was filled from. `kind` names a sort of question within a subtask, and `value` a sort
    of answer: production takes as even a share of kinds as the scenes allow, and of values where
    the options are no texts. `evidence` is
    what JSON can hold, and names no letters: they are dealt later; `evidence["slots"]` holds what
    the template was filled with. `looks` are measures of options that are no texts, by which a
    reader might guess: drafts are left out until these tell nothing.
    """

    scene: Scene
    text: str
    options: tuple[Option, ...]
    pictures: tuple[QuestionPicture, ...]
    wording: str
    value: str
    kind: str = ""
    looks: tuple[tuple[float, ...], ...] = ()
    evidence: Mapping[str, Any] = field(default_factory=dict)


class Maker(Protocol):
    """Makes the questions of one subtask and can derive an answer again."""

    @property
    def subtask(self) -> Subtask:
        """What it makes questions of."""

    @property
    def scenes_tried(self) -> int:
        """How many scenes, drawn evenly over the levels, are asked for drafts."""

    @property
    def drafts_a_scene(self) -> int:
        """The most drafts that are taken of one scene."""

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Fair questions about a scene, in an order drawn with `rng`; none when it allows none."""

    def rederive(self, question: Question) -> tuple[int, ...]:
        """The right answer, found anew from scene, pictures and simulator; never from `answer`.

        Raises UnfairError when there is not exactly one, or something named cannot be seen.
        """
