"""Shape and color: scenes recolored from the full palette, so that neither tells the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import COLORS
from phyblock.domain.question import Question, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.measures import height_m
from phyblock.making.questions.picture_view import (
    NAMED,
    STUDIED,
    View,
    goal_picture,
    require_seen,
    shown_picture,
    shows_profile,
)
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.referring import SHAPE_WORDS, Feature, resolve_one, shape_word
from phyblock.making.questions.selection import shuffled
from phyblock.making.questions.static_drafts import (
    StaticMaker,
    draft,
    drawn_name,
    index_of,
    seen_blocks,
    wrong_options,
)
from phyblock.making.questions.wording import slots_of

_BY_LOOKS: tuple[Feature, ...] = ("color", "side", "layer", "support")
_BY_SHAPE: tuple[Feature, ...] = ("type", "side", "layer", "support")
_LYING_M = 0.03
"""A half cylinder that lies on its flat face is lower than this."""


class ShapeMaker(StaticMaker):
    """SH: the shape of a block that is named by anything but a shape."""

    subtask: Subtask = "SH"

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One a block that shows enough of itself."""
        for block in shuffled(rng, seen_blocks(goal_picture(scene, view), STUDIED)):
            if _hides_its_shape(block, scene.blocks) or not shows_profile(block, view):
                continue
            shown = recolored(scene, rng)
            picture = goal_picture(shown, view)
            again = next(b for b in shown.blocks if b.order == block.order)
            name = drawn_name(rng, again, picture, _BY_LOOKS)
            if name is not None:
                right = shape_word(block.type)
                options = [right, *wrong_options(rng, list(SHAPE_WORDS), right)]
                slots, order = {"block": name}, block.order
                yield draft(shown, picture, rng, "sh", slots, options, right, block=order)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """The word for the type of the block that the text names."""
        picture = shown_picture(question)
        block = resolve_one(slots_of(question)["block"], picture)
        require_seen(picture, [block.order], STUDIED)
        if not shows_profile(block, picture.view_deg):
            raise UnfairError("is seen from a side that does not tell its shape")
        if _hides_its_shape(block, picture.blocks):
            raise UnfairError("a half cylinder that stands and carries looks like a cylinder")
        return index_of(question, shape_word(block.type))


class ColorMaker(StaticMaker):
    """CO: the color of a block that is named by anything but a color."""

    subtask: Subtask = "CO"

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One a block that can be named."""
        for block in shuffled(rng, seen_blocks(goal_picture(scene, view), NAMED)):
            shown = recolored(scene, rng)
            picture = goal_picture(shown, view)
            again = next(b for b in shown.blocks if b.order == block.order)
            name = drawn_name(rng, again, picture, _BY_SHAPE)
            if name is not None:
                options = [again.color, *wrong_options(rng, COLORS, again.color)]
                slots, order = {"block": name}, block.order
                yield draft(shown, picture, rng, "co", slots, options, again.color, block=order)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """The color of the block that the text names."""
        picture = shown_picture(question)
        block = resolve_one(slots_of(question)["block"], picture)
        require_seen(picture, [block.order], NAMED)
        return index_of(question, block.color)


def _hides_its_shape(block: Block, blocks: Sequence[Block]) -> bool:
    """Whether it is a standing half cylinder with something on its half disc."""
    is_standing = block.type == "semi_cylinder" and height_m(block) > _LYING_M
    return is_standing and any(block.order in other.depend for other in blocks)


def recolored(scene: Scene, rng: np.random.Generator) -> Scene:
    """The scene with a color drawn for every block."""
    drawn = rng.integers(len(COLORS), size=len(scene))
    blocks = [
        replace(block, color=COLORS[int(i)]) for block, i in zip(scene.blocks, drawn, strict=True)
    ]
    return replace(scene, blocks=tuple(blocks))


def with_own_colors(scene: Scene, orders: Sequence[int], rng: np.random.Generator) -> Scene:
    """The scene with a color for each of up to four blocks that no other block has.

    The other blocks share the colors that are left. Raises ValueError for more than four blocks
    when there are others.
    """
    colors = [COLORS[int(i)] for i in rng.permutation(len(COLORS))]
    own = dict(zip(orders, colors, strict=False))
    left = colors[len(orders) :]
    if len(orders) > len(colors) or (not left and len(orders) < len(scene)):
        raise ValueError(f"there are {len(colors)} colors for {len(orders)} blocks and the rest")
    blocks = []
    for block in scene.blocks:
        color = own.get(block.order) or left[int(rng.integers(len(left)))]
        blocks.append(replace(block, color=color))
    return replace(scene, blocks=tuple(blocks))
