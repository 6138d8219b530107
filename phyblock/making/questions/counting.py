"""Number: how many blocks of a color, a shape or both there are; every one can be seen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from phyblock.domain.blocks import BLOCK_TYPES, COLORS
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.measures import layers_of, sure_blocks
from phyblock.making.questions.picture_view import (
    COUNTED,
    NAMED,
    View,
    are_seen,
    goal_picture,
    require_seen,
    require_shapes_seen,
    shown_picture,
)
from phyblock.making.questions.properties import recolored
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.referring import SHAPE_WORDS, names, resolve_one, shape_word
from phyblock.making.questions.selection import pick, shuffled
from phyblock.making.questions.static_drafts import (
    StaticMaker,
    draft,
    index_of,
    seen_blocks,
    window,
)
from phyblock.making.questions.wording import slots_of, stem_of
from phyblock.sim.contact import GROUND, support_graph

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


Slots = Mapping[str, str]
_MOST_BLOCKS = 22
_RECOLORED = ("other", "pair", "kinds", "block")
"""Ways of counting in which the kit's colors would tell too much, or too few blocks have names."""


@dataclass(frozen=True)
class Tally:
    """One way of counting.

    `slots` are those that a text about a picture can have; `count` says how many there are, and
    raises UnfairError where that cannot be told from the picture; `values` are those offered.
    """

    slots: Callable[[QuestionPicture], Sequence[Slots]]
    count: Callable[[QuestionPicture, Slots], int]
    values: Sequence[int]


class TallyMaker(StaticMaker):
    """OC, LC or TC: the ways of counting whose stems begin with the subtask."""

    views_a_scene = 2
    drafts_a_view = 6

    def __init__(self, subtask: Subtask) -> None:
        self.subtask = subtask
        prefix = f"{subtask.lower()}-"
        self._stems = tuple(stem for stem in TALLIES if stem.startswith(prefix))

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One way of counting after another, as far as the picture allows it."""
        colored = recolored(scene, rng)
        for stem in shuffled(rng, self._stems):
            shown = colored if stem.split("-")[1] in _RECOLORED else scene
            picture = goal_picture(shown, view)
            made = _one(shown, picture, stem, rng)
            if made is not None:
                yield made

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Counts anew."""
        picture, slots = shown_picture(question), slots_of(question)
        stem = stem_of(question.wording)
        if stem not in self._stems:
            raise UnfairError(f"the wording {question.wording!r} counts nothing")
        return index_of(question, str(TALLIES[stem].count(picture, slots)))


def _one(
    scene: Scene, picture: QuestionPicture, stem: str, rng: np.random.Generator
) -> Draft | None:
    tally = TALLIES[stem]
    possible = tally.slots(picture)
    if not possible:
        return None
    slots = pick(rng, possible)
    try:
        right = tally.count(picture, slots)
    except UnfairError:
        return None
    values = window(rng, tally.values, right)
    if values is None:
        return None
    options = [str(value) for value in values]
    evidence: dict[str, object] = {"count": right}
    kind = stem
    if stem == "oc-hidden":
        evidence["inferred"] = sorted(set(_orders_tallies(picture)) - set(_in_sight(picture)))
        kind = f"{stem}-{len(evidence['inferred'])}"  # type: ignore[arg-type]
    return draft(scene, picture, rng, stem, slots, options, options[0], kind, **evidence)


def _in_sight(picture: QuestionPicture) -> list[int]:
    return [block.order for block in seen_blocks(picture, COUNTED)]


def _orders_tallies(picture: QuestionPicture) -> list[int]:
    return [block.order for block in picture.blocks]


def _all_seen(picture: QuestionPicture) -> Sequence[Block]:
    require_seen(picture, _orders_tallies(picture), COUNTED)
    return picture.blocks


def _all_shapes_seen(picture: QuestionPicture) -> Sequence[Block]:
    require_shapes_seen(picture)
    return picture.blocks


def _on_ground(blocks: Sequence[Block]) -> list[Block]:
    below = support_graph(blocks)
    return [block for block in blocks if GROUND in below[block.order]]


def _of_colors(picture: QuestionPicture, colors: Sequence[str]) -> int:
    return sum(block.color in colors for block in _all_seen(picture))


def _types(blocks: Sequence[Block]) -> Counter[str]:
    return Counter(block.type for block in blocks)


def _in_layers(picture: QuestionPicture, numbers: Callable[[int], bool]) -> int:
    return sum(map(numbers, layers_of(_all_seen(picture)).values()))


def _layer_of_block(picture: QuestionPicture, slots: Slots) -> int:
    block = resolve_one(slots["block"], picture)
    layers = layers_of(picture.blocks)
    under = [o for o in _orders_tallies(picture) if layers[o] < layers[block.order]]
    require_seen(picture, [block.order], NAMED)
    require_seen(picture, under, COUNTED)
    return layers[block.order]


def _no_slots(picture: QuestionPicture) -> Sequence[Slots]:
    del picture
    return ({},)


def _colors(picture: QuestionPicture) -> Sequence[Slots]:
    return [{"color": color} for color in sorted({b.color for b in picture.blocks})]


def _color_pairs(picture: QuestionPicture) -> Sequence[Slots]:
    colors = sorted({block.color for block in picture.blocks})
    return [{"color": a, "other": b} for a in colors for b in colors if a != b]


def _layer_numbers(picture: QuestionPicture) -> Sequence[Slots]:
    highest = max(block.layer for block in picture.blocks)
    return [{"layer": str(number)} for number in range(1, highest + 1)]


def _named(picture: QuestionPicture) -> Sequence[Slots]:
    found = [names(block, picture, ("color", "type")) for block in seen_blocks(picture, NAMED)]
    return [{"block": expressions[0]} for expressions in found if expressions]


TALLIES: Mapping[str, Tally] = {
    "oc-all": Tally(_no_slots, lambda p, _: len(_all_seen(p)), range(2, _MOST_BLOCKS + 3)),
    "oc-hidden": Tally(_no_slots, lambda p, _: sure_blocks(p), range(2, _MOST_BLOCKS + 3)),
    "oc-ground": Tally(_no_slots, lambda p, _: len(_on_ground(_all_seen(p))), range(1, 13)),
    "oc-raised": Tally(
        _no_slots, lambda p, _: len(_all_seen(p)) - len(_on_ground(p.blocks)), range(1, 17)
    ),
    "oc-other": Tally(
        _colors, lambda p, s: len(p.blocks) - _of_colors(p, [s["color"]]), range(1, 19)
    ),
    "oc-pair": Tally(
        _color_pairs, lambda p, s: _of_colors(p, [s["color"], s["other"]]), range(1, 15)
    ),
    "lc-all": Tally(_no_slots, lambda p, _: max(layers_of(_all_seen(p)).values()), range(1, 9)),
    "lc-block": Tally(_named, _layer_of_block, range(1, 9)),
    "lc-in": Tally(
        _layer_numbers, lambda p, s: _in_layers(p, lambda n: n == int(s["layer"])), range(1, 12)
    ),
    "lc-above": Tally(
        _layer_numbers, lambda p, s: _in_layers(p, lambda n: n > int(s["layer"])), range(1, 12)
    ),
    "tc-all": Tally(
        _no_slots, lambda p, _: len(_types(_all_shapes_seen(p))), range(1, len(BLOCK_TYPES) + 1)
    ),
    "tc-shapes": Tally(
        _no_slots,
        lambda p, _: len({shape_word(block.type) for block in _all_shapes_seen(p)}),
        range(1, len(SHAPE_WORDS) + 1),
    ),
    "tc-once": Tally(
        _no_slots,
        lambda p, _: sum(n == 1 for n in _types(_all_shapes_seen(p)).values()),
        range(0, 7),
    ),
    "tc-ground": Tally(
        _no_slots, lambda p, _: len(_types(_on_ground(_all_shapes_seen(p)))), range(1, 8)
    ),
    "tc-kinds": Tally(
        _no_slots, lambda p, _: len({b.kind for b in _all_shapes_seen(p)}), range(2, 15)
    ),
}
"""By stem of the wordings."""
