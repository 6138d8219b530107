"""AD: at which of four marked places a block stays when it is put down there, by simulation."""

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
from phyblock.sim.engine import Physics
from phyblock.sim.outcomes import OUTCOME_SETTINGS, holds
from phyblock.sim.question_pictures import BLOCK_LABEL
from phyblock.sim.seeing import Top, is_apart, is_inside, seen, seen_order, visible_tops
from phyblock.sim.support import bounds_m, drop_height_m
from phyblock_making.poses import POSES
from phyblock_making.questions.choices import pick, shuffled
from phyblock_making.questions.goal_view import GOAL_VIEW
from phyblock_making.questions.pictured_drafts import (
    draft,
    only_index,
    picture_of,
    state,
)
from phyblock_making.questions.question_draft import Draft, UnfairError
from phyblock_making.questions.wording import slots_of

__all__ = ["AffordanceMaker"]

_BLOCKS_TRIED = 6
_PLACES_TRIED = 40
_STEP_PX = 5
_LEAST_RISE = 0.6
_FLAT_RISE = 0.99
_FLAT_GAP_M, _SLOPED_GAP_M = 0.0015, 0.03
_SHIFTS_M = ((0.007, 0.0), (-0.007, 0.0), (0.0, 0.007), (0.0, -0.007))
_CENTRAL_M = 0.022
_CENTRAL_TRIED = 8
_OFF_CENTER_M = 0.001
_LIFT_M = 0.6
_APART_PX = 18.0


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
    scenes_tried = 400
    drafts_a_scene = 1

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One draft: a block in a pose drawn, one place where it stays, and three where not."""
        plain = state(scene, scene.blocks, GOAL_VIEW)
        tops = visible_tops(plain, seen(plain), _STEP_PX, _LEAST_RISE)
        for _ in range(_BLOCKS_TRIED):
            block = _drawn_block(scene, rng)
            places = _places(scene, block, shuffled(rng, tops), plain)
            if places:
                alone = QuestionPicture(BLOCK_LABEL, (block,), GOAL_VIEW)
                facts = {"block": block.type, "euler": list(block.euler_deg)}
                yield draft(scene, rng, "ad-place", places, [plain, alone], block.type, facts=facts)
                return

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By simulating the block at every place."""
        slots_of(question)
        shown, alone = picture_of(question, "scene"), picture_of(question, BLOCK_LABEL)
        if shown.blocks != question.scene.blocks or len(alone.blocks) != 1:
            raise UnfairError("the pictures are not of the whole scene and of one block")
        stays = []
        for letter in LETTERS:
            place_m = _marked(shown, letter)
            verdict = _verdict(question.scene, alone.blocks[0], place_m, OUTCOME_SETTINGS)
            if verdict is None:
                raise UnfairError(f"the settings disagree on place {letter}")
            stays.append(verdict)
        return only_index(stays)


def _marked(shown: QuestionPicture, letter: str) -> tuple[float, float, float]:
    """The place with a letter; UnfairError unless it shows on a block."""
    shot = seen(replace(shown, marks=()))
    for mark in shown.marks:
        if mark.letter == letter and seen_order(shown, shot, mark.position_m) is not None:
            return mark.position_m
    raise UnfairError(f"no place {letter} is marked on a block")


def _drawn_block(scene: Scene, rng: np.random.Generator) -> Block:
    block_type, euler = pick(rng, _BALANCED)
    order = max(block.order for block in scene.blocks) + 1
    return Block(order, block_type, pick(rng, COLORS), (0.0, 0.0, 0.0), euler, (), 1)


def _places(scene: Scene, block: Block, tops: Sequence[Top], plain: QuestionPicture) -> list[Mark]:
    """The right place and three wrong ones, apart in the picture; none where there are too few.

    The right one is looked for first and on a flat top near the middle of a block: elsewhere it is
    rare. Wrong ones may be anywhere.
    """
    central = [t for t in tops if t.off_center_m < _CENTRAL_M and t.rise >= _FLAT_RISE]
    chosen = _first_sure(scene, block, central[:_CENTRAL_TRIED], True, [], plain)
    if not chosen:
        return []
    chosen += _first_sure(scene, block, tops[:_PLACES_TRIED], False, chosen, plain)
    return chosen if len(chosen) == len(LETTERS) else []


def _first_sure(
    scene: Scene,
    block: Block,
    tops: Sequence[Top],
    stays: bool,
    others: Sequence[Mark],
    plain: QuestionPicture,
) -> list[Mark]:
    """The first place where it surely stays, or as many where it surely does not as are wanted."""
    marks: list[Mark] = []
    wanted = 1 if stays else len(LETTERS) - 1
    for top in tops:
        mark = Mark("A", top.position_m)
        is_fit = (
            len(marks) < wanted
            and is_apart(plain, mark, [*others, *marks], _APART_PX)
            and is_inside(replace(plain, marks=(mark,)))
            and _is_met(scene, block, top)
        )
        if is_fit and _is_sure(scene, block, top.position_m, stays):
            marks.append(mark)
    return marks


def _is_sure(scene: Scene, block: Block, place_m: tuple[float, float, float], stays: bool) -> bool:
    """Whether it stays, or does not, at a place and likewise 7 mm off in every direction."""
    x, y, z = place_m
    places = [place_m, *((x + dx, y + dy, z) for dx, dy in _SHIFTS_M)]
    quick = OUTCOME_SETTINGS[:1]
    if any(_verdict(scene, block, place, quick) is not stays for place in places):
        return False
    return _verdict(scene, block, place_m, OUTCOME_SETTINGS[1:]) is stays


def _verdict(
    scene: Scene, block: Block, place_m: tuple[float, float, float], settings: Sequence[Physics]
) -> bool | None:
    return holds((*scene.blocks, _put(scene, block, place_m)), block.order, settings)


def _put(scene: Scene, block: Block, place_m: tuple[float, float, float]) -> Block:
    """The block let down with the middle of its outline, seen from above, over a place."""
    middle = bounds_m(block).mean(axis=0)
    x = block.position_m[0] + place_m[0] - float(middle[0])
    y = block.position_m[1] + place_m[1] - float(middle[1])
    lifted = replace(block, position_m=(x, y, block.position_m[2] + _LIFT_M))
    fall = drop_height_m(lifted, scene.blocks)
    return replace(block, position_m=(x, y, lifted.position_m[2] - fall))


def _is_met(scene: Scene, block: Block, top: Top) -> bool:
    """Whether the block comes down onto the marked surface itself, not onto a neighbor."""
    bottom = float(bounds_m(_put(scene, block, top.position_m))[0, 2])
    most = _FLAT_GAP_M if top.rise >= _FLAT_RISE else _SLOPED_GAP_M
    return -_FLAT_GAP_M <= bottom - top.position_m[2] <= most
