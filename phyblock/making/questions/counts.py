"""Number: how many blocks of a color, a shape or both there are; every one can be seen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from phyblock.domain.blocks import COLORS
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.choices import shuffled
from phyblock.making.questions.picture_view import (
    COUNTED,
    View,
    are_seen,
    goal_picture,
    require_seen,
    require_shapes_seen,
    shown_picture,
)
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.referring import SHAPE_WORDS
from phyblock.making.questions.static_drafts import StaticMaker, draft, index_of, window
from phyblock.making.questions.wording import slots_of

__all__ = ["NumberMaker"]

_PLURALS = {word: f"{word}es" if word == "arch" else f"{word}s" for word in SHAPE_WORDS}
_TYPES_OF = {_PLURALS[word]: types for word, types in SHAPE_WORDS.items()}

_MOST = 13


def _orders(blocks: Sequence[Block]) -> list[int]:
    return [block.order for block in blocks]


class NumberMaker(StaticMaker):
    """NU: how many blocks there are of a color, a shape, or both."""

    subtask: Subtask = "NU"
    views_a_scene = 2

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Of all that can be counted in a scene whose blocks all show enough."""
        picture = goal_picture(scene, view)
        if not are_seen(picture, _orders(scene.blocks), COUNTED):
            return
        colors = [color for color in COLORS if any(b.color == color for b in scene.blocks)]
        kinds = [(f"{color} blocks", "color") for color in colors]
        kinds += [(word, "shape") for word in _TYPES_OF]
        kinds += [(f"{color} {word}", "both") for color in colors for word in _TYPES_OF]
        if not _shapes_are_seen(picture):
            kinds = [(what, kind) for what, kind in kinds if kind == "color"]
        for what, kind in shuffled(rng, kinds):
            counted = _fitting(what, scene.blocks)
            values = window(rng, range(1, _MOST), len(counted))
            if values is not None:
                options = [str(value) for value in values]
                evidence = {"counted": _orders(counted)}
                slots = {"what": what}
                yield draft(scene, picture, rng, "nu", slots, options, options[0], kind, **evidence)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Counts the blocks that fit the words."""
        picture = shown_picture(question)
        require_seen(picture, _orders(picture.blocks), COUNTED)
        what = slots_of(question)["what"]
        if not what.endswith(" blocks"):
            require_shapes_seen(picture)
        return index_of(question, str(len(_fitting(what, picture.blocks))))


def _shapes_are_seen(picture: QuestionPicture) -> bool:
    try:
        require_shapes_seen(picture)
    except UnfairError:
        return False
    return True


def _fitting(what: str, blocks: Sequence[Block]) -> list[Block]:
    """The blocks that `red blocks`, `cubes` or `red cubes` speaks of."""
    first, _, rest = what.partition(" ")
    color, noun = (first, rest) if first in COLORS else ("", what)
    if noun not in (*_TYPES_OF, "blocks"):
        raise UnfairError(f"{what!r} cannot be counted")
    types = _TYPES_OF.get(noun)
    return [
        block
        for block in blocks
        if color in ("", block.color) and (types is None or block.type in types)
    ]
