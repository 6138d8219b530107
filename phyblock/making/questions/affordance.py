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
    euler_deg_to_quat_xyzw,
    quat_xyzw_to_matrix,
)
from phyblock.domain.question import LETTERS, Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.poses import POSES
from phyblock.making.questions.affordance_places import (
    Place,
    alike_places,
    looks_of,
    sort_of,
    stays_at,
)
from phyblock.making.questions.annexes import with_annex
from phyblock.making.questions.choices import pick, shuffled
from phyblock.making.questions.picture_view import (
    are_seen,
    drawn_view,
    require_seen,
    shows_solid,
)
from phyblock.making.questions.pictured_drafts import draft, only_index, picture_of
from phyblock.making.questions.placing import lowered
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.wording import slots_of
from phyblock.sim.balance import surely_stands
from phyblock.sim.question_pictures import BLOCK_LABEL
from phyblock.sim.seeing import Top, seen, seen_order, visible_tops
from phyblock.sim.steps import groups
from phyblock.sim.support import bounds_m

__all__ = ["AffordanceMaker"]

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
