"""Places for a block on a structure: which bear it, and four that no single measure tells apart."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from phyblock.domain.question import Mark, QuestionPicture
from phyblock.domain.scene import Block
from phyblock.making.questions.four_alike import four_alike
from phyblock.making.questions.margins import group_of
from phyblock.making.questions.placing import (
    lowered,
    lowered_round,
    stays_round,
    surely_stays,
    verdict,
)
from phyblock.sim.balance import is_balanced
from phyblock.sim.seeing import Top, is_apart, is_inside, mark_pixel, seen, seen_order
from phyblock.sim.support import bounds_m

__all__ = ["Place", "alike_places", "is_on_face", "looks_of", "sort_of", "stays_at"]

RINGS_M = (0.00125, 0.0025, 0.005)
"""The verdict on a place holds all round it, this far off [m]."""
_PLACES_TRIED, _GIVEN_UP = 90, 24
_WRONG = 3
_MOST_STAYING, _MOST_FALLING, _MOST_HINDERED = 10, 10, 12
_OFF_CENTER, _ROW = 0, 4
"""Places of two of the measures of `looks_of`."""
_SAME_HEIGHT_M, _CLEARLY_HIGHER_M = 0.001, 0.01
_APART_PX = 18.0
_FOURS_TRIED = 4
Place = tuple[float, float, float]
"""A point of the world [m]."""


class _Found(NamedTuple):
    """Places where a block surely stays by statics, on the face that is marked, and others.

    `falling` are on that face as well; at `hindered` it meets a neighbor first, and does not stay.
    """

    staying: list[Top]
    falling: list[Top]
    hindered: list[Top]


def alike_places(
    plain: QuestionPicture, block: Block, tops: Sequence[Top], rng: np.random.Generator
) -> list[Top]:
    """The right place and three wrong ones, apart in the picture; none where there are too few."""
    found = _by_statics(plain, block, tops)
    together = [*found.staying, *found.falling, *found.hindered]
    if not found.staying:
        return []
    marks = [Mark("A", top.position_m) for top in together]
    inside = np.array([is_inside(replace(plain, marks=(mark,))) for mark in marks])
    apart = np.array([[is_apart(plain, a, [b], _APART_PX) for b in marks] for a in marks])
    apart &= inside & inside[:, None]
    measures = np.array([looks_of(plain, top) for top in together])
    pixels = np.array([mark_pixel(plain, mark.position_m) for mark in marks], dtype=np.float64)
    unlike = np.linalg.norm(pixels[:, None] - pixels, axis=2)
    is_sure: dict[int, bool] = {}
    for _ in range(_FOURS_TRIED):
        rights = len(found.staying)
        four = four_alike(measures, apart, rng, rights=rights, unlike=unlike).chosen
        for place, i in enumerate(four):
            if i not in is_sure:
                is_sure[i] = stays_at(plain, block, together[i].position_m) is (place == 0)
        unsure = [i for i in four if not is_sure[i]]
        if four and not unsure:
            return [together[i] for i in four]
        apart[unsure] = apart[:, unsure] = False
    return []


def _by_statics(plain: QuestionPicture, block: Block, tops: Sequence[Top]) -> _Found:
    """Some places of each sort, apart; no staying ones where there are not enough of the others.

    What takes longer to find out is only asked where there may be enough of both.
    """
    sorts: dict[tuple[bool, bool], list[tuple[Top, Block]]] = {
        (on, stays): [] for on in (True, False) for stays in (True, False)
    }
    marks: list[Mark] = []
    for number, top in enumerate(tops[:_PLACES_TRIED]):
        mark = Mark("A", top.position_m)
        if number == _GIVEN_UP and not sorts[True, True]:
            break
        put = lowered(block, plain.blocks, *top.position_m[:2])
        is_on = _is_on_face(plain, put, top.position_m)
        if is_on is not None and is_apart(plain, mark, marks, _APART_PX / 2):
            marks.append(mark)
            stays = is_balanced(group_of((*plain.blocks, put), put.order))
            sorts[is_on, stays].append((top, put))

    def sure(is_on: bool, stays: bool, most: int) -> list[Top]:
        likely = ((top, (*plain.blocks, put)) for top, put in sorts[is_on, stays])
        found = (top for top, all_of in likely if surely_stays(all_of, block.order) is stays)
        return list(itertools.islice(found, most))

    if not sorts[True, True]:
        return _Found([], [], [])
    falling, hindered = sure(True, False, _MOST_FALLING), sure(False, False, _MOST_HINDERED)
    has_enough = len(falling) + len(hindered) >= _WRONG
    return _Found(sure(True, True, _MOST_STAYING) if has_enough else [], falling, hindered)


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


def sort_of(plain: QuestionPicture, places: Sequence[Top]) -> str:
    """By how many of the wrong places the right one, which is first, is outdone in three ways.

    How many are nearer to the middle of their block, how many higher up in the picture, and how
    many nearer to the others: by these the right one of any four would stand out.
    """
    looks = np.array([looks_of(plain, top) for top in places])
    pixels = np.array([mark_pixel(plain, top.position_m) for top in places], dtype=np.float64)
    far = np.linalg.norm(pixels[:, None] - pixels, axis=2).sum(axis=1)
    measured = (("central", looks[:, _OFF_CENTER]), ("up", looks[:, _ROW]), ("alone", far))
    return ", ".join(f"{name} {int((one[1:] < one[0]).sum())}" for name, one in measured)


def stays_at(plain: QuestionPicture, block: Block, at: Place) -> bool | None:
    """Whether the block stays at a place, by simulation too, and likewise up to 5 mm off.

    None where that is not sure, where it is not sure on which face it comes down, and where it
    stays on another than the one that is marked.
    """
    put = lowered(block, plain.blocks, *at[:2])
    around = lowered_round(put, plain.blocks, RINGS_M[-1:])
    is_on = is_on_face(plain, block, at)
    if is_on is None or any(_is_as_high(one, at) is not is_on for one in around):
        return None
    stays = stays_round(put, plain.blocks, RINGS_M)
    if verdict((*plain.blocks, put), put.order) is not stays or (stays and not is_on):
        return None
    return stays


def is_on_face(plain: QuestionPicture, block: Block, at: Place) -> bool | None:
    """Whether the block let down at a place comes down on the marked face, as it would without the
    other blocks, or meets a neighbor clearly before; None where neither is so.
    """
    return _is_on_face(plain, lowered(block, plain.blocks, *at[:2]), at)


def _is_on_face(plain: QuestionPicture, put: Block, at: Place) -> bool | None:
    is_as_high = _is_as_high(put, at)
    if not is_as_high:
        return is_as_high
    under = seen_order(plain, seen(replace(plain, marks=())), at)
    alone = [one for one in plain.blocks if one.order == under]
    return True if _is_as_high(lowered(put, alone, *at[:2]), at) else None


def _is_as_high(put: Block, at: Place) -> bool | None:
    """Whether a block has come down as far as a place; None where it is lower, or hardly higher."""
    above_m = float(bounds_m(put)[0, 2]) - at[2]
    if abs(above_m) < _SAME_HEIGHT_M:
        return True
    return False if above_m > _CLEARLY_HIGHER_M else None
