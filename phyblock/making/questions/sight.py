"""Facts that a picture shows: the visible share and place of each block, and names of blocks.

An expression is `[side] [color] noun [in layer N] [resting on the [color] noun]`. `resolve` finds
what it means from the text again, so that a question can be checked by its words alone.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from phyblock.domain.blocks import COLORS, SHAPES, BlockType, Color, euler_deg_to_matrix
from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions import base
from phyblock.making.questions.base import Draft, Floats, Slots, UnfairError, View
from phyblock.sim.contact import GROUND, bounds_m, support_graph
from phyblock.sim.pictures import PictureStyle, drawn_m, goal_camera, shoot, visible_shares
from phyblock.sim.question_pictures import is_inside, least_difference, seen, seen_order
from phyblock.sim.raster import view_axes

COUNTED = 0.25
"""Minimum visible share of a block that is counted."""
NAMED = 0.4
"""Minimum visible share of a block that is named in a question or an option."""
STUDIED = 0.55
"""Minimum visible share of a block whose shape, size or orientation is asked about."""
LEAST_PIXELS = 220
"""Minimum number of pixels, of 256 by 256, in which any two compared pictures differ."""
_SHAPED, _SHAPED_AREA = 0.28, 0.004
"""Minimum visible share of every block, and share of the picture, if shapes are counted."""
_LEAST_PROFILE = 0.26
"""Sine of the least angle by which a block's profile is turned to the viewer: 15 degrees."""
_SIZE_PX = 256
_MIDDLE_GAP, _EDGE_GAP = 0.1, 0.05
"""Minimum lead of the outermost block's middle and edge, in halves of the picture's width."""


PLAIN_COLORS: tuple[Color, ...] = ("red", "yellow", "blue")
"""Colors that everybody can tell apart, to highlight blocks."""


def palette(rng: np.random.Generator) -> list[Color]:
    """Return three colors in random order, any two 20 or more apart in CIELAB, also for people who
    are blind to red or green. So one is red or orange; green is too close to them and to yellow.
    """
    return base.shuffled(rng, (base.pick(rng, ("red", "orange")), *PLAIN_COLORS[1:]))


def orders_of(blocks: Sequence[Block]) -> list[int]:
    """Return the orders of blocks."""
    return [block.order for block in blocks]


def block_of(blocks: Sequence[Block], order: int) -> Block:
    """Return the block with this order."""
    return next(block for block in blocks if block.order == order)


def colored(blocks: Sequence[Block], colors: Mapping[int, Color]) -> tuple[Block, ...]:
    """Return the blocks, those with a new color by their order in that color."""
    return tuple(replace(block, color=colors.get(block.order, block.color)) for block in blocks)


def goal_picture(scene: Scene, view: View) -> QuestionPicture:
    """Return the picture of the whole scene from a view."""
    return QuestionPicture("scene", scene.blocks, view)


def recolored(scene: Scene, view: View, rng: np.random.Generator) -> QuestionPicture:
    """Return the picture with blocks in three random colors, so that colors reveal no shapes."""
    colors = palette(rng)
    drawn = [colors[i] for i in rng.integers(len(colors), size=len(scene))]
    by_order = dict(zip(orders_of(scene.blocks), drawn, strict=True))
    return QuestionPicture("scene", colored(scene.blocks, by_order), view)


def with_own_colors(
    blocks: Sequence[Block], two: Sequence[int], view: View, rng: np.random.Generator
) -> QuestionPicture:
    """Return the picture of blocks with a color for each of two, and a third for all others."""
    first, second, rest = palette(rng)
    own = dict.fromkeys(orders_of(blocks), rest) | dict(zip(two, (first, second), strict=True))
    return QuestionPicture("scene", colored(blocks, own), view)


@functools.lru_cache(maxsize=4096)
def center_m(block: Block) -> Floats:
    """Return the middle of the box around a block, shape (3,) [m], world frame."""
    middle: Floats = bounds_m(block).mean(axis=0)
    return middle


def height_m(block: Block) -> float:
    """Return the height of a block from its lowest to its highest point [m]."""
    low, high = bounds_m(block)[:, 2]
    return float(high - low)


# Sizes of blocks in a picture framed on all that it draws


class Sizes(NamedTuple):
    """By order: visible share, share of the picture, left and right end in that (-1 to 1)."""

    shown: Mapping[int, float]
    area: Mapping[int, float]
    ends: Mapping[int, tuple[float, float]]


def sizes(picture: QuestionPicture) -> Sizes:
    """Return the sizes of the blocks in a picture."""
    # Without what does not change them, so that recolored structures share them.
    blocks = tuple(replace(block, color="red", depend=()) for block in picture.blocks)
    return _sizes(Scene("", (1,), blocks, ()), picture.view_deg)


@functools.lru_cache(maxsize=512)
def _sizes(scene: Scene, view: View) -> Sizes:
    style = PictureStyle(_SIZE_PX, "checkerboard", *view)
    camera = goal_camera(scene, style)
    pixels = shoot(scene.blocks, camera, _SIZE_PX).block
    counts = np.bincount(pixels[pixels >= 0], minlength=len(scene)) / _SIZE_PX**2
    across = {block.order: camera.project(drawn_m(block))[:, 0] for block in scene.blocks}
    ends = {order: (float(one.min()), float(one.max())) for order, one in across.items()}
    area = dict(zip(across, counts.tolist(), strict=True))
    return Sizes(visible_shares(scene, style), area, ends)


def seen_blocks(picture: QuestionPicture, least: float) -> list[Block]:
    """Return the blocks of which at least this share is visible in a picture."""
    shown = sizes(picture).shown
    return [block for block in picture.blocks if shown[block.order] >= least]


def are_seen(picture: QuestionPicture, least: float, orders: Collection[int] | None = None) -> bool:
    """True if at least this share of each of the named blocks, by default of all, is visible."""
    wanted = orders_of(picture.blocks) if orders is None else orders
    return set(wanted) <= set(orders_of(seen_blocks(picture, least)))


def require_seen(
    picture: QuestionPicture, least: float, blocks: Sequence[Block] | None = None
) -> Sequence[Block]:
    """Return the blocks, by default all. Raises UnfairError for those seen less than `least`."""
    blocks = picture.blocks if blocks is None else blocks
    shown = orders_of(seen_blocks(picture, least))
    if hidden := sorted(set(orders_of(blocks)).difference(shown)):
        raise UnfairError(f"blocks {hidden} show less than {least:.0%} of themselves")
    return blocks


Below = Mapping[int, frozenset[int]]
"""The orders that each block rests on, by its order."""


def all_below(order: int, below: Below) -> set[int]:
    """Return the orders of all direct and indirect supports of a block, without the ground."""
    found: set[int] = set()
    waiting = [order]
    while waiting:
        new = below[waiting.pop()] - {GROUND} - found
        found |= new
        waiting += new
    return found


def lots_of(blocks: Sequence[Block]) -> list[list[Block]]:
    """Return the blocks in lots, each connected by blocks that rest on each other. Blocks that only
    touch side by side are in different lots: one may fall without the other.
    """
    lots: list[set[int]] = []
    for order, below in support_graph(blocks).items():
        lot = ({order} | below) - {GROUND}
        lot = lot.union(*(other for other in lots if other & lot))
        lots = [other for other in lots if not other & lot] + [lot]
    return [[block for block in blocks if block.order in lot] for lot in lots]


def require_supports_seen(picture: QuestionPicture, blocks: Sequence[Block]) -> None:
    """Raise UnfairError unless enough of all supports is visible to tell the blocks' heights."""
    below = support_graph(picture.blocks)
    under = {order for block in blocks for order in all_below(block.order, below)}
    require_seen(picture, COUNTED, [block for block in picture.blocks if block.order in under])


def require_shapes_seen(picture: QuestionPicture) -> Sequence[Block]:
    """Return the blocks. Raises UnfairError unless enough of each is visible to tell its shape."""
    require_seen(picture, _SHAPED)
    if not all(shows_profile(block, picture.view_deg) for block in picture.blocks):
        raise UnfairError("some block is seen from a side that does not tell its shape")
    areas = sizes(picture).area
    if small := [order for order, area in sorted(areas.items()) if area < _SHAPED_AREA]:
        raise UnfairError(f"blocks {small} cover less than {_SHAPED_AREA:.1%} of the picture")
    return picture.blocks


def outermost(blocks: Sequence[Block], picture: QuestionPicture, to_left: bool) -> Block | None:
    """Return the block whose middle and outer edge are clearly farthest to a side, or None."""
    spans, sign = sizes(picture).ends, -1.0 if to_left else 1.0
    ends = {b.order: [sign * end for end in spans[b.order]] for b in blocks}
    first, *others = sorted(blocks, key=lambda block: -sum(ends[block.order]))
    middle, edge = sum(ends[first.order]) / 2, max(ends[first.order])
    is_clear = all(
        middle - sum(ends[b.order]) / 2 >= _MIDDLE_GAP and edge - max(ends[b.order]) >= _EDGE_GAP
        for b in others
    )
    return first if is_clear else None


def shows_profile(block: Block, view: View) -> bool:
    """True if a view shows the face that tells a block apart from a box; always for boxes."""
    shape = SHAPES[block.type]
    if shape.is_box:
        return True
    along = euler_deg_to_matrix(block.euler_deg)[:, "xyz".index(shape.axis)]
    return bool(abs(along @ view_axes(*view)[2]) >= _LEAST_PROFILE)


# The pictures of a question


def are_told_apart(pictures: Sequence[QuestionPicture]) -> bool:
    """True if nothing is cut off, and any two of the pictures differ in enough pixels."""
    return (
        all(map(is_inside, pictures)) and least_difference([*map(seen, pictures)]) >= LEAST_PIXELS
    )


def marked(picture: QuestionPicture, letter: str) -> tuple[tuple[float, float, float], int]:
    """Return a mark's place [m] and the block seen there, by order. Raises UnfairError if none."""
    shot = seen(replace(picture, marks=()))
    for mark in picture.marks:
        order = seen_order(picture, shot, mark.position_m)
        if mark.letter == letter and order is not None:
            return mark.position_m, order
    raise UnfairError(f"no block is marked {letter}")


def highlighted(
    blocks: Sequence[Block], lot: Collection[int], slots: Slots, taken: int | None = None
) -> tuple[Block, ...]:
    """Return a lot's blocks in the slots' `color`, others in `other`, and `taken` in its own."""
    colors: dict[int, Color] = {}
    for order in orders_of(blocks):
        role = "taken" if order == taken else "color" if order in lot else "other"
        colors[order] = slots[role]  # type: ignore[assignment]
    return colored(blocks, colors)


def lot_of(
    picture: QuestionPicture, blocks: Sequence[Block], slots: Slots, taken: int | None = None
) -> frozenset[int]:
    """Return orders of highlighted blocks. Raises UnfairError for other structures or colors."""
    mine = [block for block in picture.blocks if block.color == slots["color"]]
    lot = frozenset(orders_of(mine)) - {taken}
    if set(highlighted(blocks, lot, slots, taken)) != set(picture.blocks):
        message = "does not show the whole structure in the colors of the text"
        raise UnfairError(f"picture {picture.label} {message}")
    return lot


# Words that fit exactly one block

Feature = Literal["color", "type", "layer", "side", "support"]
_ORDER = ("cube", "rectangular prism", "triangular prism", "half cylinder", "cylinder", "arch")
"""The paper's six words (appendix A.4); those of further shapes follow them."""
SHAPE_WORDS: dict[str, tuple[BlockType, ...]] = {
    word: tuple(one for one, shape in SHAPES.items() if shape.word == word)
    for word in dict.fromkeys((*_ORDER, *(shape.word for shape in SHAPES.values())))
}
"""The types that each word names."""
_NOUNS = {**SHAPE_WORDS, "block": sum(SHAPE_WORDS.values(), ())}
_SIDE_WORDS = ("leftmost", "rightmost", "highest")
_TOP_GAP_M = 0.02
_NAMES_DRAWN_FROM = 3
_SIMPLE = rf"(?:(?:{'|'.join(COLORS)}) )?(?:{'|'.join(_NOUNS)})"
_PATTERN = re.compile(
    rf"(?:(?P<side>{'|'.join(_SIDE_WORDS)}) )?(?:(?P<color>{'|'.join(COLORS)}) )?"
    rf"(?P<noun>{'|'.join(_NOUNS)})(?: in layer (?P<layer>\d))?"
    rf"(?: resting on the (?P<support>{_SIMPLE}))?"
)


def shape_word(block_type: BlockType) -> str:
    """Return the paper's word for a type; the three cuboids share one."""
    return next(word for word, types in SHAPE_WORDS.items() if block_type in types)


def resolve(text: str, picture: QuestionPicture, loosely: bool = False) -> tuple[int, ...]:
    """Return the orders of the blocks in the picture that an expression fits.

    Empty if it is too close to call: two blocks about equally far to the left, or two of that color
    and type in one layer. Read `loosely`, look-alikes fit too: short rectangular prisms for cubes,
    cylinders for half cylinders, and vice versa. Raises UnfairError for words that name no block.
    """
    match = _PATTERN.fullmatch(text.removeprefix("the "))
    if match is None:
        raise UnfairError(f"{text!r} names no block")
    side, color, noun, layer, support = match.group("side", "color", "noun", "layer", "support")
    types = set(_NOUNS[noun])
    alike = types.union(*(SHAPES[one].mistaken_for for one in types))

    def is_called(block: Block) -> bool:
        if not loosely or noun == "block":
            return block.type in types
        if shows_profile(block, picture.view_deg):
            return block.type in alike
        # Seen from this side, it may be mistaken for any other type.
        return block.type not in types

    fitting = [b for b in picture.blocks if color in (None, b.color) and is_called(b)]
    if layer is not None:
        layers = [block.layer for block in fitting]
        if len(set(layers)) < len(layers):
            return ()
        fitting = [block for block in fitting if block.layer == int(layer)]
    if support is not None:
        below = resolve(support, picture, loosely)
        fitting = [b for b in fitting if len(below) == 1 and set(b.depend) == set(below)]
    if side == "highest" and fitting:
        tops_m = [float(bounds_m(block)[1, 2]) for block in fitting]
        close = [b for b, m in zip(fitting, tops_m, strict=True) if max(tops_m) - m < _TOP_GAP_M]
        fitting = close if len(close) == 1 else []
    elif side is not None and fitting:
        found = outermost(fitting, picture, to_left=side == "leftmost")
        fitting = [found] if found else []
    return tuple(orders_of(fitting))


def resolve_seen(
    texts: Sequence[str], picture: QuestionPicture, least: float = NAMED
) -> list[Block]:
    """Return the only block that each expression fits, even loosely. Raises UnfairError if there is
    none or another, or less than this share of one is visible.
    """
    blocks = []
    for text in texts:
        orders = resolve(text, picture)
        if len(orders) != 1:
            raise UnfairError(f"{text!r} fits {len(orders)} blocks")
        if resolve(text, picture, loosely=True) != orders:
            raise UnfairError(f"{text!r} may be taken for another block")
        blocks.append(block_of(picture.blocks, orders[0]))
    require_seen(picture, least, blocks)
    return blocks


def named(asked: Draft, least: float = NAMED) -> list[Block]:
    """Return the blocks in the slots `block` and `other`, as `resolve_seen`."""
    texts = [asked.slots[name] for name in ("block", "other") if name in asked.slots]
    return resolve_seen(texts, asked.picture, least)


def names(block: Block, picture: QuestionPicture, features: Sequence[Feature]) -> tuple[str, ...]:
    """Return minimal expressions of these features that fit only this block, shortest first."""
    true = {"color": block.color, "type": shape_word(block.type)}
    known = {name: word for name, word in true.items() if name in features}
    simple: list[dict[str, str]] = [{}, *({name: word} for name, word in known.items())]
    simple += [known] if len(known) > 1 else []
    further = [{"side": side} for side in _SIDE_WORDS] if "side" in features else []
    further += [{"layer": f"in layer {block.layer}"}] if "layer" in features else []
    below = [other for other in picture.blocks if other.order in block.depend]
    if "support" in features and len(below) == 1:
        plain = [feature for feature in features if feature in ("color", "type")]
        supports = names(below[0], picture, plain)
        further += [{"support": f"resting on the {support}"} for support in supports]
    found: dict[str, Mapping[str, str]] = {}
    for words in (*simple, *({**one, **more} for one in simple for more in further)):
        if any(shorter.items() <= words.items() for shorter in found.values()):
            continue
        said = {"type": "block", **words}
        order = ("side", "color", "type", "layer", "support")
        text = " ".join(said[name] for name in order if name in said)
        readings = (resolve(text, picture, loosely) for loosely in (False, True))
        if all(reading == (block.order,) for reading in readings):
            found[text] = words
    return tuple(found)


def drawn_name(
    rng: np.random.Generator, block: Block, picture: QuestionPicture, features: Sequence[Feature]
) -> str | None:
    """Return one of the shortest expressions that fit only this block, or None."""
    expressions = names(block, picture, features)
    return base.pick(rng, expressions[:_NAMES_DRAWN_FROM]) if expressions else None


def plain_names(picture: QuestionPicture) -> Mapping[int, str]:
    """Return the shortest name by color and type of each sufficiently visible block, by order."""
    found = ((b.order, names(b, picture, ("color", "type"))) for b in seen_blocks(picture, NAMED))
    return {order: expressions[0] for order, expressions in found if expressions}
