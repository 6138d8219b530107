"""AD: at which of four marked places a block stays when it is put down there, by simulation.

All places are on flat faces, and no more central where the block stays than elsewhere: what
decides is a neighbor that the block comes down on, a plank that tips, or a gap that it bridges.
"""

from __future__ import annotations

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
from phyblock.sim.balance import is_balanced, surely_stands
from phyblock.sim.question_pictures import BLOCK_LABEL
from phyblock.sim.seeing import Top, is_apart, is_inside, mark_pixel, seen, seen_order, visible_tops
from phyblock.sim.steps import groups
from phyblock.sim.support import bounds_m
from phyblock_making.poses import POSES
from phyblock_making.questions.annexes import with_annex
from phyblock_making.questions.choices import pick, shuffled
from phyblock_making.questions.four_alike import four_alike
from phyblock_making.questions.margins import group_of
from phyblock_making.questions.picture_view import drawn_view
from phyblock_making.questions.pictured_drafts import draft, only_index, picture_of
from phyblock_making.questions.placing import lowered, surely_stays, verdict
from phyblock_making.questions.question_draft import Draft, UnfairError
from phyblock_making.questions.wording import slots_of

__all__ = ["AffordanceMaker"]

_ANNEXED = 0.5
_BLOCKS_TRIED = 3
_PLACES_TRIED = 90
_ENOUGH, _MOST_FALLING, _MOST_STAYING = 4, 14, 8
_STEP_PX = 5
_FLAT_RISE = 0.99
_SHIFTS_M = ((0.005, 0.0), (-0.005, 0.0), (0.0, 0.005), (0.0, -0.005))
_OFF_CENTER_M = 0.001
_APART_PX = 15.0
_FOURS_TRIED = 3


def _balanced() -> list[tuple[BlockType, Euler]]:
    """Poses whose center of mass is under the middle of what is seen from above.

    Of others, such as a wedge, nobody could say what "its middle" is.
    """
    poses = []
    for block_type in BLOCK_TYPES:
        for euler in POSES[block_type].values():
            block = Block(1, block_type, "red", (0.0, 0.0, 0.0), euler, (), 1)
            rotation = quat_xyzw_to_matrix(euler_deg_to_quat_xyzw(euler))
            center = rotation @ np.array(SHAPES[block_type].center_of_mass_m)
            if np.abs(center - bounds_m(block).mean(axis=0))[:2].max() < _OFF_CENTER_M:
                poses.append((block_type, euler))
    return poses


_BALANCED = _balanced()


class AffordanceMaker:
    """Kind: `ad-place`."""

    subtask: Subtask = "AD"
    scenes_tried = 180
    drafts_a_scene = 1

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One draft: a block in a pose drawn, one place where it stays, and three where not."""
        annexed = with_annex(scene, rng) if rng.random() < _ANNEXED else None
        blocks = annexed or scene.blocks
        if not all(map(surely_stands, groups(blocks))):
            return
        view = drawn_view(rng)
        plain = QuestionPicture("scene", blocks, view)
        tops = visible_tops(plain, seen(plain), _STEP_PX, _FLAT_RISE)
        for _ in range(_BLOCKS_TRIED if tops else 0):
            block = _drawn_block(blocks, rng)
            places = _places(plain, block, shuffled(rng, tops), rng)
            if places:
                alone = QuestionPicture(BLOCK_LABEL, (block,), view)
                facts = {"block": block.type, "euler": list(block.euler_deg)}
                marks = [Mark("A", top.position_m) for top in places]
                looks = tuple(_looks(plain, top) for top in places)
                made = draft(scene, rng, "ad-place", marks, [plain, alone], "", facts=facts)
                yield replace(made, looks=looks)
                return

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By statics and simulation of the block at every place."""
        slots_of(question)
        shown, alone = picture_of(question, "scene"), picture_of(question, BLOCK_LABEL)
        if len(alone.blocks) != 1:
            raise UnfairError("the second picture is not of one block")
        stays = []
        for letter in LETTERS:
            x, y, _ = _marked(shown, letter)
            put = lowered(alone.blocks[0], shown.blocks, x, y)
            found = verdict((*shown.blocks, put), put.order)
            if found is None:
                raise UnfairError(f"it is not sure whether the block stays at place {letter}")
            stays.append(found)
        return only_index(stays)


def _marked(shown: QuestionPicture, letter: str) -> tuple[float, float, float]:
    """The place with a letter; UnfairError unless it shows on a block."""
    shot = seen(replace(shown, marks=()))
    for mark in shown.marks:
        if mark.letter == letter and seen_order(shown, shot, mark.position_m) is not None:
            return mark.position_m
    raise UnfairError(f"no place {letter} is marked on a block")


def _drawn_block(blocks: Sequence[Block], rng: np.random.Generator) -> Block:
    block_type, euler = pick(rng, _BALANCED)
    order = max(block.order for block in blocks) + 1
    return Block(order, block_type, pick(rng, COLORS), (0.0, 0.0, 0.0), euler, (), 1)


def _places(
    plain: QuestionPicture, block: Block, tops: Sequence[Top], rng: np.random.Generator
) -> list[Top]:
    """The right place and three wrong ones, apart in the picture; none where there are too few."""
    found: dict[bool, list[Top]] = {True: [], False: []}
    for top in tops[:_PLACES_TRIED]:
        others = [Mark("A", one.position_m) for sort in found.values() for one in sort]
        if not is_apart(plain, Mark("A", top.position_m), others, _APART_PX / 2):
            continue
        put = lowered(block, plain.blocks, *top.position_m[:2])
        likely = is_balanced(group_of((*plain.blocks, put), put.order))
        if len(found[likely]) == (_MOST_STAYING if likely else _MOST_FALLING):
            continue
        stays = _by_statics(plain.blocks, block, top)
        if stays is not None:
            found[stays].append(top)
    if len(found[False]) < _ENOUGH:
        return []
    together = [*found[True], *found[False]]
    marks = [Mark("A", top.position_m) for top in together]
    apart = np.array([[is_apart(plain, a, [b], _APART_PX) for b in marks] for a in marks])
    measures = np.array([_looks(plain, top) for top in together])
    for _ in range(_FOURS_TRIED):
        four = four_alike(measures, apart, rng, rights=len(found[True]))
        if four.chosen and _are_sure(plain, block, [marks[i] for i in four.chosen]):
            return [together[i] for i in four.chosen]
    return []


def _looks(plain: QuestionPicture, top: Top) -> tuple[float, ...]:
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


def _by_statics(blocks: Sequence[Block], block: Block, top: Top) -> bool | None:
    """Whether the block stays at a place, and likewise 5 mm off to any side; None where unsure."""
    x, y, _ = top.position_m
    put = lowered(block, blocks, x, y)
    stays = surely_stays((*blocks, put), put.order)
    if stays is None:
        return None
    for dx, dy in _SHIFTS_M:
        put = lowered(block, blocks, x + dx, y + dy)
        if is_balanced(group_of((*blocks, put), put.order)) is not stays:
            return None
    return stays


def _are_sure(plain: QuestionPicture, block: Block, marks: Sequence[Mark]) -> bool:
    """Whether, by simulation too, the first place holds and the others do not."""
    if not is_inside(replace(plain, marks=tuple(marks))):
        return False
    puts = [lowered(block, plain.blocks, *mark.position_m[:2]) for mark in marks]
    return all(
        verdict((*plain.blocks, put), put.order) is (number == 0) for number, put in enumerate(puts)
    )
