"""Words that fit exactly one block: by color, type, layer, place in the picture, or support.

An expression is `[side] [color] noun [in layer N] [resting on the [color] noun]`. What a reader
understands by it is computed from the text again by `resolve`, so that a question can be checked
from its words alone.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np

from phyblock.domain.blocks import COLORS, SHAPES, BlockType
from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block
from phyblock.making.questions.base import UnfairError, pick
from phyblock.making.questions.sight import NAMED, outermost, seen_blocks, shows_profile
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


def shape_word(block_type: BlockType) -> str:
    """Return the paper's word for a type; the three cuboids share one."""
    return next(word for word, types in SHAPE_WORDS.items() if block_type in types)


def resolve(text: str, picture: QuestionPicture, loosely: bool = False) -> tuple[int, ...]:
    """Return the orders of the blocks that an expression fits, of those that are in the picture.

    None when what it says is too close to call: two blocks about as far to the left, or two
    blocks of that color and type in one layer. `loosely` is how someone reads who takes cubes for
    short rectangular prisms, half cylinders for cylinders, and the other way round. Raises
    UnfairError for words that are no expression.
    """
    match = _PATTERN.fullmatch(text.removeprefix("the "))
    if match is None:
        raise UnfairError(f"{text!r} names no block")
    side, color, noun, layer, support = match.group("side", "color", "noun", "layer", "support")
    fitting = [
        block
        for block in picture.blocks
        if color in (None, block.color) and _is_called(block, noun, loosely, picture)
    ]
    if layer is not None:
        layers = [block.layer for block in fitting]
        if len(set(layers)) < len(layers):
            return ()
        fitting = [block for block in fitting if block.layer == int(layer)]
    if support is not None:
        below = resolve(support, picture, loosely)
        fitting = [b for b in fitting if len(below) == 1 and set(b.depend) == set(below)]
    if side == "topmost" and fitting:
        tops_m = [float(bounds_m(block)[1, 2]) for block in fitting]
        close = [b for b, m in zip(fitting, tops_m, strict=True) if max(tops_m) - m < _TOP_GAP_M]
        fitting = close if len(close) == 1 else []
    elif side is not None and fitting:
        found = outermost(fitting, picture, to_left=side == "leftmost")
        fitting = [found] if found else []
    return tuple(block.order for block in fitting)


def _is_called(block: Block, noun: str, loosely: bool, picture: QuestionPicture) -> bool:
    types = set(_NOUNS[noun])
    if not loosely or noun == "block":
        return block.type in types
    if not shows_profile(block, picture.view_deg):
        # Seen from this side, it may be taken for anything but what it is.
        return block.type not in types
    return block.type in types.union(*(SHAPES[one].mistaken_for for one in types))


def resolve_one(text: str, picture: QuestionPicture) -> Block:
    """Return the one block that an expression fits, even loosely; UnfairError otherwise."""
    orders = resolve(text, picture)
    if len(orders) != 1:
        raise UnfairError(f"{text!r} fits {len(orders)} blocks")
    if resolve(text, picture, loosely=True) != orders:
        raise UnfairError(f"{text!r} may be taken for another block")
    return next(block for block in picture.blocks if block.order == orders[0])


def names(block: Block, picture: QuestionPicture, features: Sequence[Feature]) -> tuple[str, ...]:
    """Return expressions that fit this block alone and speak of these features only, shortest
    first; none that says more than another.
    """
    found: dict[str, Mapping[str, str]] = {}
    for words in _expressions(block, picture, features):
        text = _text_of(words)
        is_longer = any(shorter.items() <= words.items() for shorter in found.values())
        readings = (resolve(text, picture, loosely) for loosely in (False, True))
        if not is_longer and all(reading == (block.order,) for reading in readings):
            found[text] = words
    return tuple(found)


def _text_of(words: Mapping[str, str]) -> str:
    simple = [words.get("side"), words.get("color"), words.get("noun", "block")]
    layer = f"in layer {words['layer']}" if "layer" in words else ""
    support = f"resting on the {words['support']}" if "support" in words else ""
    return " ".join(filter(None, (*simple, layer, support)))


def _expressions(
    block: Block, picture: QuestionPicture, features: Sequence[Feature]
) -> Iterator[dict[str, str]]:
    """Yield all that is true of a block as words by feature, the simple before the long."""
    true = {"color": block.color, "noun": shape_word(block.type)}
    if "color" not in features:
        del true["color"]
    if "type" not in features:
        del true["noun"]
    simple: list[dict[str, str]] = [{}, *({name: word} for name, word in true.items())]
    if len(true) > 1:
        simple.append(true)
    yield from simple
    further = [{"side": side} for side in _SIDES] if "side" in features else []
    further += [{"layer": str(block.layer)}] if "layer" in features else []
    below = [other for other in picture.blocks if other.order in block.depend]
    if "support" in features and len(below) == 1:
        plain = [feature for feature in features if feature in ("color", "type")]
        further += [{"support": name} for name in names(below[0], picture, plain)]
    for words in simple:
        yield from ({**words, **more} for more in further)


def drawn_name(
    rng: np.random.Generator, block: Block, picture: QuestionPicture, features: Sequence[Feature]
) -> str | None:
    """Return one of the shortest expressions that fit a block alone, or None."""
    expressions = names(block, picture, features)
    return pick(rng, expressions[:_NAMES_DRAWN_FROM]) if expressions else None


def plain_names(picture: QuestionPicture) -> Mapping[int, str]:
    """Return the shortest name by color and type of each block that shows enough, by order."""
    found = ((b.order, names(b, picture, ("color", "type"))) for b in seen_blocks(picture, NAMED))
    return {order: expressions[0] for order, expressions in found if expressions}
