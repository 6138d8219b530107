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
from phyblock.generate.poses import POSES
from phyblock.generate.questions.base import Draft, UnfairError
from phyblock.generate.questions.pictured import (
    draft,
    only_index,
    pick,
    picture_of,
    shuffled,
    state,
)
from phyblock.generate.questions.seeing import GOAL_VIEW
from phyblock.generate.questions.wording import slots_of
from phyblock.sim.outcomes import OUTCOME_SETTINGS, Setting, holds
from phyblock.sim.question_pictures import BLOCK_LABEL
from phyblock.sim.seeing import Top, is_apart, is_inside, seen, seen_order, visible_tops
from phyblock.sim.support import bounds_m, drop_height_m

__all__ = ["AffordanceMaker"]

_BLOCKS_TRIED = 4
_PLACES_TRIED = 30
_WRONG = 3
_STEP_PX = 8
_LEAST_RISE = 0.6
_FLAT_RISE = 0.99
_FLAT_GAP_M, _SLOPED_GAP_M = 0.0015, 0.03
_SHIFT_M = 0.008
_OFF_CENTER_M = 0.001
_LIFT_M = 0.6
_APART_PX = 20.0


def _balanced() -> list[tuple[BlockType, Euler]]:
    """Poses whose center of mass is under the middle of what is seen from above.

    Of others, such as a wedge, nobody could say what "its middle" is.
    """
    found = []
    for block_type in BLOCK_TYPES:
        for euler in POSES[block_type].values():
            block = Block(1, block_type, "red", (0.0, 0.0, 0.0), euler, (), 1)
            rotation = quat_xyzw_to_matrix(euler_deg_to_quat_xyzw(euler))
            center = rotation @ np.array(SHAPES[block_type].center_of_mass_m)
            if np.abs(center - bounds_m(block).mean(axis=0))[:2].max() < _OFF_CENTER_M:
                found.append((block_type, euler))
    return found


_BALANCED = _balanced()


class AffordanceMaker:
    """Kind: `ad-place`."""

    subtask: Subtask = "AD"
    scenes_tried = 160
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
            mark = next((mark for mark in shown.marks if mark.letter == letter), None)
            if (
                mark is None
                or seen_order(shown, seen(replace(shown, marks=())), mark.position_m) is None
            ):
                raise UnfairError(f"no place {letter} is marked on a block")
            verdict = _verdict(question.scene, alone.blocks[0], mark.position_m, OUTCOME_SETTINGS)
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


def _places(
    scene: Scene, block: Block, tops: Sequence[Top], plain: QuestionPicture
) -> list[Mark] | None:
    """The right place and three wrong ones, apart in the picture; None when there are too few."""
    right: list[Mark] = []
    wrong: list[Mark] = []
    tried = 0
    for top in tops:
        mark = Mark("A", top.position_m)
        if not is_apart(plain, mark, [*right, *wrong], _APART_PX):
            continue
        if not is_inside(replace(plain, marks=(mark,))) or not _is_met(scene, block, top):
            continue
        tried += 1
        verdict = _surely(scene, block, top.position_m, len(right) < 1, len(wrong) < _WRONG)
        if verdict is not None:
            (right if verdict else wrong).append(mark)
        if right and len(wrong) == _WRONG:
            return [*right, *wrong]
        if tried == _PLACES_TRIED:
            break
    return None


def _surely(
    scene: Scene,
    block: Block,
    place_m: tuple[float, float, float],
    wants_right: bool,
    wants_wrong: bool,
) -> bool | None:
    """Whether it stays at a place, and likewise 8 mm off in every direction; None if unsure."""
    x, y, z = place_m
    first = _verdict(scene, block, place_m, OUTCOME_SETTINGS[:1])
    if first is None or not (wants_right if first else wants_wrong):
        return None
    for dx, dy in ((_SHIFT_M, 0.0), (-_SHIFT_M, 0.0), (0.0, _SHIFT_M), (0.0, -_SHIFT_M)):
        if _verdict(scene, block, (x + dx, y + dy, z), OUTCOME_SETTINGS[:1]) != first:
            return None
    return first if _verdict(scene, block, place_m, OUTCOME_SETTINGS[1:]) == first else None


def _verdict(
    scene: Scene, block: Block, place_m: tuple[float, float, float], settings: Sequence[Setting]
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
