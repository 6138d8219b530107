"""What the makers of static subtasks share: one picture, wordings, options that are texts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

import numpy as np

from phyblock.domain.question import Question, QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.picture_view import View, drawn_view, shares
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.referring import Feature, names
from phyblock.making.questions.selection import pick, shuffled
from phyblock.making.questions.wording import fill, wording_ids

__all__ = [
    "StaticMaker",
    "draft",
    "drawn_name",
    "index_of",
    "seen_blocks",
    "window",
    "wrong_options",
]

_NAMES_DRAWN_FROM = 3


class StaticMaker(ABC):
    """Drafts cost little, so every scene is asked, each time from views drawn for it."""

    scenes_tried: int = 400
    views_a_scene: int = 1
    drafts_a_view: int = 12

    @property
    def drafts_a_scene(self) -> int:
        """The most drafts that are taken of one scene."""
        return self.views_a_scene * self.drafts_a_view

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Fair questions about a scene, view by view."""
        for _ in range(self.views_a_scene):
            yield from islice(self.seen_from(drawn_view(rng), scene, rng), self.drafts_a_view)

    @abstractmethod
    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Fair questions about a scene that is seen from a view."""


def draft(
    scene: Scene,
    picture: QuestionPicture,
    rng: np.random.Generator,
    stem: str,
    slots: Mapping[str, str],
    options: Sequence[str],
    value: str,
    kind: str = "",
    **evidence: Any,
) -> Draft:
    """A draft about one picture, in a wording drawn from those of a stem; right option first."""
    wording = pick(rng, wording_ids(stem))
    return Draft(
        scene=scene,
        text=fill(wording, **slots),
        options=tuple(options),
        pictures=(picture,),
        wording=wording,
        value=value,
        kind=kind,
        evidence={"slots": dict(slots), **evidence},
    )


def wrong_options(
    rng: np.random.Generator, allowed: Sequence[str], right: str, count: int = 3
) -> list[str]:
    """`count` of the allowed that are not the right one."""
    return shuffled(rng, [option for option in allowed if option != right])[:count]


def seen_blocks(picture: QuestionPicture, least: float) -> list[Block]:
    """The blocks that show at least this share of themselves in a picture."""
    seen = shares(picture)
    return [block for block in picture.blocks if seen[block.order] >= least]


def drawn_name(
    rng: np.random.Generator, block: Block, picture: QuestionPicture, features: Sequence[Feature]
) -> str | None:
    """One of the shortest expressions that fit a block alone, or None when nothing does."""
    expressions = names(block, picture, features)
    return pick(rng, expressions[:_NAMES_DRAWN_FROM]) if expressions else None


def window(rng: np.random.Generator, values: Sequence[int], right: int) -> tuple[int, ...] | None:
    """Four neighbors among the allowed values that hold the right one, in a place drawn evenly.

    The right one stands first. None where it is not allowed, or the place drawn does not exist.
    """
    if right not in values:
        return None
    start = values.index(right) - int(rng.integers(4))
    if start < 0 or start + 4 > len(values):
        return None
    chosen = values[start : start + 4]
    return (right, *(value for value in chosen if value != right))


def index_of(question: Question, right: str) -> tuple[int, ...]:
    """Where the right option stands; UnfairError unless exactly one option says so."""
    places = [i for i, option in enumerate(question.options) if option == right]
    if len(places) != 1:
        raise UnfairError(f"the right answer {right!r} is {len(places)} of the options")
    return (places[0],)
