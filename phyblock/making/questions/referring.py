"""Words that fit exactly one block: by color, type, layer, place in the picture, or support.

An expression is `[side] [color] noun [in layer N] [resting on the [color] noun]`. What a reader
understands by it is computed from the text again by `resolve`, so that a question can be checked
from its words alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from phyblock.domain.blocks import COLORS, SHAPES, BlockType, Color
from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block
from phyblock.making.questions.draft import UnfairError, pick
from phyblock.making.questions.view import NAMED, outermost, seen_blocks, shows_profile
from phyblock.sim.contact import bounds_m

Feature = Literal["color", "type", "size", "layer", "side", "support"]
"""Features of an expression; `size` tells rectangular prisms apart by their length."""
_ORDER = ("cube", "rectangular prism", "triangular prism", "half cylinder", "cylinder", "arch")
"""The paper's six words (appendix A.4); those of further shapes come behind."""
SHAPE_WORDS: dict[str, tuple[BlockType, ...]] = {
    word: tuple(one for one, shape in SHAPES.items() if shape.word == word)
    for word in dict.fromkeys((*_ORDER, *(shape.word for shape in SHAPES.values())))
}
"""The types that each word names."""
_SIZED: dict[str, tuple[BlockType, ...]] = {
    shape.exact: (one,) for one, shape in SHAPES.items() if shape.exact
}
_NOUNS: dict[str, tuple[BlockType, ...]] = {
    **SHAPE_WORDS,
    **_SIZED,
    "block": tuple(block_type for types in SHAPE_WORDS.values() for block_type in types),
}
_SIDES = ("leftmost", "rightmost", "topmost")
_TOP_GAP_M = 0.02
_NAMES_DRAWN_FROM = 3
_PLAIN: tuple[Feature, ...] = ("color", "type")
_SIMPLE = rf"(?:(?:{'|'.join(COLORS)}) )?(?:{'|'.join(_NOUNS)})"
_PATTERN = re.compile(
    rf"(?:(?P<side>{'|'.join(_SIDES)}) )?(?:(?P<color>{'|'.join(COLORS)}) )?"
    rf"(?P<noun>{'|'.join(_NOUNS)})(?: in layer (?P<layer>\d))?"
    rf"(?: resting on the (?P<support>{_SIMPLE}))?"
)


@dataclass(frozen=True)
class _Expression:
    noun: str
    color: Color | None = None
    layer: int | None = None
    side: str | None = None
    support: str | None = None

    @property
    def text(self) -> str:
        """Without an article."""
        words = [word for word in (self.side, self.color, self.noun) if word]
        if self.layer is not None:
            words.append(f"in layer {self.layer}")
        if self.support is not None:
            words.append(f"resting on the {self.support}")
        return " ".join(words)


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
    words = match.groupdict()
    fitting = [block for block in picture.blocks if _fits(block, words, loosely, picture)]
    if words["layer"] is not None:
        layers = [block.layer for block in fitting]
        if len(set(layers)) < len(layers):
            return ()
        fitting = [block for block in fitting if block.layer == int(words["layer"])]
    if words["support"] is not None:
        below = resolve(words["support"], picture, loosely)
        fitting = [b for b in fitting if len(below) == 1 and set(b.depend) == set(below)]
    if words["side"] is not None:
        fitting = _outermost(fitting, picture, words["side"])
    return tuple(block.order for block in fitting)


def resolve_one(text: str, picture: QuestionPicture) -> Block:
    """The one block that an expression fits, even loosely; UnfairError otherwise."""
    orders, loose = resolve(text, picture), resolve(text, picture, loosely=True)
    if len(orders) != 1:
        raise UnfairError(f"{text!r} fits {len(orders)} blocks")
    if loose != orders:
        raise UnfairError(f"{text!r} may be taken for another block")
    return next(block for block in picture.blocks if block.order == orders[0])


def names(block: Block, picture: QuestionPicture, features: Sequence[Feature]) -> tuple[str, ...]:
    """Expressions that fit this block alone and speak of these features only, shortest first."""
    shortest: list[_Expression] = []
    for expression in _expressions(block, picture, features):
        is_longer = any(_is_part(shorter, expression) for shorter in shortest)
        readings = (resolve(expression.text, picture, loosely) for loosely in (False, True))
        if not is_longer and all(reading == (block.order,) for reading in readings):
            shortest.append(expression)
    return tuple(expression.text for expression in shortest)


def drawn_name(
    rng: np.random.Generator, block: Block, picture: QuestionPicture, features: Sequence[Feature]
) -> str | None:
    """One of the shortest expressions that fit a block alone, or None when nothing does."""
    expressions = names(block, picture, features)
    return pick(rng, expressions[:_NAMES_DRAWN_FROM]) if expressions else None


def plain_names(picture: QuestionPicture) -> dict[int, str]:
    """The shortest name by color and type of each block that shows enough, by order."""
    found = ((b.order, names(b, picture, _PLAIN)) for b in seen_blocks(picture, NAMED))
    return {order: expressions[0] for order, expressions in found if expressions}


def _expressions(
    block: Block, picture: QuestionPicture, features: Sequence[Feature]
) -> Iterator[_Expression]:
    """All that is true of a block, the simple before the long."""
    colors: list[Color | None] = [block.color, None] if "color" in features else [None]
    nouns = ["block"]
    if "type" in features:
        nouns.append(shape_word(block.type))
    if "size" in features:
        nouns += [noun for noun, types in _SIZED.items() if block.type in types]
    simple = [_Expression(noun, color) for noun in nouns for color in colors]
    yield from sorted(simple, key=lambda one: len(one.text.split()))
    for one in simple:
        if "side" in features:
            for side in _SIDES:
                yield _Expression(one.noun, one.color, side=side)
        if "layer" in features:
            yield _Expression(one.noun, one.color, layer=block.layer)
    below = [other for other in picture.blocks if other.order in block.depend]
    if "support" in features and len(below) == 1:
        plain = [f for f in features if f in ("color", "type")]
        for name in names(below[0], picture, plain):
            for one in simple:
                yield _Expression(one.noun, one.color, support=name)


def _is_part(shorter: _Expression, longer: _Expression) -> bool:
    """True if the longer says the same and more."""
    pairs = (
        (shorter.color, longer.color),
        (shorter.layer, longer.layer),
        (shorter.side, longer.side),
        (shorter.support, longer.support),
    )
    fits = set(_NOUNS[longer.noun]) <= set(_NOUNS[shorter.noun])
    return fits and all(short is None or short == long for short, long in pairs)


def _fits(
    block: Block, words: Mapping[str, str | None], loosely: bool, picture: QuestionPicture
) -> bool:
    types = set(_NOUNS[words["noun"] or "block"])
    if loosely and words["noun"] != "block" and not shows_profile(block, picture.view_deg):
        # Seen from this side, it may be taken for anything but what it is.
        return block.type not in types and words["color"] in (None, block.color)
    if loosely:
        types = types.union(*(SHAPES[one].mistaken_for for one in types))
    return block.type in types and words["color"] in (None, block.color)


def _outermost(fitting: list[Block], picture: QuestionPicture, side: str) -> list[Block]:
    """The one that is clearly outermost, or none."""
    if not fitting:
        return []
    if side == "topmost":
        reach = {b.order: float(bounds_m(b)[1, 2]) for b in fitting}
        ranked = sorted(fitting, key=lambda b: -reach[b.order])
        is_clear = len(ranked) < 2 or (
            reach[ranked[0].order] - reach[ranked[1].order] >= _TOP_GAP_M
        )
        return ranked[:1] if is_clear else []
    order = outermost([b.order for b in fitting], picture, to_left=side == "leftmost")
    return [block for block in fitting if block.order == order]
