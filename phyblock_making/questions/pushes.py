"""PD, pushes: the settled scene after a block was pushed, among what else could be thought of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.sim.camera import view_axes
from phyblock.sim.outcomes import (
    OUTCOME_SETTINGS,
    Outcome,
    Push,
    after,
    after_removal,
)
from phyblock.sim.seeing import block_mark, seen, shown_pixels
from phyblock_making.questions.choices import pick, shuffled
from phyblock_making.questions.counterfactual import TAKEN
from phyblock_making.questions.pictured_drafts import (
    are_told_apart,
    draft,
    moved_between,
    state,
)
from phyblock_making.questions.question_draft import Draft, UnfairError

__all__ = ["meant_push", "push_drafts", "what_happened"]

_PUSHES_TRIED = 4
_FRONTS_DEG = (0.0, 90.0, 180.0, 270.0)
_LEVEL_M, _DOWN_M = 0.004, 0.008
_PUSH_ELEVATION_DEG = 26.0
_DIRECTIONS = {"to the right": 1, "to the left": -1}
_LEAST_SHOWN = 60


def push_drafts(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """A block pushed to the right or left as seen, and what else could have been thought of."""
    view = (pick(rng, _FRONTS_DEG), _PUSH_ELEVATION_DEG)
    plain = state(scene, scene.blocks, view)
    shot = seen(plain)
    if min(shown_pixels(plain, shot).values()) < _LEAST_SHOWN:
        return
    for block in shuffled(rng, scene.blocks)[:_PUSHES_TRIED]:
        mark = block_mark(plain, shot, block.order, TAKEN)
        if mark is None:
            continue
        direction = pick(rng, tuple(_DIRECTIONS))
        push = meant_push(plain, block.order, direction)
        outcome = after(scene.blocks, push)
        if not outcome.is_clear or block.order not in outcome.moved:
            continue
        wrong = _misjudged(scene, push, outcome, rng)
        options = _distinct(scene, plain, chain([outcome.settled], wrong), push)
        if len(options) == 4:
            facts = {"pushed": block.order, "moved": list(outcome.moved)}
            slots = {"direction": direction}
            shown = [replace(plain, marks=(mark,))]
            value = "falls" if len(outcome.moved) > 1 else "slides"
            yield draft(scene, rng, "pd-push", options, shown, value, slots, facts)
            return


def meant_push(picture: QuestionPicture, order: int, direction: str) -> Push:
    """The push that is meant by a direction in a picture."""
    right = view_axes(*picture.view_deg)[0] * _DIRECTIONS[direction]
    x, y = (round(float(part), 6) + 0.0 for part in right[:2])
    return Push(order, (x, y))


def _misjudged(
    scene: Scene, push: Push, outcome: Outcome, rng: np.random.Generator
) -> Iterator[tuple[Block, ...]]:
    """Wrong outcomes: the others stay, it carries too few or too many along, it goes elsewhere.

    No answer hangs on them, so one setting will do.
    """
    quick = OUTCOME_SETTINGS[:1]
    slid = _slid(scene, push, {push.order})
    if outcome.moved != (push.order,):
        yield slid
    back = replace(push, direction=(-push.direction[0], -push.direction[1]))
    opposite = after(scene.blocks, back, quick)
    if opposite.is_clear:
        yield opposite.settled
    carried = _above(scene, push.order)
    if len(carried) > 1:
        yield _slid(scene, push, carried)
    for other in shuffled(rng, [b for b in scene.blocks if b.order != push.order])[:3]:
        elsewhere = after(scene.blocks, replace(push, order=other.order), quick)
        if elsewhere.is_clear and elsewhere.moved:
            yield elsewhere.settled
    gone = after_removal(scene.blocks, push.order, quick)
    if gone.is_clear and gone.moved:
        settled = {block.order: block for block in (*slid, *gone.settled)}
        yield tuple(settled[block.order] for block in scene.blocks)


def _slid(scene: Scene, push: Push, orders: set[int]) -> tuple[Block, ...]:
    """The scene with some blocks shifted as far as the push goes, all else in place."""
    x, y = (part * push.distance_m for part in push.direction)
    return tuple(
        replace(
            b,
            position_m=(
                round(b.position_m[0] + x, 4),
                round(b.position_m[1] + y, 4),
                b.position_m[2],
            ),
        )
        if b.order in orders
        else b
        for b in scene.blocks
    )


def _above(scene: Scene, order: int) -> set[int]:
    """A block and all that rests on it, directly or not."""
    standing_on = {order}
    for _ in scene.blocks:
        standing_on |= {b.order for b in scene.blocks if standing_on & set(b.depend)}
    return standing_on


def _distinct(
    scene: Scene, plain: QuestionPicture, states: Iterable[Sequence[Block]], push: Push
) -> list[QuestionPicture]:
    """Pictures of the states, four at most, that tell different stories in different pixels."""
    chosen: list[QuestionPicture] = []
    stories: list[object] = []
    for blocks in states:
        picture = state(scene, blocks, plain.view_deg)
        try:
            story = what_happened(scene, picture, push)
        except UnfairError:
            story = None
        is_new = story is not None and story not in stories
        if is_new and are_told_apart([plain, *chosen, picture]):
            chosen.append(picture)
            stories.append(story)
        if len(chosen) in (0, 4):
            break
    return chosen


def what_happened(
    scene: Scene, picture: QuestionPicture, push: Push
) -> tuple[tuple[int, ...], tuple[int, ...], bool, frozenset[int]]:
    """What a picture says happened, in words that two settled scenes can be compared by.

    Who is gone, who moved, whether the pushed block went with the push, and who came down.
    UnfairError where it is hard to tell whether a block came down.
    """
    gone, moved = moved_between(scene.blocks, picture)
    goal = {block.order: block for block in scene.blocks}
    now = {block.order: block for block in picture.blocks}
    start, end = goal[push.order].position_m, now[push.order].position_m
    along = sum((e - s) * d for s, e, d in zip(start, end, push.direction, strict=False))
    down_m = {order: goal[order].position_m[2] - now[order].position_m[2] for order in moved}
    if any(_LEVEL_M < abs(height) < _DOWN_M for height in down_m.values()):
        raise UnfairError(f"picture {picture.label} shows a block hardly lower than before")
    dropped = frozenset(order for order, height in down_m.items() if height >= _DOWN_M)
    return gone, moved, along > 0, dropped
