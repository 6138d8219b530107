"""AD: at which of four marked places a block stays when it is put down there, by simulation.

All places are on flat faces, and no more central where the block stays than elsewhere. Where it
stays it comes down on the face that is marked. Elsewhere a plank tips under it, as far as such
places are found, or it meets a neighbor first.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

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
from phyblock.making.poses import POSES
from phyblock.making.questions.annexes import with_annex
from phyblock.making.questions.counterfactual import group_of
from phyblock.making.questions.picture_view import (
    are_seen,
    drawn_view,
    require_seen,
    shows_solid,
)
from phyblock.making.questions.pictured_drafts import draft, four_alike, only_index, picture_of
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.selection import pick, shuffled
from phyblock.making.questions.wording import slots_of
from phyblock.sim.balance import is_balanced, surely_falls, surely_stands
from phyblock.sim.contact import bounds_m, drop_height_m, find_overlaps
from phyblock.sim.dynamics import groups
from phyblock.sim.outcomes import holds
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

_ANNEXED = 0.6
_STRUCTURES_TRIED = 4
_VIEWS_TRIED = 3
_BLOCKS_TRIED = 3
_STEP_PX = 5
_FLAT_RISE = 0.99
_OFF_CENTER_M = 0.001
_ALL_SEEN = 0.12


@functools.cache
def _balanced() -> list[tuple[BlockType, Euler]]:
    """Poses that stand, with the center of mass under the middle of what is seen from above.

    Of others, such as a wedge, nobody could say what "its middle" is; a lying cylinder rolls.
    """
    poses = []
    for block_type in BLOCK_TYPES:
        for euler in POSES[block_type].values():
            block = lowered(Block(1, block_type, "red", (0.0, 0.0, 0.0), euler, (), 1), (), 0, 0)
            rotation = quat_xyzw_to_matrix(euler_deg_to_quat_xyzw(euler))
            center = block.position_m + rotation @ np.array(SHAPES[block_type].center_of_mass_m)
            if np.abs(center[:2]).max() < _OFF_CENTER_M and surely_stands((block,)):
                poses.append((block_type, euler))
    return poses


class AffordanceMaker:
    """Kind: `ad-place`."""

    subtask: Subtask = "AD"
    scenes_tried = 160
    drafts_a_scene = 1

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One draft: a block in a pose drawn, one place where it stays, and three where not."""
        for _ in range(_STRUCTURES_TRIED):
            plain = _pictured(scene, rng)
            if plain is None:
                continue
            tops = visible_tops(plain, seen(plain), _STEP_PX, _FLAT_RISE)
            for _ in range(_BLOCKS_TRIED):
                block = _drawn_block(plain, rng)
                places = alike_places(plain, block, shuffled(rng, tops), rng)
                if places:
                    yield _drafted(scene, plain, block, places, rng)
                    return

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By statics and simulation of the block at every place, and by statics all round it."""
        slots = slots_of(question)
        shown, alone = picture_of(question, "scene"), picture_of(question, BLOCK_LABEL)
        if len(alone.blocks) != 1:
            raise UnfairError("the second picture is not of one block")
        block = alone.blocks[0]
        if slots.get("size") != _size(block) or not shows_solid(block, alone.view_deg):
            raise UnfairError("the block is not as large as told, or does not show its shape")
        require_seen(shown, [one.order for one in shown.blocks], _ALL_SEEN)
        stays = []
        for letter in LETTERS:
            found = stays_at(shown, block, _marked(shown, letter))
            if found is None:
                raise UnfairError(f"it is not sure whether the block stays at place {letter}")
            stays.append(found)
        return only_index(stays)


def _pictured(scene: Scene, rng: np.random.Generator) -> QuestionPicture | None:
    """The scene, or a part of it with an annex, from where every block shows enough to be counted.

    None where it does not surely stand, or none of a few views shows it so.
    """
    blocks = (with_annex(scene, rng) if rng.random() < _ANNEXED else None) or scene.blocks
    views = [drawn_view(rng) for _ in range(_VIEWS_TRIED)]
    if all(map(surely_stands, groups(blocks))):
        for view in views:
            plain = QuestionPicture("scene", blocks, view)
            if are_seen(plain, [block.order for block in blocks], _ALL_SEEN):
                return plain
    return None


def _drafted(
    scene: Scene,
    plain: QuestionPicture,
    block: Block,
    places: Sequence[Top],
    rng: np.random.Generator,
) -> Draft:
    alone = QuestionPicture(BLOCK_LABEL, (block,), plain.view_deg)
    facts = {"block": block.type, "euler": list(block.euler_deg)}
    marks = [Mark("A", top.position_m) for top in places]
    slots = {"size": _size(block)}
    sort = sort_of(plain, places)
    made = draft(scene, rng, "ad-place", marks, [plain, alone], sort, slots, facts)
    return replace(made, looks=tuple(looks_of(plain, top) for top in places))


def _marked(shown: QuestionPicture, letter: str) -> Place:
    """The place with a letter; UnfairError unless it shows on a block."""
    shot = seen(replace(shown, marks=()))
    for mark in shown.marks:
        if mark.letter == letter and seen_order(shown, shot, mark.position_m) is not None:
            return mark.position_m
    raise UnfairError(f"no place {letter} is marked on a block")


def _drawn_block(plain: QuestionPicture, rng: np.random.Generator) -> Block:
    """A block to put down, in a pose whose shape the picture's view shows."""
    order = max(block.order for block in plain.blocks) + 1
    while True:
        block_type, euler = pick(rng, _balanced())
        block = Block(order, block_type, pick(rng, COLORS), (0.0, 0.0, 0.0), euler, (), 1)
        if shows_solid(block, plain.view_deg):
            return block


def _size(block: Block) -> str:
    """How long, wide and high a block is as it is turned, to half a centimeter."""
    *level, high = (round(float(side) * 200) / 2 for side in np.diff(bounds_m(block), axis=0)[0])
    return f"{max(level):g} cm by {min(level):g} cm, and {high:g} cm in height"


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


_LIFT_M = 0.6
_DIRECTIONS = 8


def lowered(block: Block, onto: Sequence[Block], x_m: float, y_m: float) -> Block:
    """The block let down, as it is turned, with the middle of its outline over a place (x, y) [m].

    It stops where it first touches one of the blocks, or the floor.
    """
    middle = bounds_m(block).mean(axis=0)
    x = round(block.position_m[0] + x_m - float(middle[0]), 6)
    y = round(block.position_m[1] + y_m - float(middle[1]), 6)
    lifted = replace(block, position_m=(x, y, block.position_m[2] + _LIFT_M))
    fall = drop_height_m(lifted, onto)
    return replace(lifted, position_m=(x, y, round(lifted.position_m[2] - fall, 6)))


def lowered_round(put: Block, onto: Sequence[Block], rings_m: Sequence[float]) -> Iterator[Block]:
    """The block let down anew all round where it is, in eight directions for each ring [m]."""
    x, y, _ = bounds_m(put).mean(axis=0).tolist()
    for radius_m in rings_m:
        for number in range(_DIRECTIONS):
            angle = 2 * math.pi * number / _DIRECTIONS
            at = (x + radius_m * math.cos(angle), y + radius_m * math.sin(angle))
            yield lowered(put, onto, *at)


def stays_round(put: Block, onto: Sequence[Block], rings_m: Sequence[float]) -> bool | None:
    """Whether, by statics, a block let down stays, and likewise all round; None where unsure."""
    stays = surely_stays((*onto, put), put.order)
    is_alike = stays is not None and all(
        is_balanced(group_of((*onto, moved), moved.order)) is stays
        for moved in lowered_round(put, onto, rings_m)
    )
    return stays if is_alike else None


def surely_stays(blocks: Sequence[Block], order: int) -> bool | None:
    """Whether, by statics, one of the blocks and all that touches it stay; None where unsure."""
    group = group_of(blocks, order)
    if is_balanced(group):
        return True if surely_stands(group) else None
    return False if surely_falls(group) else None


def verdict(blocks: Sequence[Block], order: int) -> bool | None:
    """Whether all stay, where statics leave no doubt and every setting of a simulation agrees."""
    stays = surely_stays(blocks, order)
    return stays if stays is not None and holds(blocks, order) is stays else None


_STEPS_M = tuple(
    (x, y) for step in (0.025, 0.05) for x, y in ((step, 0), (-step, 0), (0, step), (0, -step))
)
_FLOATS_M = 0.0005


def shifted(blocks: Sequence[Block], rng: np.random.Generator) -> tuple[Block, ...] | None:
    """All blocks, with one that carries nothing moved along its level by 2.5 or 5 cm.

    None where none of a few that are tried would stay, by statics with a margin: of 207 such moves
    a simulation lets no other stay but two, whose weight is over an edge.
    """
    carrying = {order for block in blocks for order in block.depend}
    free = [block for block in blocks if block.order not in carrying]
    for block in shuffled(rng, free)[:_BLOCKS_TRIED]:
        rest = [other for other in blocks if other.order != block.order]
        for x, y in shuffled(rng, _STEPS_M):
            moved = replace(block, position_m=_moved(block.position_m, x, y))
            if drop_height_m(moved, rest) > _FLOATS_M or find_overlaps((*rest, moved)):
                continue
            every = tuple(moved if other.order == block.order else other for other in blocks)
            if surely_stands(group_of(every, moved.order)):
                return every
    return None


def _moved(
    position_m: tuple[float, float, float], x: float, y: float
) -> tuple[float, float, float]:
    return (round(position_m[0] + x, 4) + 0.0, round(position_m[1] + y, 4) + 0.0, position_m[2])
