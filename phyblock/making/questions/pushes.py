"""PD, pushes: the settled scene after a block was pushed, among what other pushes lead to.

Every option is what really follows one of four pushes: of the block itself or of one close by, to
the right or to the left. Which of the four is asked about is drawn, so that the pictures alone say
nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.choices import shuffled
from phyblock.making.questions.margins import group_of, is_sure
from phyblock.making.questions.marked_blocks import TAKEN
from phyblock.making.questions.pictured_drafts import (
    are_told_apart,
    draft,
    state,
    story_of,
    with_room,
)
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.sim.camera import view_axes
from phyblock.sim.outcomes import OUTCOME_SETTINGS, Outcome, Push, after
from phyblock.sim.seeing import block_mark, seen, shown_pixels
from phyblock.sim.steps import groups
from phyblock.sim.support import bounds_m, boxes_near
from phyblock.stable import plain_sum

__all__ = ["meant_push", "push_drafts", "sure_push", "what_happened"]

_BLOCKS_TRIED = 3
_PUSHES_TRIED = 9
_OPTIONS = 4
_FRONTS_DEG = (0.0, 90.0, 180.0, 270.0)
_ELEVATIONS_DEG = (20, 32)
_DIRECTIONS = {"to the right": 1, "to the left": -1}
_LEAST_SHOWN = 60
_TOUCH_M = 0.002
_ALONG_M = 0.01
_REACH_M = 0.12


def push_drafts(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """A block pushed to the right or left as seen, and what follows other pushes close by."""
    plain = _shown_whole(scene, rng)
    if plain is None:
        return
    shot = seen(plain)
    for block in shuffled(rng, scene.blocks)[:_BLOCKS_TRIED]:
        told = _told_apart(plain, _pushes(plain, block.order, rng))
        if len(told) < _OPTIONS:
            continue
        (order, direction), right = told.pop(int(rng.integers(_OPTIONS)))
        mark = block_mark(plain, shot, order, TAKEN)
        outcome = sure_push(scene.blocks, meant_push(plain, order, direction)) if mark else None
        if mark is None or outcome is None:
            continue
        right = replace(right, blocks=outcome.settled)
        if are_told_apart([right, *(picture for _, picture in told)]):
            facts = {"pushed": order, "moved": list(outcome.moved)}
            options = [right, *(picture for _, picture in told)]
            shown = [replace(plain, marks=(mark,))]
            value = "falls" if len(outcome.moved) > 1 else "slides"
            slots = {"direction": direction}
            yield draft(scene, rng, "pd-push", options, shown, value, slots, facts)
            return


def _shown_whole(scene: Scene, rng: np.random.Generator) -> QuestionPicture | None:
    """A picture from the front, back or a side in which every block shows; None where none does."""
    low, high = _ELEVATIONS_DEG
    for front_deg in shuffled(rng, _FRONTS_DEG):
        view = (front_deg, float(rng.integers(low, high + 1)))
        plain = replace(state(scene, scene.blocks, view), framed=with_room(scene.blocks))
        if min(shown_pixels(plain, seen(plain)).values()) >= _LEAST_SHOWN:
            return plain
    return None


def meant_push(picture: QuestionPicture, order: int, direction: str) -> Push:
    """The push that is meant by a direction in a picture."""
    right = view_axes(*picture.view_deg)[0] * _DIRECTIONS[direction]
    x, y = (round(float(part), 6) + 0.0 for part in right[:2])
    return Push(order, (x, y))


def sure_push(blocks: Sequence[Block], push: Push) -> Outcome | None:
    """What surely follows a push; None where settings, or statics if none came down, doubt it."""
    outcome = after(blocks, push)
    if not outcome.is_clear or push.order not in outcome.moved:
        return None
    height = {block.order: block.position_m[2] for block in blocks}
    if any(height[b.order] - b.position_m[2] > _TOUCH_M for b in outcome.settled):
        return outcome
    return outcome if is_sure(group_of(outcome.settled, push.order), ()) else None


def what_happened(
    blocks: Sequence[Block], picture: QuestionPicture, push: Push
) -> tuple[tuple[int, ...], tuple[int, ...], frozenset[int], frozenset[int]]:
    """What a picture says happened, in words that two settled scenes can be compared by.

    Who is gone, who moved, who came down, and who went the way of the push. UnfairError as
    `story_of`.
    """
    story = story_of(blocks, picture)
    start = {block.order: block.position_m for block in blocks}
    along = {
        b.order: plain_sum(
            (end - begin) * way
            for begin, end, way in zip(start[b.order], b.position_m, push.direction, strict=False)
        )
        for b in picture.blocks
    }
    return (*story, frozenset(order for order, way_m in along.items() if way_m > _ALONG_M))


def _pushes(plain: QuestionPicture, order: int, rng: np.random.Generator) -> list[tuple[int, str]]:
    """Pushes of a block and of those that it touches, to either side, in an order drawn."""
    boxes = {block.order: bounds_m(block) for block in plain.blocks}
    touching = [one for one, box in boxes.items() if boxes_near(box, boxes[order], _TOUCH_M)]
    return shuffled(rng, list(product(touching, _DIRECTIONS)))[:_PUSHES_TRIED]


def _told_apart(
    plain: QuestionPicture, pushes: Sequence[tuple[int, str]]
) -> list[tuple[tuple[int, str], QuestionPicture]]:
    """The first four pushes of which each leads to a picture that tells a story of its own.

    Settings are compared for the one that is asked about alone; one will do to look for others.
    Blocks that stand far away are left alone.
    """
    found: list[tuple[tuple[int, str], QuestionPicture]] = []
    stories: set[object] = set()
    near = next(
        group
        for group in groups(plain.blocks, _REACH_M)
        if any(block.order == pushes[0][0] for block in group)
    )
    axis = meant_push(plain, pushes[0][0], next(iter(_DIRECTIONS)))
    for number, (order, direction) in enumerate(pushes):
        if len(found) + len(pushes) - number < _OPTIONS:
            break
        outcome = after(near, meant_push(plain, order, direction), OUTCOME_SETTINGS[:1])
        if not outcome.is_clear or order not in outcome.moved:
            continue
        settled = {block.order: block for block in outcome.settled}
        blocks = tuple(settled.get(block.order, block) for block in plain.blocks)
        picture = replace(plain, blocks=blocks)
        try:
            story = what_happened(plain.blocks, picture, axis)
        except UnfairError:
            continue
        pictures = [plain, *(one for _, one in found), picture]
        if story not in stories and are_told_apart(pictures):
            stories.add(story)
            found.append(((order, direction), picture))
        if len(found) == _OPTIONS:
            break
    return found
