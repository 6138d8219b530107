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
from phyblock.making.questions.draft import (
    Draft,
    UnfairError,
    draft,
    index_of,
    pick,
    right_first,
    shuffled,
)
from phyblock.making.questions.referring import (
    SHAPE_WORDS,
    Feature,
    drawn_name,
    resolve_one,
    shape_word,
)
from phyblock.making.questions.view import (
    NAMED,
    STUDIED,
    StaticMaker,
    View,
    goal_picture,
    orders_of,
    recolored,
    require_seen,
    seen_blocks,
    shows_profile,
    with_own_colors,
)
from phyblock.sim.contact import bounds_m

_LYING_M = 0.03
"""A half cylinder that lies on its flat face is lower than this."""


class PropertyMaker(StaticMaker):
    """SH: the shape of a block named by anything but a shape; CO: likewise its color."""

    def __init__(self, subtask: Literal["SH", "CO"]) -> None:
        self.subtask: Subtask = subtask
        self._is_shape = subtask == "SH"
        self._least = STUDIED if self._is_shape else NAMED
        self._allowed: Sequence[str] = list(SHAPE_WORDS) if self._is_shape else COLORS
        self._features: tuple[Feature, ...] = (
            "color" if self._is_shape else "type",
            *("side", "layer", "support"),
        )

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One a block that shows enough of itself and can be named."""
        for seen in shuffled(rng, seen_blocks(goal_picture(scene, view), self._least)):
            if self._is_shape and _doubt_of_shape(seen, scene.blocks, view):
                continue
            shown = recolored(scene, rng)
            picture = goal_picture(shown, view)
            block = next(b for b in shown.blocks if b.order == seen.order)
            name = drawn_name(rng, block, picture, self._features)
            if name is not None:
                right = self._property(block)
                wrong = shuffled(rng, [one for one in self._allowed if one != right])[:3]
                options, slots, stem = [right, *wrong], {"block": name}, self.subtask.lower()
                yield draft(
                    shown, rng, stem, options, [picture], right, slots, "", block=block.order
                )

    def answer(
        self, question: Question, picture: QuestionPicture, slots: Mapping[str, str]
    ) -> tuple[int, ...]:
        """The shape or color of the block that the text names."""
        block = resolve_one(slots["block"], picture)
        require_seen(picture, [block.order], self._least)
        if self._is_shape and (doubt := _doubt_of_shape(block, picture.blocks, picture.view_deg)):
            raise UnfairError(doubt)
        return index_of(question, self._property(block))

    def _property(self, block: Block) -> str:
        return shape_word(block.type) if self._is_shape else block.color


def _doubt_of_shape(block: Block, blocks: Sequence[Block], view: View) -> str:
    """The reason why a view does not tell a block's shape; empty where it does."""
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
_LEAST_RATIO = 1.3
_TRIES = 6
_TIMES: Mapping[str, float] = {
    "a quarter as tall": 0.25,
    "half as tall": 0.5,
    "just as tall": 1.0,
    "twice as tall": 2.0,
    "four times as tall": 4.0,
}
_EXACT = 0.01


class SizeMaker(StaticMaker):
    """SI: the one of four blocks that is the tallest, longest, largest; how many times as tall."""

    subtask: Subtask = "SI"

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Comparisons of four blocks, and of two, in turns."""
        seen = seen_blocks(goal_picture(scene, view), STUDIED)
        for _ in range(_TRIES):
            if len(seen) >= 4:
                yield from _one_of_four(view, scene, shuffled(rng, seen)[:4], rng)
            if len(seen) >= 2:
                yield from _times_as_tall(view, scene, shuffled(rng, seen)[:2], rng)

    def answer(
        self, question: Question, picture: QuestionPicture, slots: Mapping[str, str]
    ) -> tuple[int, ...]:
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
) -> Iterator[Draft]:
    comparison = pick(rng, list(_COMPARISONS))
    try:
        right = _extreme(chosen, comparison)
    except UnfairError:
        return
    shown = with_own_colors(scene, orders_of(chosen), rng)
    colors = {block.order: block.color for block in shown.blocks}
    options = [f"the {colors[b.order]} block" for b in right_first(right, chosen)]
    stem, measure, _ = _COMPARISONS[comparison]
    pictures, value = [goal_picture(shown, view)], colors[right.order]
    slots = {"comparison": comparison}
    sizes = {str(block.order): round(measure(block), 6) for block in chosen}
    yield draft(shown, rng, stem, options, pictures, value, slots, comparison, measures=sizes)


def _times_as_tall(
    view: View, scene: Scene, pair: Sequence[Block], rng: np.random.Generator
) -> Iterator[Draft]:
    try:
        right = _times(*pair)
    except UnfairError:
        return
    words = list(_TIMES)
    start = pick(rng, [i for i in (0, 1) if right in words[i : i + 4]])
    options = right_first(right, words[start : start + 4])
    shown = with_own_colors(scene, orders_of(pair), rng)
    colors = {block.order: block.color for block in shown.blocks}
    one, other = (f"{colors[block.order]} block" for block in pair)
    slots, pictures = {"block": one, "other": other}, [goal_picture(shown, view)]
    heights = {str(block.order): round(_height_m(block), 6) for block in pair}
    yield draft(shown, rng, "si-times", options, pictures, right, slots, "times", measures=heights)


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
    ratio = _height_m(one) / _height_m(other)
    for word, known in _TIMES.items():
        if abs(ratio - known) < _EXACT:
            return word
    raise UnfairError(f"is {ratio:.2f} times as tall, which no option says")
