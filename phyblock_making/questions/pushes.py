"""PD, pushes: the settled scene after a block was pushed, among what other pushes lead to.

Every option is what really follows one of four pushes: of the block itself or of one that it
touches, to the right or to the left. Which of the four is asked about is drawn, so that the
pictures alone say nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.sim.camera import view_axes
from phyblock.sim.outcomes import OUTCOME_SETTINGS, Outcome, Push, after
from phyblock.sim.seeing import block_mark, seen, shown_pixels
from phyblock.sim.steps import groups
from phyblock.sim.support import bounds_m, boxes_near
from phyblock_making.questions.choices import pick, shuffled
from phyblock_making.questions.counterfactual import TAKEN
from phyblock_making.questions.margins import group_of, is_sure
from phyblock_making.questions.pictured_drafts import (
    are_told_apart,
    draft,
    state,
    story_of,
    with_room,
)
from phyblock_making.questions.question_draft import Draft, UnfairError

__all__ = ["meant_push", "push_drafts", "sure_push", "what_happened"]

_PAIRS_TRIED = 3
_OPTIONS = 4
_FRONTS_DEG = (0.0, 90.0, 180.0, 270.0)
_ELEVATIONS_DEG = (20, 32)
_DIRECTIONS = {"to the right": 1, "to the left": -1}
_LEAST_SHOWN = 60
_TOUCH_M = 0.002
_REACH_M = 0.12


def push_drafts(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """A block pushed to the right or left as seen, and what follows other pushes close by."""
    view = (pick(rng, _FRONTS_DEG), float(rng.integers(_ELEVATIONS_DEG[0], _ELEVATIONS_DEG[1] + 1)))
    plain = replace(state(scene, scene.blocks, view), framed=with_room(scene.blocks))
    shot = seen(plain)
    if min(shown_pixels(plain, shot).values()) < _LEAST_SHOWN:
        return
    for one, other in shuffled(rng, _touching(scene.blocks))[:_PAIRS_TRIED]:
        pushes = [(order, direction) for order, direction in product((one, other), _DIRECTIONS)]
        (order, direction), *others = shuffled(rng, pushes)
        mark = block_mark(plain, shot, order, TAKEN)
        push = meant_push(plain, order, direction)
        options = _options(plain, push, [meant_push(plain, *another) for another in others])
        if mark is None or len(options) < _OPTIONS:
            continue
        outcome = sure_push(scene.blocks, push)
        if outcome is not None:
            facts = {"pushed": order, "moved": list(outcome.moved)}
            right = replace(plain, blocks=outcome.settled)
            told = [right, *options[1:]]
            shown = [replace(plain, marks=(mark,))]
            value = "falls" if len(outcome.moved) > 1 else "slides"
            slots = {"direction": direction}
            yield draft(scene, rng, "pd-push", told, shown, value, slots, facts)
            return


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
) -> tuple[tuple[int, ...], tuple[int, ...], frozenset[int], bool]:
    """What a picture says happened, in words that two settled scenes can be compared by.

    Who is gone, who moved, who came down, and whether the pushed block went with the push.
    UnfairError as `story_of`.
    """
    story = story_of(blocks, picture)
    start = next(b.position_m for b in blocks if b.order == push.order)
    end = next((b.position_m for b in picture.blocks if b.order == push.order), start)
    along = sum((e - s) * d for s, e, d in zip(start, end, push.direction, strict=False))
    return (*story, along > _TOUCH_M)


def _touching(blocks: Sequence[Block]) -> list[tuple[int, int]]:
    """Orders of blocks that touch one another, in pairs."""
    boxes = [(block.order, bounds_m(block)) for block in blocks]
    return [
        (one, other)
        for i, (one, box) in enumerate(boxes)
        for other, box_of_other in boxes[i + 1 :]
        if boxes_near(box, box_of_other, _TOUCH_M)
    ]


def _options(plain: QuestionPicture, push: Push, others: Sequence[Push]) -> list[QuestionPicture]:
    """Pictures of what follows the pushes, the first one's first, as far as all tell their own.

    No answer hangs on the others, so one setting will do for now, and what stands far away is left
    alone.
    """
    chosen: list[QuestionPicture] = []
    stories: set[object] = set()
    near = next(g for g in groups(plain.blocks, _REACH_M) if any(b.order == push.order for b in g))
    for one in (push, *others):
        outcome = after(near, one, OUTCOME_SETTINGS[:1])
        settled = {block.order: block for block in outcome.settled}
        blocks = tuple(settled.get(block.order, block) for block in plain.blocks)
        picture = replace(plain, blocks=blocks)
        try:
            story = what_happened(plain.blocks, picture, push)
        except UnfairError:
            return []
        if not outcome.is_clear or story in stories or one.order not in outcome.moved:
            return []
        stories.add(story)
        chosen.append(picture)
    return chosen if are_told_apart([plain, *chosen]) else []
