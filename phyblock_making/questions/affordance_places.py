"""Places for a block on a structure: which bear it, and four that no single measure tells apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.question import Mark, QuestionPicture
from phyblock.domain.scene import Block
from phyblock.sim.balance import is_balanced
from phyblock.sim.seeing import Top, is_apart, is_inside, mark_pixel, seen, seen_order
from phyblock.sim.support import bounds_m
from phyblock_making.questions.four_alike import four_alike
from phyblock_making.questions.margins import group_of
from phyblock_making.questions.placing import (
    lowered,
    lowered_round,
    stays_round,
    surely_stays,
    verdict,
)

__all__ = ["Place", "alike_places", "looks_of", "stays_at"]

RINGS_M = (0.00125, 0.0025, 0.005)
"""The verdict on a place holds all round it, this far off [m]."""
_PLACES_TRIED, _GIVEN_UP = 90, 24
_WRONG, _MOST_FALLING, _MOST_STAYING = 3, 14, 8
_SAME_HEIGHT_M = 0.001
_APART_PX = 15.0
_FOURS_TRIED = 5
Place = tuple[float, float, float]
"""A point of the world [m]."""


def alike_places(
    plain: QuestionPicture, block: Block, tops: Sequence[Top], rng: np.random.Generator
) -> list[Top]:
    """The right place and three wrong ones, apart in the picture; none where there are too few."""
    staying, falling = _by_statics(plain, block, tops)
    if not staying or len(falling) < _WRONG:
        return []
    together = [*staying, *falling]
    marks = [Mark("A", top.position_m) for top in together]
    apart = np.array([[is_apart(plain, a, [b], _APART_PX) for b in marks] for a in marks])
    measures = np.array([looks_of(plain, top) for top in together])
    for _ in range(_FOURS_TRIED):
        four = four_alike(measures, apart, rng, rights=len(staying)).chosen
        unsure = [
            i
            for number, i in enumerate(four)
            if not is_inside(replace(plain, marks=(marks[i],)))
            or stays_at(plain, block, together[i].position_m) is not (number == 0)
        ]
        if not unsure:
            return [together[i] for i in four]
        apart[unsure] = False
    return []


def _by_statics(
    plain: QuestionPicture, block: Block, tops: Sequence[Top]
) -> tuple[list[Top], list[Top]]:
    """Some places apart where the block surely stays by statics, and some where it does not.

    What takes longer to find out is only asked where there may be enough of both.
    """
    likely: dict[bool, list[tuple[Top, Block]]] = {True: [], False: []}
    marks: list[Mark] = []
    for number, top in enumerate(tops[:_PLACES_TRIED]):
        mark = Mark("A", top.position_m)
        if number == _GIVEN_UP and not all(likely.values()):
            return [], []
        put = _on_its_face(plain, block, top.position_m)
        if put is not None and is_apart(plain, mark, marks, _APART_PX / 2):
            marks.append(mark)
            likely[is_balanced(group_of((*plain.blocks, put), put.order))].append((top, put))
    found: dict[bool, list[Top]] = {True: [], False: []}
    for stays, least, most in ((False, _WRONG, _MOST_FALLING), (True, 1, _MOST_STAYING)):
        for top, put in likely[stays] if len(likely[stays]) >= least else ():
            if surely_stays((*plain.blocks, put), put.order) is stays:
                found[stays].append(top)
            if len(found[stays]) == most:
                break
        if len(found[stays]) < least:
            return [], []
    return found[True], found[False]


def looks_of(plain: QuestionPicture, top: Top) -> tuple[float, ...]:
    """How central a place is on its block, how much room is round it, how high, how far out.

    In the world and in the picture, with how much of its block shows.
    """
    shot = seen(plain)
    row, column = mark_pixel(plain, top.position_m)
    under = shot.block == shot.block[row, column]
    room_px = np.linalg.norm(np.argwhere(~under) - (row, column), axis=1).min()
    middle = np.mean([bounds_m(block).mean(axis=0) for block in plain.blocks], axis=0)
    rows, columns = np.nonzero(shot.block >= 0)
    x, y, z = top.position_m
    return (
        20 * top.off_center_m,
        float(room_px) / 10,
        10 * z,
        3 * float(np.hypot(x - middle[0], y - middle[1])),
        (row - float(rows.mean())) / 30,
        (column - float(columns.mean())) / 30,
        abs(column - float(columns.mean())) / 30,
        5 * float(under.sum() / len(rows)),
    )


def _on_its_face(plain: QuestionPicture, block: Block, at: Place) -> Block | None:
    """The block let down over a place; None where it comes down on another than the marked face.

    On the block that shows there alone it would come to lie as high.
    """
    put = lowered(block, plain.blocks, *at[:2])
    if not _is_as_high(put, at):
        return None
    under = seen_order(plain, seen(replace(plain, marks=())), at)
    alone = [one for one in plain.blocks if one.order == under]
    return put if _is_as_high(lowered(block, alone, *at[:2]), at) else None


def _is_as_high(put: Block, at: Place) -> bool:
    return bool(abs(bounds_m(put)[0, 2] - at[2]) < _SAME_HEIGHT_M)


def stays_at(plain: QuestionPicture, block: Block, at: Place) -> bool | None:
    """Whether the block stays at a place, by simulation too, and likewise up to 5 mm off.

    None where that is not sure, or where it does not come down on the marked face everywhere there.
    """
    put = _on_its_face(plain, block, at)
    if put is None:
        return None
    around = lowered_round(put, plain.blocks, RINGS_M[-1:])
    if not all(_is_as_high(one, at) for one in around):
        return None
    stays = stays_round(put, plain.blocks, RINGS_M)
    return stays if verdict((*plain.blocks, put), put.order) is stays else None
