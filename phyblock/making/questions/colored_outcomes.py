"""CF, pictures: who moves when a block is taken away, said by colors.

Every option colors the blocks of one and the same structure: those that move, those that stay. So
nothing in an option is broken, missing or hanging. Wrong are other lots of blocks that could fall
together, with all that rests on them, chosen so that the right one's rank among the four is about
as drawn: in how much is colored and where, in how near it is to the block that is taken away, and
in how well it fits what rests on that block.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import Color
from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block
from phyblock.making.questions.choices import pick, shuffled
from phyblock.making.questions.four_alike import four_alike
from phyblock.making.questions.margins import resting_on
from phyblock.making.questions.picture_view import COUNTED, center_m, shares
from phyblock.making.questions.pictured_drafts import LEAST_PIXELS, are_told_apart
from phyblock.making.questions.question_draft import UnfairError
from phyblock.sim.render import Shot
from phyblock.sim.seeing import seen

__all__ = ["colored_options", "colored_orders"]

Lot = frozenset[int]
"""Orders of blocks that move."""

_MOST_POOL = 40
_MOST_TOGETHER = 3
_AREA, _ROW = 0, 2
"""Places of two of the measures of `_looks`."""
_COLORS: tuple[tuple[Color, Color, Color], ...] = (
    ("red", "yellow", "blue"),
    ("orange", "blue", "green"),
    ("yellow", "blue", "red"),
    ("blue", "orange", "green"),
    ("green", "orange", "blue"),
    ("red", "blue", "yellow"),
)
"""The colors of what moves, of what stays, and of the block that is taken away."""


def colored_options(
    plain: QuestionPicture, taken: int, moved: Collection[int], rng: np.random.Generator
) -> tuple[list[QuestionPicture], dict[str, str], str]:
    """Four pictures, the right one first, and the slots of the text; none where they are too few.

    With whether the right one has more colored than most, and lower.

    `plain` has no marks; `moved` are the orders of the blocks that move when `taken` is gone.
    """
    lots = [frozenset(moved), *_other_lots(plain, taken, frozenset(moved), rng)]
    shot = seen(plain)
    pixels = dict(zip((b.order for b in plain.blocks), _pixels(plain, shot), strict=True))
    unlike = np.array([[sum(pixels[o] for o in a ^ b) for b in lots] for a in lots], dtype=float)
    measures = np.array([_looks(plain, shot, taken, lot) for lot in lots])
    four = four_alike(measures, unlike >= LEAST_PIXELS, rng, unlike=unlike)
    colors = pick(rng, _COLORS)
    options = [_colored(plain, taken, lots[place], colors) for place in four.chosen]
    slots: dict[str, str] = dict(zip(("color", "other", "taken"), colors, strict=True))
    if not options or not are_told_apart(options):
        return [], {}, ""
    return options, slots, four.halves(_AREA, _ROW)


def colored_orders(
    picture: QuestionPicture, shown: QuestionPicture, taken: int, slots: Mapping[str, str]
) -> Lot:
    """Orders of the blocks that a picture says move; UnfairError when it says something else."""
    start = {block.order: replace(block, color="red") for block in shown.blocks}
    same = {block.order: replace(block, color="red") for block in picture.blocks}
    color_of = {block.order: block.color for block in picture.blocks}
    rest = {color for order, color in color_of.items() if order != taken}
    if start != same or color_of.get(taken) != slots["taken"]:
        raise UnfairError(f"picture {picture.label} does not show the same structure")
    if not rest <= {slots["color"], slots["other"]}:
        raise UnfairError(f"picture {picture.label} shows other colors than the text names")
    return frozenset(order for order, color in color_of.items() if color == slots["color"])


def _other_lots(
    plain: QuestionPicture, taken: int, moved: Lot, rng: np.random.Generator
) -> list[Lot]:
    """Lots that could move together and do not: some blocks, with all that rests on them."""
    share = shares(plain)
    left = [block for block in plain.blocks if block.order != taken]
    single = [frozenset({b.order}) | resting_on(left, b.order) for b in left]
    found = {frozenset[int]()}
    for number in range(1, _MOST_TOGETHER + 1):
        found |= {frozenset().union(*some) for some in itertools.combinations(single, number)}
        if len(found) > _MOST_POOL:
            break
    fair = [lot for lot in found if lot != moved and all(share[o] >= COUNTED for o in lot)]
    return shuffled(rng, sorted(fair, key=sorted))[:_MOST_POOL]


def _looks(plain: QuestionPicture, shot: Shot, taken: int, lot: Lot) -> tuple[float, ...]:
    """How much is colored, where, how high, how far from the block that is taken; how naive it is.

    A lot of no blocks is where the block is that is taken.
    """
    block_of = {block.order: block for block in plain.blocks}
    about = sorted(lot or {taken})
    shown = np.isin(shot.block, [i for i, b in enumerate(plain.blocks) if b.order in about])
    rows, columns = np.nonzero(shown)
    side = len(shot.block)
    middle = center_m(block_of[taken])
    far_m = [float(np.linalg.norm(center_m(block_of[o]) - middle)) for o in about]
    low = min(float(center_m(block_of[o])[2]) for o in about)
    resting = resting_on(plain.blocks, taken)
    only = resting_on(plain.blocks, taken, only=True)
    area = len(rows) if lot else 0
    return (
        20 * area / max(int((shot.block >= 0).sum()), 1),
        float(len(lot)),
        20 * float(rows.mean()) / side,
        20 * float(columns.mean()) / side,
        20 * float(rows.min()) / side,
        20 * float(rows.max()) / side,
        10 * low,
        10 * min(far_m),
        10 * float(np.mean(far_m)),
        float(len(lot ^ resting)),
        float(len(lot ^ only)),
    )


def _pixels(plain: QuestionPicture, shot: Shot) -> NDArray[np.int64]:
    """How many pixels show each block."""
    return np.bincount(shot.block[shot.block >= 0], minlength=len(plain.blocks))


def _colored(
    plain: QuestionPicture, taken: int, moved: Lot, colors: Sequence[Color]
) -> QuestionPicture:
    def of(block: Block) -> Color:
        return colors[2] if block.order == taken else colors[block.order not in moved]

    return replace(plain, blocks=tuple(replace(b, color=of(b)) for b in plain.blocks))
