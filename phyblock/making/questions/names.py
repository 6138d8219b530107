"""Words that fit exactly one block: by color, type, layer, place in the picture, or support.

An expression is `[side] [color] noun [in layer N] [resting on the [color] noun]`. What a reader
understands by it is computed from the text again by `resolve`, so that a question can be checked
from its words alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from phyblock.domain.blocks import COLORS, SHAPES, BlockType
from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block
from phyblock.making.questions.base import (
    NAMED,
    UnfairError,
    outermost,
    pick,
    seen_blocks,
    shows_profile,
)
from phyblock.sim.contact import bounds_m

Feature = Literal["color", "type", "layer", "side", "support"]
_ORDER = ("cube", "rectangular prism", "triangular prism", "half cylinder", "cylinder", "arch")
"""The paper's six words (appendix A.4); those of further shapes come behind."""
SHAPE_WORDS: dict[str, tuple[BlockType, ...]] = {
    word: tuple(one for one, shape in SHAPES.items() if shape.word == word)
    for word in dict.fromkeys((*_ORDER, *(shape.word for shape in SHAPES.values())))
}
"""The types that each word names."""
_NOUNS = {**SHAPE_WORDS, "block": sum(SHAPE_WORDS.values(), ())}
_SIDES = ("leftmost", "rightmost", "topmost")
_TOP_GAP_M = 0.02
_NAMES_DRAWN_FROM = 3
_SIMPLE = rf"(?:(?:{'|'.join(COLORS)}) )?(?:{'|'.join(_NOUNS)})"
_PATTERN = re.compile(
    rf"(?:(?P<side>{'|'.join(_SIDES)}) )?(?:(?P<color>{'|'.join(COLORS)}) )?"
    rf"(?P<noun>{'|'.join(_NOUNS)})(?: in layer (?P<layer>\d))?"
    rf"(?: resting on the (?P<support>{_SIMPLE}))?"
)


class _Words(NamedTuple):
    noun: str
    color: str | None = None
    layer: str | None = None
    side: str | None = None
    support: str | None = None

    @property
    def text(self) -> str:
        """Without an article."""
        words = [word for word in (self.side, self.color, self.noun) if word]
        words += [f"in layer {self.layer}"] if self.layer else []
        words += [f"resting on the {self.support}"] if self.support else []
        return " ".join(words)

    def says_more_than(self, shorter: _Words) -> bool:
        """True if these say what others do, and perhaps more."""
        fits = set(_NOUNS[self.noun]) <= set(_NOUNS[shorter.noun])
        pairs = zip(shorter[1:], self[1:], strict=True)
        return fits and all(short is None or short == long for short, long in pairs)


def shape_word(block_type: BlockType) -> str:
    """The paper's word for a type; the three cuboids share one."""
    return next(word for word, types in SHAPE_WORDS.items() if block_type in types)


def resolve(text: str, picture: QuestionPicture, loosely: bool = False) -> tuple[int, ...]:
    """Orders of the blocks that an expression fits, of those that stand in the picture.

    None when what it says is too close to call: two blocks about as far to the left, or two
    blocks of that color and type in one layer. `loosely` is how someone reads who takes cubes for
    short rectangular prisms, half cylinders for cylinders, and the other way round. Raises
    UnfairError for words that are no expression.
    """
    match = _PATTERN.fullmatch(text.removeprefix("the "))
    if match is None:
        raise UnfairError(f"{text!r} names no block")
    words = _Words(**match.groupdict())
    fitting = [block for block in picture.blocks if _fits(block, words, loosely, picture)]
    if words.layer is not None:
        layers = [block.layer for block in fitting]
        if len(set(layers)) < len(layers):
            return ()
        fitting = [block for block in fitting if block.layer == int(words.layer)]
    if words.support is not None:
        below = resolve(words.support, picture, loosely)
        fitting = [b for b in fitting if len(below) == 1 and set(b.depend) == set(below)]
    if words.side == "topmost":
        top_m = {b.order: float(bounds_m(b)[1, 2]) for b in fitting}
        ranked = sorted(fitting, key=lambda b: -top_m[b.order])
        highest = [b for b in ranked if top_m[ranked[0].order] - top_m[b.order] < _TOP_GAP_M]
        fitting = highest if len(highest) == 1 else []
    elif words.side is not None and fitting:
        orders = [block.order for block in fitting]
        order = outermost(orders, picture, to_left=words.side == "leftmost")
        fitting = [block for block in fitting if block.order == order]
    return tuple(block.order for block in fitting)


def _fits(block: Block, words: _Words, loosely: bool, picture: QuestionPicture) -> bool:
    if words.color not in (None, block.color):
        return False
    types = set(_NOUNS[words.noun])
    if loosely and words.noun != "block" and not shows_profile(block, picture.view_deg):
        # Seen from this side, it may be taken for anything but what it is.
        return block.type not in types
    if loosely:
        types = types.union(*(SHAPES[one].mistaken_for for one in types))
    return block.type in types


def resolve_one(text: str, picture: QuestionPicture) -> Block:
    """The one block that an expression fits, even loosely; UnfairError otherwise."""
    orders = resolve(text, picture)
    if len(orders) != 1:
        raise UnfairError(f"{text!r} fits {len(orders)} blocks")
    if resolve(text, picture, loosely=True) != orders:
        raise UnfairError(f"{text!r} may be taken for another block")
    return next(block for block in picture.blocks if block.order == orders[0])


def names(block: Block, picture: QuestionPicture, features: Sequence[Feature]) -> tuple[str, ...]:
    """Expressions that fit this block alone and speak of these features only, shortest first."""
    shortest: list[_Words] = []
    for words in _expressions(block, picture, features):
        is_longer = any(words.says_more_than(shorter) for shorter in shortest)
        readings = (resolve(words.text, picture, loosely) for loosely in (False, True))
        if not is_longer and all(reading == (block.order,) for reading in readings):
            shortest.append(words)
    return tuple(words.text for words in shortest)


def drawn_name(
    rng: np.random.Generator, block: Block, picture: QuestionPicture, features: Sequence[Feature]
) -> str | None:
    """One of the shortest expressions that fit a block alone, or None when nothing does."""
    expressions = names(block, picture, features)
    return pick(rng, expressions[:_NAMES_DRAWN_FROM]) if expressions else None


def plain_names(picture: QuestionPicture) -> Mapping[int, str]:
    """The shortest name by color and type of each block that shows enough, by order."""
    found = ((b.order, names(b, picture, ("color", "type"))) for b in seen_blocks(picture, NAMED))
    return {order: expressions[0] for order, expressions in found if expressions}


def _expressions(
    block: Block, picture: QuestionPicture, features: Sequence[Feature]
) -> Iterator[_Words]:
    """All that is true of a block, the simple before the long."""
    colors = [block.color, None] if "color" in features else [None]
    nouns = ["block", shape_word(block.type)] if "type" in features else ["block"]
    simple = [_Words(noun, color) for noun in nouns for color in colors]
    yield from sorted(simple, key=lambda one: len(one.text.split()))
    for one in simple:
        if "side" in features:
            for side in _SIDES:
                yield one._replace(side=side)
        if "layer" in features:
            yield one._replace(layer=str(block.layer))
    below = [other for other in picture.blocks if other.order in block.depend]
    if "support" in features and len(below) == 1:
        plain = [f for f in features if f in ("color", "type")]
        for name in names(below[0], picture, plain):
            for one in simple:
                yield one._replace(support=name)
