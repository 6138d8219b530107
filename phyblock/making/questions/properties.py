"""SH, CO, SI: shape, color and size of a block.

Scenes are recolored from the full palette, so that neither color nor shape tells the other. For
sizes, blocks are named by colors of their own, because a shape's name would tell its size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Literal

import numpy as np

from phyblock.domain.blocks import COLORS, SHAPES
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.base import (
    NAMED,
    STUDIED,
    WORDS,
    Draft,
    Slots,
    StaticMaker,
    UnfairError,
    View,
    draft,
    goal_picture,
    index_of,
    orders_of,
    pick,
    recolored,
    require_seen,
    right_first,
    seen_blocks,
    shows_profile,
    shuffled,
    with_own_colors,
)
from phyblock.making.questions.names import (
    SHAPE_WORDS,
    Feature,
    drawn_name,
    resolve_one,
    shape_word,
)
from phyblock.sim.contact import bounds_m

_LYING_M = 0.03
"""A half cylinder that lies on its flat face is lower than this."""
_LEAST_RATIO = 1.3
_EXACT = 0.01
_TRIES = 6


class PropertyMaker(StaticMaker):
    """SH: the shape of a block named by anything but a shape; CO: likewise its color."""

    def __init__(self, subtask: Literal["SH", "CO"]) -> None:
        self.subtask: Subtask = subtask
        self._is_shape = subtask == "SH"
        self._least = STUDIED if self._is_shape else NAMED
        self._allowed: Sequence[str] = list(SHAPE_WORDS) if self._is_shape else COLORS
        other: Feature = "color" if self._is_shape else "type"
        self._features: tuple[Feature, ...] = (other, "side", "layer", "support")

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One a block that shows enough of itself and can be named."""
        for one in shuffled(rng, seen_blocks(goal_picture(scene, view), self._least)):
            if self._doubt(one, scene.blocks, view):
                continue
            shown = recolored(scene, rng)
            picture = goal_picture(shown, view)
            block = next(b for b in shown.blocks if b.order == one.order)
            name = drawn_name(rng, block, picture, self._features)
            if name is not None:
                right = self._property(block)
                options = [right, *shuffled(rng, [x for x in self._allowed if x != right])[:3]]
                stem, slots = self.subtask.lower(), {"block": name}
                yield draft(shown, rng, stem, options, [picture], slots, kind="", block=block.order)

    def answer(self, question: Question, picture: QuestionPicture, slots: Slots) -> tuple[int, ...]:
        """The shape or color of the block that the text names."""
        block = resolve_one(slots["block"], picture)
        require_seen(picture, [block.order], self._least)
        if doubt := self._doubt(block, picture.blocks, picture.view_deg):
            raise UnfairError(doubt)
        return index_of(question, self._property(block))

    def _property(self, block: Block) -> str:
        return shape_word(block.type) if self._is_shape else block.color

    def _doubt(self, block: Block, blocks: Sequence[Block], view: View) -> str:
        """The reason why a view does not tell a block's shape; empty where it does."""
        if not self._is_shape:
            return ""
        if not shows_profile(block, view):
            return "is seen from a side that does not tell its shape"
        is_standing = block.type == "semi_cylinder" and _height_m(block) > _LYING_M
        if is_standing and any(block.order in other.depend for other in blocks):
            return "a half cylinder that stands and carries looks like a cylinder"
        return ""


def _height_m(block: Block) -> float:
    """From a block's lowest to its highest point [m]."""
    low, high = bounds_m(block)[:, 2]
    return float(high - low)


def _length_m(block: Block) -> float:
    """Length of the longest side of the box that a block fits in, however it lies [m]."""
    shape = SHAPES[block.type]
    return max(high - low for low, high in zip(shape.low_m, shape.high_m, strict=True))


def _volume_m3(block: Block) -> float:
    return SHAPES[block.type].volume_m3


_COMPARISONS: Mapping[str, tuple[str, Callable[[Block], float], int]] = {
    "tallest": ("si-height", _height_m, 1),
    "flattest": ("si-height", _height_m, -1),
    "longest": ("si-length", _length_m, 1),
    "largest": ("si-volume", _volume_m3, 1),
    "smallest": ("si-volume", _volume_m3, -1),
}
"""Stems of wordings, measures, and whether most or least of them is asked for."""


class SizeMaker(StaticMaker):
    """SI: the one of four blocks that is the tallest, longest, largest; how many times as tall."""

    subtask: Subtask = "SI"

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Comparisons of four blocks, and of two, in turns."""
        studied = seen_blocks(goal_picture(scene, view), STUDIED)
        for _ in range(_TRIES):
            for count, compare in ((4, _one_of_four), (2, _times_as_tall)):
                if len(studied) >= count:
                    chosen = shuffled(rng, studied)[:count]
                    try:
                        yield compare(view, scene, chosen, rng)
                    except UnfairError:
                        continue

    def answer(self, question: Question, picture: QuestionPicture, slots: Slots) -> tuple[int, ...]:
        """By the measures of the blocks that the text or the options name."""
        compared = slots.get("comparison")
        named = question.options if compared else (slots["block"], slots["other"])
        blocks = [resolve_one(name, picture) for name in named]
        require_seen(picture, orders_of(blocks), STUDIED)
        if compared:
            return (blocks.index(_extreme(blocks, compared)),)
        return index_of(question, _times(*blocks))


def _one_of_four(
    view: View, scene: Scene, chosen: Sequence[Block], rng: np.random.Generator
) -> Draft:
    comparison = pick(rng, list(_COMPARISONS))
    right = _extreme(chosen, comparison)
    shown = with_own_colors(scene, orders_of(chosen), rng)
    colors = {block.order: block.color for block in shown.blocks}
    options = [f"the {colors[b.order]} block" for b in right_first(right, chosen)]
    stem, measure, _ = _COMPARISONS[comparison]
    sizes = {str(block.order): round(measure(block), 6) for block in chosen}
    slots, pictures = {"comparison": comparison}, [goal_picture(shown, view)]
    return draft(shown, rng, stem, options, pictures, slots, kind=comparison, measures=sizes)


def _times_as_tall(
    view: View, scene: Scene, pair: Sequence[Block], rng: np.random.Generator
) -> Draft:
    right = _times(*pair)
    words = list(WORDS["times_as_tall"])
    start = pick(rng, [i for i in (0, 1) if right in words[i : i + 4]])
    shown = with_own_colors(scene, orders_of(pair), rng)
    colors = {block.order: block.color for block in shown.blocks}
    one, other = (f"{colors[block.order]} block" for block in pair)
    options, slots = right_first(right, words[start : start + 4]), {"block": one, "other": other}
    heights = {str(block.order): round(_height_m(block), 6) for block in pair}
    pictures = [goal_picture(shown, view)]
    return draft(shown, rng, "si-times", options, pictures, slots, kind="times", measures=heights)


def _extreme(blocks: Sequence[Block], comparison: str) -> Block:
    """The one that stands out by a clear margin; UnfairError when none does."""
    if comparison not in _COMPARISONS:
        raise UnfairError(f"{comparison!r} is no comparison")
    _, measure, sign = _COMPARISONS[comparison]
    ranked = sorted(blocks, key=lambda block: -sign * measure(block))
    less, more = sorted(map(measure, ranked[:2]))
    if more < _LEAST_RATIO * less:
        raise UnfairError(f"two of the blocks are about as {comparison}")
    return ranked[0]


def _times(one: Block, other: Block) -> str:
    """The words for how many times as tall one block is as another; UnfairError for others."""
    ratio = _height_m(one) / _height_m(other)
    for word, known in WORDS["times_as_tall"].items():
        if abs(ratio - known) < _EXACT:
            return str(word)
    raise UnfairError(f"is {ratio:.2f} times as tall, which no option says")
