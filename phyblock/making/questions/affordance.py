"""AD: at which of four marked places a block stays when it is put down there, by simulation.

All places are on flat faces, and no more central where the block stays than elsewhere. Where it
stays it comes down on the face that is marked. Elsewhere a plank tips under it, as far as such
places are found, or it meets a neighbor first.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import (
    BLOCK_TYPES,
    COLORS,
    SHAPES,
    BlockType,
    Euler,
    euler_deg_to_quat_xyzw,
    quat_xyzw_to_matrix,
)
from phyblock.domain.question import LETTERS, Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions import base
from phyblock.making.questions.base import UnfairError
from phyblock.making.questions.structures import (
    group_of,
    lowered,
    lowered_round,
    stays_round,
    surely_stays,
    verdict,
    with_annex,
)
from phyblock.making.scenes.sketch import POSES
from phyblock.sim.balance import is_balanced, surely_stands
from phyblock.sim.contact import bounds_m
from phyblock.sim.dynamics import groups
from phyblock.sim.question_pictures import (
    BLOCK_LABEL,
    Top,
    is_apart,
    is_inside,
    mark_pixel,
    seen,
    seen_order,
    visible_tops,
)

Place = tuple[float, float, float]
"""A point of the world [m]."""
RINGS_M = (0.00125, 0.0025, 0.005)
"""The verdict on a place holds all round it, this far off [m]."""
_ANNEXED = 0.6
_STRUCTURES_TRIED, _VIEWS_TRIED, _BLOCKS_TRIED, _FOURS_TRIED = 4, 3, 3, 4
_STEP_PX, _APART_PX = 5, 18.0
_FLAT_RISE = 0.99
_OFF_CENTER_M = 0.001
_ALL_SEEN = 0.12
_PLACES_TRIED, _GIVEN_UP = 90, 24
_MOST_STAYING, _MOST_FALLING, _MOST_HINDERED = 10, 10, 12
_OFF_CENTER, _ROW = 0, 4
"""Places of two of the measures of `_looks_of`."""
_SAME_HEIGHT_M, _CLEARLY_HIGHER_M = 0.001, 0.01


class AffordanceMaker(base.Maker):
    """Kind: `ad-place`."""

    subtask: Subtask = "AD"
    scenes_tried = 160

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[base.Draft]:
        """One draft: a block in a pose drawn, one place where it stays, and three where not."""
        for _ in range(_STRUCTURES_TRIED):
            plain = _pictured(scene, rng)
            if plain is None:
                continue
            tops = visible_tops(plain, seen(plain), _STEP_PX, _FLAT_RISE)
            for _ in range(_BLOCKS_TRIED):
                block = _drawn_block(plain, rng)
                places = _alike_places(plain, block, base.shuffled(rng, tops), rng)
                if places:
                    alone = QuestionPicture(BLOCK_LABEL, (block,), plain.view_deg)
                    marks = [Mark("A", top.position_m) for top in places]
                    made = base.draft(
                        *(scene, rng, "ad-place", marks, [plain, alone], {"size": _size(block)}),
                        value=_sort_of(plain, places),
                        block=block.type,
                        euler=list(block.euler_deg),
                    )
                    yield replace(made, looks=tuple(_looks_of(plain, top) for top in places))
                    return

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By statics and simulation of the block at every place, and by statics all round it."""
        slots = base.slots_of(question)
        shown, alone = base.picture_of(question, "scene"), base.picture_of(question, BLOCK_LABEL)
        if len(alone.blocks) != 1:
            raise UnfairError("the second picture is not of one block")
        block = alone.blocks[0]
        if slots.get("size") != _size(block) or not base.shows_solid(block, alone.view_deg):
            raise UnfairError("the block is not as large as told, or does not show its shape")
        base.require_seen(shown, base.orders_of(shown.blocks), _ALL_SEEN)
        shot, stays = seen(replace(shown, marks=())), []
        for letter in LETTERS:
            places = [mark.position_m for mark in shown.marks if mark.letter == letter]
            places = [at for at in places if seen_order(shown, shot, at) is not None]
            if not places:
                raise UnfairError(f"no place {letter} is marked on a block")
            found = stays_at(shown, block, places[0])
            if found is None:
                raise UnfairError(f"it is not sure whether the block stays at place {letter}")
            stays.append(found)
        return base.only_index(stays)


def _pictured(scene: Scene, rng: np.random.Generator) -> QuestionPicture | None:
    """The scene, or a part of it with an annex, from where every block shows; None if unsure."""
    blocks = (with_annex(scene, rng) if rng.random() < _ANNEXED else None) or scene.blocks
    views = [base.drawn_view(rng) for _ in range(_VIEWS_TRIED)]
    if not all(map(surely_stands, groups(blocks))):
        return None
    pictures = (QuestionPicture("scene", blocks, view) for view in views)
    return next(
        (one for one in pictures if base.are_seen(one, base.orders_of(blocks), _ALL_SEEN)), None
    )


def _drawn_block(plain: QuestionPicture, rng: np.random.Generator) -> Block:
    """A block to put down, in a pose whose shape the picture's view shows."""
    order = max(block.order for block in plain.blocks) + 1
    while True:
        block_type, euler = base.pick(rng, _balanced_poses())
        block = Block(order, block_type, base.pick(rng, COLORS), (0.0, 0.0, 0.0), euler, (), 1)
        if base.shows_solid(block, plain.view_deg):
            return block


@functools.cache
def _balanced_poses() -> list[tuple[BlockType, Euler]]:
    """Poses that stand, with the center of mass under the middle of what is seen from above."""
    poses = []
    for block_type in BLOCK_TYPES:
        for euler in POSES[block_type].values():
            block = lowered(Block(1, block_type, "red", (0.0, 0.0, 0.0), euler, (), 1), (), 0, 0)
            rotation = quat_xyzw_to_matrix(euler_deg_to_quat_xyzw(euler))
            center = block.position_m + rotation @ np.array(SHAPES[block_type].center_of_mass_m)
            if np.abs(center[:2]).max() < _OFF_CENTER_M and surely_stands((block,)):
                poses.append((block_type, euler))
    return poses


def _size(block: Block) -> str:
    """Length, width and height of a block as it is turned, to half a centimeter."""
    *level, high = (round(float(side) * 200) / 2 for side in np.diff(bounds_m(block), axis=0)[0])
    return f"{max(level):g} cm by {min(level):g} cm, and {high:g} cm in height"


def _alike_places(
    plain: QuestionPicture, block: Block, tops: Sequence[Top], rng: np.random.Generator
) -> list[Top]:
    """The right place and three wrong ones, apart in the picture; none where there are too few."""
    staying, wrong = _by_statics(plain, block, tops)
    if not staying:
        return []
    together = [*staying, *wrong]
    marks = [Mark("A", top.position_m) for top in together]
    inside = np.array([is_inside(replace(plain, marks=(mark,))) for mark in marks])
    apart = np.array([[is_apart(plain, a, [b], _APART_PX) for b in marks] for a in marks])
    apart &= inside & inside[:, None]
    measures = np.array([_looks_of(plain, top) for top in together])
    pixels = np.array([mark_pixel(plain, mark.position_m) for mark in marks], dtype=np.float64)
    unlike = np.linalg.norm(pixels[:, None] - pixels, axis=2)
    is_sure: dict[int, bool] = {}
    for _ in range(_FOURS_TRIED):
        four = base.four_alike(measures, apart, rng, rights=len(staying), unlike=unlike).chosen
        for place, i in enumerate(four):
            if i not in is_sure:
                is_sure[i] = stays_at(plain, block, together[i].position_m) is (place == 0)
        unsure = [i for i in four if not is_sure[i]]
        if four and not unsure:
            return [together[i] for i in four]
        apart[unsure] = apart[:, unsure] = False
    return []


def _by_statics(
    plain: QuestionPicture, block: Block, tops: Sequence[Top]
) -> tuple[list[Top], list[Top]]:
    """Places, apart, where a block surely stays by statics on the face that is marked, and where
    not: it falls off that face, or meets a neighbor first and falls.

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
        is_on = is_on_face(plain, put, top.position_m)
        if is_on is not None and is_apart(plain, mark, marks, _APART_PX / 2):
            marks.append(mark)
            stays = is_balanced(group_of((*plain.blocks, put), put.order))
            sorts[is_on, stays].append((top, put))

    def sure(is_on: bool, stays: bool, most: int) -> list[Top]:
        likely = ((top, (*plain.blocks, put)) for top, put in sorts[is_on, stays])
        found = (top for top, all_of in likely if surely_stays(all_of, block.order) is stays)
        return list(itertools.islice(found, most))

    if not sorts[True, True]:
        return [], []
    wrong = [*sure(True, False, _MOST_FALLING), *sure(False, False, _MOST_HINDERED)]
    return (sure(True, True, _MOST_STAYING) if len(wrong) >= base.WRONG else []), wrong


def _looks_of(plain: QuestionPicture, top: Top) -> tuple[float, ...]:
    """Measures of a place, in the world and in the picture, by which it might stand out."""
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


def _sort_of(plain: QuestionPicture, places: Sequence[Top]) -> str:
    """By how many of the wrong places the right one, which is first, is outdone in three ways."""
    looks = np.array([_looks_of(plain, top) for top in places])
    pixels = np.array([mark_pixel(plain, top.position_m) for top in places], dtype=np.float64)
    far = np.linalg.norm(pixels[:, None] - pixels, axis=2).sum(axis=1)
    measured = (("central", looks[:, _OFF_CENTER]), ("up", looks[:, _ROW]), ("alone", far))
    return ", ".join(f"{name} {int((one[1:] < one[0]).sum())}" for name, one in measured)


def stays_at(plain: QuestionPicture, block: Block, at: Place) -> bool | None:
    """True if the block stays at a place, by simulation too, and likewise up to 5 mm off.

    None where that is not sure, where it is not sure on which face it comes down, and where it
    stays on another than the one that is marked.
    """
    put = lowered(block, plain.blocks, *at[:2])
    around = lowered_round(put, plain.blocks, RINGS_M[-1:])
    is_on = is_on_face(plain, put, at)
    if is_on is None or any(_is_as_high(one, at) is not is_on for one in around):
        return None
    stays = stays_round(put, plain.blocks, RINGS_M)
    if verdict((*plain.blocks, put), put.order) is not stays or (stays and not is_on):
        return None
    return stays


def is_on_face(plain: QuestionPicture, put: Block, at: Place) -> bool | None:
    """True if a block let down at a place came down on the marked face, as it would without the
    other blocks; False if it met a neighbor clearly before; None where neither is so.
    """
    is_as_high = _is_as_high(put, at)
    if not is_as_high:
        return is_as_high
    under = seen_order(plain, seen(replace(plain, marks=())), at)
    alone = [one for one in plain.blocks if one.order == under]
    return True if _is_as_high(lowered(put, alone, *at[:2]), at) else None


def _is_as_high(put: Block, at: Place) -> bool | None:
    """True if a block has come down as far as a place; None where it is lower, or hardly higher."""
    above_m = float(bounds_m(put)[0, 2]) - at[2]
    if abs(above_m) < _SAME_HEIGHT_M:
        return True
    return False if above_m > _CLEARLY_HIGHER_M else None
