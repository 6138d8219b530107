"""Counting blocks of a kind, all blocks, layers and types; every counted block can be seen."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence

import numpy as np

from phyblock.domain.blocks import COLORS
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.sim.support import GROUND, bounds_m, support_graph
from phyblock_making.questions.choices import shuffled
from phyblock_making.questions.goal_view import (
    COUNTED,
    View,
    are_seen,
    goal_picture,
    require_seen,
    require_shapes_seen,
    shown_picture,
)
from phyblock_making.questions.question_draft import Draft, UnfairError
from phyblock_making.questions.referring import SHAPE_WORDS
from phyblock_making.questions.static_drafts import StaticMaker, draft, index_of, window
from phyblock_making.questions.wording import slots_of

__all__ = ["CountMaker", "LayerMaker", "NumberMaker", "TypeMaker"]

_PLURALS = {word: f"{word}es" if word == "arch" else f"{word}s" for word in SHAPE_WORDS}
_TYPES_OF = {_PLURALS[word]: types for word, types in SHAPE_WORDS.items()}
_TRIES = 4
_WEDGED_M = 0.005


def _orders(blocks: Sequence[Block]) -> list[int]:
    return [block.order for block in blocks]


class NumberMaker(StaticMaker):
    """NU: how many blocks there are of a color, a shape, or both."""

    subtask: Subtask = "NU"

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
            values = window(rng, range(1, 8), len(counted))
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


class _WholeMaker(StaticMaker):
    """One number that a whole scene has."""

    subtask: Subtask
    views_a_scene = 2
    drafts_a_view = _TRIES

    def __init__(
        self,
        values: Sequence[int],
        count: Callable[[Sequence[Block]], int],
        require: Callable[[QuestionPicture], None],
    ) -> None:
        self._values, self._count, self._require = values, count, require

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """The same question with windows of options that differ."""
        picture = goal_picture(scene, view)
        try:
            self._require(picture)
            right = self._count(scene.blocks)
        except UnfairError:
            return
        for _ in range(_TRIES):
            values = window(rng, self._values, right)
            if values is not None:
                options = [str(value) for value in values]
                yield draft(
                    scene, picture, rng, self.subtask.lower(), {}, options, options[0], count=right
                )

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Counts anew."""
        picture = shown_picture(question)
        slots_of(question)
        self._require(picture)
        return index_of(question, str(self._count(picture.blocks)))


class CountMaker(_WholeMaker):
    """OC: how many blocks in all."""

    subtask: Subtask = "OC"

    def __init__(self) -> None:
        super().__init__(range(2, 18), len, _require_counted)


class LayerMaker(_WholeMaker):
    """LC: how many layers, by what rests on what."""

    subtask: Subtask = "LC"

    def __init__(self) -> None:
        super().__init__(range(2, 9), _layers, _require_counted)


class TypeMaker(_WholeMaker):
    """TC: how many types, that is shapes and sizes."""

    subtask: Subtask = "TC"

    def __init__(self) -> None:
        super().__init__(range(2, 9), _types, require_shapes_seen)


def _require_counted(picture: QuestionPicture) -> None:
    require_seen(picture, _orders(picture.blocks), COUNTED)


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


def _types(blocks: Sequence[Block]) -> int:
    return len({block.type for block in blocks})


def _layers(blocks: Sequence[Block]) -> int:
    """The longest chain of blocks that rest on one another, from contacts alone.

    UnfairError where it is longer than what the picture tells: a block that is wedged between two
    slopes rests on them, and yet it looks as if it were beside them.
    """
    below = support_graph(blocks)
    top = {block.order: bounds_m(block)[1, 2] for block in blocks} | {GROUND: 0.0}
    bottom = {block.order: bounds_m(block)[0, 2] for block in blocks}
    plain = {
        order: {other for other in others if bottom[order] > top[other] - _WEDGED_M} or {GROUND}
        for order, others in below.items()
    }
    counted = _longest(below)
    if counted != _longest(plain):
        raise UnfairError("some block rests on others and stands lower than they reach")
    return counted


def _longest(below: Mapping[int, Collection[int]]) -> int:
    layer = {GROUND: 0}
    while len(layer) <= len(below):
        ready = [o for o in below if o not in layer and below[o] and set(below[o]) <= layer.keys()]
        if not ready:
            raise UnfairError("some block rests on nothing, or on itself")
        layer.update({order: 1 + max(layer[other] for other in below[order]) for order in ready})
    return max(layer.values())
