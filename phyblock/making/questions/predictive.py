"""PD: which next step holds, and what a push leads to, by statics and simulation.

Next steps: all four pictures add the same block to an unfinished structure, let down where it
first touches; right and wrong places are drawn alike, all over the structure. Pushes: a block is
pushed to the right or left as seen, and other pictures show what other pushes close by lead to.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.question import LETTERS, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions import base, sight
from phyblock.making.questions.base import Draft, Maker, UnfairError, draft, pick, shuffled
from phyblock.making.questions.counterfactual import TAKEN
from phyblock.making.questions.structures import (
    group_of,
    is_sure,
    lowered,
    stays_round,
    verdict,
    with_annex,
)
from phyblock.sim.balance import surely_stands
from phyblock.sim.camera import view_axes
from phyblock.sim.contact import bounds_m, boxes_near, whole_bounds_m
from phyblock.sim.dynamics import groups
from phyblock.sim.engine import Pose
from phyblock.sim.outcomes import OUTCOME_SETTINGS, Outcome, Push, after, has_moved
from phyblock.sim.pictures import Shot
from phyblock.sim.question_pictures import (
    block_mark,
    changed_pixels,
    differing_pixels,
    is_inside,
    seen,
    shown_pixels,
)

_ROOM_M = 0.06


class PredictiveMaker(Maker):
    """Kinds: `pd-next` (the next step) and `pd-push` (the settled scene after a push)."""

    subtask: Subtask = "PD"

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask for a next step or about a push, as drawn, where one is fair."""
        yield from pick(rng, (_next_steps, _pushes))(scene, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Decide by statics and simulation."""
        slots = base.slots_of(question)
        shown, options = sight.picture_of(question, "scene"), sight.option_pictures(question)
        if base.stem_of(question.wording) == "pd-next":
            return base.only_index([_can_follow(shown, one) for one in options])
        push = _meant_push(shown, sight.marked_order(shown, TAKEN), slots["direction"])
        outcome = _sure_push(shown.blocks, push)
        if outcome is None:
            raise UnfairError("it is not sure what follows the push")
        expected = _story(shown.blocks, replace(shown, blocks=outcome.settled), push)
        return base.only_index([_story(shown.blocks, one, push) == expected for one in options])


def _with_room(blocks: Sequence[Block], above_m: float = 0.0) -> tuple[Block, ...]:
    """Return the blocks to frame a picture on for floor all round, and some air above [m]."""
    low, high = whole_bounds_m(blocks)
    first = max(block.order for block in blocks) + 1
    z = round(float(high[2]) + above_m, 4) if above_m else 0.0125
    sides = itertools.product(*((low[i] - _ROOM_M, high[i] + _ROOM_M) for i in (0, 1)))
    places = ((round(float(x), 4), round(float(y), 4), z) for x, y in sides)
    corners = (
        Block(first + i, "cuboid1", "red", place, (0.0, 0.0, 0.0), (), 1)
        for i, place in enumerate(places)
    )
    return (*blocks, *corners)


# Next steps

RINGS_M = (0.0025, 0.005, 0.01)
"""The verdict on a next step holds all round it, this far off [m]."""
_STAGES_TRIED, _PLACES_TRIED, _PROPOSED, _SORT = 3, 60, 3, 8
_ANNEXED, _MOST_LEFT = 0.5, 6
_STEP_M, _MOST_STEPS, _LEAST_HEIGHT_M, _ABOVE_M = 0.0125, 6, 0.02, 0.03
_LEAST_SHOWN = 250
_ELEVATIONS_DEG = (34, 48)
"""High enough to tell what lies behind from what lies above."""


def _next_steps(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """Propose a stage of building, a block to come, one place where it stays and three others."""
    for _ in range(_STAGES_TRIED):
        stage, block = _stage(scene, rng)
        view, framed = base.drawn_view(rng, _ELEVATIONS_DEG), _with_room(stage, _ABOVE_M)
        shown = QuestionPicture("scene", stage, view, framed=framed)
        staying, falling = _places(shown, block, rng)
        pictures = [*staying, *falling]
        start, shots = seen(shown), [seen(one) for one in pictures]
        unlike = np.array([[float(differing_pixels(a, b)) for b in shots] for a in shots])
        measures = np.array([_looks(start, shot) for shot in shots])
        for _ in range(_PROPOSED if staying else 0):
            four = base.four_alike(measures, unlike, sight.LEAST_PIXELS, rng, rights=len(staying))
            if four:
                options, looks = [pictures[i] for i in four], measures[four].tolist()
                facts = {"placed": sight.orders_of(stage), "next": block.order}
                yield draft(scene, rng, "pd-next", options, [shown], {}, looks=looks, facts=facts)


def _stage(scene: Scene, rng: np.random.Generator) -> tuple[tuple[Block, ...], Block]:
    """Return the blocks placed so far, and one more of the scene's."""
    annexed = with_annex(scene, rng) if rng.random() < _ANNEXED else None
    if annexed and all(map(surely_stands, groups(annexed))):
        number = max(block.order for block in annexed) + 1
        return annexed, replace(pick(rng, scene.blocks), order=number)
    order, most = scene.graph.random_order(rng), max(1, len(scene) - 1)
    count = int(rng.integers(max(1, len(scene) - _MOST_LEFT), most + 1))
    stage = tuple(scene.blocks[vertex] for vertex in sorted(order[:count]))
    number = max(sight.orders_of(scene.blocks)) + 1
    left = [scene.blocks[vertex] for vertex in order[count:]]
    return stage, pick(rng, left) if left else replace(scene.blocks[0], order=number)


def _places(
    shown: QuestionPicture, block: Block, rng: np.random.Generator
) -> tuple[list[QuestionPicture], list[QuestionPicture]]:
    """Return pictures of the block let down where it stays by statics, and where not."""
    found: dict[bool, list[QuestionPicture]] = {True: [], False: []}
    start = seen(shown)
    for _ in range(_PLACES_TRIED):
        under = bounds_m(pick(rng, shown.blocks)).mean(axis=0)
        steps = rng.integers(-_MOST_STEPS, _MOST_STEPS + 1, size=2)
        x, y = (float(under[i]) + _STEP_M * int(steps[i]) for i in (0, 1))
        put = lowered(block, shown.blocks, x, y)
        picture = replace(shown, blocks=(*shown.blocks, put))
        if bounds_m(put)[0, 2] < _LEAST_HEIGHT_M or not is_inside(picture):
            continue
        stays = stays_round(put, shown.blocks, RINGS_M[-1:])
        if stays is None or len(found[stays]) == _SORT:
            continue
        shot = seen(picture)
        is_shown = shown_pixels(picture, shot)[put.order] >= _LEAST_SHOWN
        is_new = is_shown and differing_pixels(start, shot) >= sight.LEAST_PIXELS
        if is_new and sight.are_seen(picture, [put.order], sight.COUNTED):
            found[stays].append(picture)
    return found[True], found[False]


def _looks(first: Shot, shot: Shot) -> tuple[float, ...]:
    """Return measures of what a step adds to a picture: how much of it shows, and where."""
    shown, side = shot.block >= 0, len(shot.block) / 10
    area = max(int((first.block >= 0).sum()), 1) / 5
    rows, columns = np.nonzero(shown)
    new_rows, new_columns = np.nonzero(changed_pixels(first, shot))
    return (
        len(rows) / area,
        len(new_rows) / area,
        *(float(x) / side for x in (columns.mean(), rows.mean(), np.ptp(columns), rows.min())),
        *(float(x) / side for x in (new_columns.mean(), new_rows.mean())),
    )


def _can_follow(shown: QuestionPicture, option: QuestionPicture) -> bool:
    """True if one block was added so that all stays; UnfairError when that is not sure."""
    placed = {block.order for block in shown.blocks}
    added = [block for block in option.blocks if block.order not in placed]
    kept = tuple(block for block in option.blocks if block.order in placed)
    if len(added) != 1 or not sight.same_blocks(kept, shown.blocks):
        raise UnfairError(f"picture {option.label} does not add one block")
    stays = _stays(kept, added[0])
    if stays is None:
        raise UnfairError(f"it is not sure whether all stays in picture {option.label}")
    return stays


@functools.lru_cache(maxsize=64)
def _stays(stage: tuple[Block, ...], put: Block) -> bool | None:
    """True if a block put down stays, by simulation too, and likewise up to 1 cm off; or None."""
    stays = stays_round(put, stage, RINGS_M)
    return stays if verdict((*stage, put), put.order) is stays else None


# Pushes

_BLOCKS_TRIED, _PUSHES_TRIED = 3, 9
_FRONTS_DEG = (0.0, 90.0, 180.0, 270.0)
_ELEVATIONS_DEG_PUSHES = (20, 32)
_DIRECTIONS: Mapping[str, int] = base.WORDS["directions"]
_LEAST_SHOWN_PUSHES = 60
_TOUCH_M, _ALONG_M, _REACH_M = 0.002, 0.01, 0.12
_LEVEL_M, _DOWN_M = 0.004, 0.008


def _pushes(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """Propose pushes of which a picture from the front, back or a side shows every block."""
    for front_deg in shuffled(rng, _FRONTS_DEG):
        view = (front_deg, base.drawn_view(rng, _ELEVATIONS_DEG_PUSHES)[1])
        plain = QuestionPicture("scene", scene.blocks, view, framed=_with_room(scene.blocks))
        shot = seen(plain)
        if min(shown_pixels(plain, shot).values()) >= _LEAST_SHOWN_PUSHES:
            break
    else:
        return
    for block in shuffled(rng, scene.blocks)[:_BLOCKS_TRIED]:
        told = _told_apart(plain, block.order, rng)
        if len(told) < len(LETTERS):
            continue
        (order, direction), _ = told.pop(int(rng.integers(len(told))))
        mark = block_mark(plain, shot, order, TAKEN)
        outcome = _sure_push(scene.blocks, _meant_push(plain, order, direction)) if mark else None
        if mark and outcome:
            right = replace(plain, blocks=outcome.settled)
            options = [right, *(picture for _, picture in told)]
            if sight.are_told_apart(options):
                shown, slots = [replace(plain, marks=(mark,))], {"direction": direction}
                facts = {"pushed": order, "moved": list(outcome.moved)}
                yield draft(scene, rng, "pd-push", options, shown, slots, facts=facts)


def _told_apart(
    plain: QuestionPicture, order: int, rng: np.random.Generator
) -> list[tuple[tuple[int, str], QuestionPicture]]:
    """Return four pushes of a block or what it touches, each with a picture of its own story."""
    boxes = {block.order: bounds_m(block) for block in plain.blocks}
    touching = [one for one, box in boxes.items() if boxes_near(box, boxes[order], _TOUCH_M)]
    pushes = shuffled(rng, [*itertools.product(touching, _DIRECTIONS)])[:_PUSHES_TRIED]
    near = next(
        group
        for group in groups(plain.blocks, _REACH_M)
        if any(block.order == order for block in group)
    )
    found: list[tuple[tuple[int, str], QuestionPicture]] = []
    stories: set[object] = set()
    axis = _meant_push(plain, order, next(iter(_DIRECTIONS)))
    for number, (one, direction) in enumerate(pushes):
        if len(found) == len(LETTERS) or len(found) + len(pushes) - number < len(LETTERS):
            break
        outcome = after(near, _meant_push(plain, one, direction), OUTCOME_SETTINGS[:1])
        if not outcome.is_clear or one not in outcome.moved:
            continue
        settled = {block.order: block for block in outcome.settled}
        blocks = tuple(settled.get(block.order, block) for block in plain.blocks)
        picture = replace(plain, blocks=blocks)
        try:
            story = _story(plain.blocks, picture, axis)
        except UnfairError:
            continue
        if story not in stories and sight.are_told_apart(
            [plain, *(one for _, one in found), picture]
        ):
            stories.add(story)
            found.append(((one, direction), picture))
    return found


def _meant_push(picture: QuestionPicture, order: int, direction: str) -> Push:
    """Return the push that is meant by a direction in a picture."""
    right = view_axes(*picture.view_deg)[0] * _DIRECTIONS[direction]
    x, y = (round(float(part), 6) + 0.0 for part in right[:2])
    return Push(order, (x, y))


@functools.lru_cache(maxsize=16)
def _sure_push(blocks: tuple[Block, ...], push: Push) -> Outcome | None:
    """Return the sure outcome of a push; None where settings, or statics if none fell, doubt it."""
    outcome = after(blocks, push)
    if not outcome.is_clear or push.order not in outcome.moved:
        return None
    height = {block.order: block.position_m[2] for block in blocks}
    if any(height[b.order] - b.position_m[2] > _TOUCH_M for b in outcome.settled):
        return outcome
    return outcome if is_sure(group_of(outcome.settled, push.order), ()) else None


def _story(blocks: Sequence[Block], picture: QuestionPicture, push: Push) -> tuple[object, ...]:
    """Return orders of blocks gone, moved, come down, and gone the way pushed.

    UnfairError where that cannot be told.
    """
    goal, label = {block.order: block for block in blocks}, picture.label
    moved, down, along = [], [], []
    for block in picture.blocks:
        before = goal.get(block.order)
        if before is None or before.kind != block.kind:
            raise UnfairError(f"picture {label} shows a block that the scene has not")
        has = has_moved(Pose.goal(before), Pose.goal(block))
        if has is None:
            raise UnfairError(f"picture {label} shows block {block.order} hardly moved")
        x, y, z = (b - a for a, b in zip(before.position_m, block.position_m, strict=True))
        if has and _LEVEL_M < abs(z) < _DOWN_M:
            raise UnfairError(f"picture {label} shows a block hardly lower than before")
        moved += [block.order] if has else []
        down += [block.order] if has and -z >= _DOWN_M else []
        along += [block.order] if x * push.direction[0] + y * push.direction[1] > _ALONG_M else []
    gone = set(goal) - {block.order for block in picture.blocks}
    return tuple(map(frozenset, (gone, moved, down, along)))
