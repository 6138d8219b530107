"""AD: at which of four marked places a block stays when it is put down there, by simulation.

All places are on flat faces, and no more central where the block stays than elsewhere. Where it
stays it comes down on the face that is marked. Elsewhere a plank tips under it, as far as such
places are found, or it meets a neighbor first.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import (
    BLOCK_TYPES,
    COLORS,
    SHAPES,
    BlockType,
    Euler,
    euler_deg_to_matrix,
)
from phyblock.domain.question import LETTERS, Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions import base, sight
from phyblock.making.questions.base import Draft, Maker, UnfairError, View, draft, pick, shuffled
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
from phyblock.sim.camera import view_axes
from phyblock.sim.contact import bounds_m
from phyblock.sim.dynamics import groups
from phyblock.sim.geometry import drawn_mesh
from phyblock.sim.pictures import drawn_m
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
_ANNEXED, _ALL_SEEN = 0.6, 0.12
_STRUCTURES_TRIED, _BLOCKS_TRIED, _PROPOSED = 6, 3, 3
_STEP_PX, _APART_PX, _FLAT_RISE = 5, 18.0, 0.99
_OFF_CENTER_M, _MOST_OF_A_FACE = 0.001, 0.8
_PLACES_TRIED, _GIVEN_UP, _SORT = 90, 24, 10
_SAME_HEIGHT_M, _CLEARLY_HIGHER_M = 0.001, 0.01


class AffordanceMaker(Maker):
    """Kind: `ad-place`."""

    subtask: Subtask = "AD"

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose a block in a pose drawn, one place where it stays, and three where not."""
        for _ in range(_STRUCTURES_TRIED):
            blocks = (with_annex(scene, rng) if rng.random() < _ANNEXED else None) or scene.blocks
            plain = QuestionPicture("scene", blocks, base.drawn_view(rng))
            if not sight.are_seen(plain, sight.orders_of(blocks), _ALL_SEEN):
                continue
            if not all(map(surely_stands, groups(blocks))):
                continue
            tops = visible_tops(plain, seen(plain), _STEP_PX, _FLAT_RISE)
            for _ in range(_BLOCKS_TRIED):
                block = _drawn_block(plain, rng)
                staying, wrong = _by_statics(plain, block, shuffled(rng, tops))
                both = [*staying, *wrong]
                pixels = np.array([mark_pixel(plain, top.position_m) for top in both], dtype=float)
                for _ in range(_PROPOSED if staying and wrong else 0):
                    unlike = np.linalg.norm(pixels[:, None] - pixels, axis=2)
                    measures = np.array([_looks_of(plain, top) for top in both])
                    four = base.four_alike(measures, unlike, _APART_PX, rng, rights=len(staying))
                    if four:
                        alone = QuestionPicture(BLOCK_LABEL, (block,), plain.view_deg)
                        marks = [Mark("A", both[i].position_m) for i in four]
                        slots, looks = {"size": _size(block)}, measures[four].tolist()
                        facts = {"block": block.type, "euler": list(block.euler_deg)}
                        shown = [plain, alone]
                        yield draft(
                            scene, rng, "ad-place", marks, shown, slots, looks=looks, facts=facts
                        )

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Decide by statics and simulation of the block at every place, and statics all round."""
        slots = base.slots_of(question)
        shown, alone = sight.picture_of(question, "scene"), sight.picture_of(question, BLOCK_LABEL)
        if len(alone.blocks) != 1:
            raise UnfairError("the second picture is not of one block")
        block = alone.blocks[0]
        if slots.get("size") != _size(block) or not shows_solid(block, alone.view_deg):
            raise UnfairError("the block is not as large as told, or does not show its shape")
        sight.require_seen(shown, _ALL_SEEN)
        plain, stays = replace(shown, marks=()), []
        for letter in LETTERS:
            places = [mark.position_m for mark in shown.marks if mark.letter == letter]
            places = [at for at in places if seen_order(plain, seen(plain), at) is not None]
            if not places:
                raise UnfairError(f"no place {letter} is marked on a block")
            stays.append(stays_at(plain, block, places[0]))
            if stays[-1] is None:
                raise UnfairError(f"it is not sure whether the block stays at place {letter}")
        return base.only_index(stays)


def _drawn_block(plain: QuestionPicture, rng: np.random.Generator) -> Block:
    """Return a block to put down, in a pose whose shape the picture's view shows."""
    order = max(block.order for block in plain.blocks) + 1
    while True:
        block_type, euler = pick(rng, _balanced_poses())
        block = Block(order, block_type, pick(rng, COLORS), (0.0, 0.0, 0.0), euler, (), 1)
        if shows_solid(block, plain.view_deg):
            return block


@functools.cache
def _balanced_poses() -> list[tuple[BlockType, Euler]]:
    """Return poses that stand, with the center of mass under the middle seen from above."""
    poses = []
    for block_type in BLOCK_TYPES:
        for euler in POSES[block_type].values():
            block = lowered(Block(1, block_type, "red", (0.0, 0.0, 0.0), euler, (), 1), (), 0, 0)
            center = euler_deg_to_matrix(euler) @ np.array(SHAPES[block_type].center_of_mass_m)
            is_central = np.abs(center[:2] + block.position_m[:2]).max() < _OFF_CENTER_M
            if is_central and surely_stands((block,)):
                poses.append((block_type, euler))
    return poses


def shows_solid(block: Block, view: View) -> bool:
    """True if a view shows its profile, and no one face is nearly all that shows of the block."""
    along = view_axes(*view)[2]
    corners = drawn_m(block)[drawn_mesh(block.type).triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shown = np.maximum(-normals @ along, 0.0)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    _, faces = np.unique(np.round(normals / lengths, 2), axis=0, return_inverse=True)
    largest = np.bincount(faces.ravel(), shown).max() / shown.sum()
    return sight.shows_profile(block, view) and bool(largest <= _MOST_OF_A_FACE)


def _size(block: Block) -> str:
    """Return length, width and height of a block as it is turned, to half a centimeter."""
    *level, high = (round(float(side) * 200) / 2 for side in np.diff(bounds_m(block), axis=0)[0])
    return f"{max(level):g} cm by {min(level):g} cm, and {high:g} cm in height"


def _by_statics(
    plain: QuestionPicture, block: Block, tops: Sequence[Top]
) -> tuple[list[Top], list[Top]]:
    """Return places where a block surely stays by statics on the face that is marked, and where
    not: it falls off that face, or meets a neighbor first and falls.
    """
    found: dict[bool, list[Top]] = {True: [], False: []}
    marks: list[Mark] = []
    for number, top in enumerate(tops[:_PLACES_TRIED]):
        if number == _GIVEN_UP and not found[True]:
            break
        mark = Mark("A", top.position_m)
        put = lowered(block, plain.blocks, *top.position_m[:2])
        blocks, is_on = (*plain.blocks, put), is_on_face(plain, put, top.position_m)
        stays = is_balanced(group_of(blocks, put.order))
        if is_on is None or (stays and not is_on) or len(found[stays]) == _SORT:
            continue
        if is_apart(plain, mark, marks, _APART_PX / 2) and is_inside(replace(plain, marks=(mark,))):
            marks.append(mark)
            if surely_stays(blocks, put.order) is stays:
                found[stays].append(top)
    return found[True], found[False]


def _looks_of(plain: QuestionPicture, top: Top) -> tuple[float, ...]:
    """Return measures of a place, in the world and the picture, by which it might stand out."""
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


@functools.lru_cache(maxsize=64)
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
    """True if a block let down at a place came down on the marked face, as without others.

    False if it met a neighbor clearly before; None where neither is so.
    """
    is_as_high = _is_as_high(put, at)
    if not is_as_high:
        return is_as_high
    under = seen_order(plain, seen(plain), at)
    alone = [one for one in plain.blocks if one.order == under]
    return True if _is_as_high(lowered(put, alone, *at[:2]), at) else None


def _is_as_high(put: Block, at: Place) -> bool | None:
    """True if a block has come down as far as a place; None where it is lower, or hardly higher."""
    above_m = float(bounds_m(put)[0, 2]) - at[2]
    if abs(above_m) < _SAME_HEIGHT_M:
        return True
    return False if above_m > _CLEARLY_HIGHER_M else None
