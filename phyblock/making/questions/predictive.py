"""PD, next steps: one more block on an unfinished structure, of which only one lot stays.

All four pictures add the same block, let down where it first touches: here its weight is borne,
there it is not. Right and wrong places are drawn alike, all over the structure.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.affordance import lowered, stays_round, verdict
from phyblock.making.questions.annexes import with_annex
from phyblock.making.questions.counterfactual import group_of, is_sure
from phyblock.making.questions.picture_view import COUNTED, View, are_seen, drawn_view
from phyblock.making.questions.pictured_drafts import (
    AREA,
    alike_wrong,
    are_told_apart,
    draft,
    of_kind,
    only_index,
    option_pictures,
    picture_of,
    same_blocks,
    state,
    story_of,
    with_room,
)
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.referring import TAKEN, marked_order
from phyblock.making.questions.selection import pick, shuffled
from phyblock.making.questions.wording import slots_of
from phyblock.sim.balance import is_balanced, surely_stands
from phyblock.sim.camera import view_axes
from phyblock.sim.contact import bounds_m, boxes_near
from phyblock.sim.dynamics import groups
from phyblock.sim.outcomes import OUTCOME_SETTINGS, Outcome, Push, after
from phyblock.sim.question_pictures import block_mark, seen, shown_pixels
from phyblock.stable import plain_sum

_STAGES_TRIED = 3
_ANNEXED = 0.5
_MOST_LEFT = 6
_PLACES_TRIED = 60
_STEP_M, _MOST_STEPS = 0.0125, 6
_LEAST_HEIGHT_M = 0.02
_LEAST_SHOWN = 250
_ELEVATIONS_DEG = (34, 48)
RINGS_M = (0.0025, 0.005, 0.01)
"""The verdict on a next step holds all round it, this far off [m]."""
_ABOVE_M = 0.03
_ENOUGH, _MOST_OF_A_SORT = 4, 8
_RIGHTS_TRIED = 6
_AREA_RANKS = (0.1, 0.2, 0.3, 0.4)
"""How often each rank of the right picture by colored area is looked for.

A block that stays hides more of what it stands on, so that the last rank is the hardest to find;
what is found is evened out when questions are chosen.
"""


def next_drafts(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """At most one draft: a stage of building, a block to come, one place where it stays."""
    for _ in range(_STAGES_TRIED):
        stage, block = _stage(scene, rng)
        if not stage:
            return
        framed = with_room(stage, _ABOVE_M)
        shown = QuestionPicture("scene", stage, _view(rng), framed=framed)
        staying, falling = _places(shown, block, rng)
        if len(falling) < _ENOUGH:
            continue
        rank = int(rng.choice(len(_AREA_RANKS), p=_AREA_RANKS))
        for right in staying[:_RIGHTS_TRIED]:
            wrong = alike_wrong(shown, right, falling, rng, {AREA: rank})
            if not all(are_seen(one, (block.order,), COUNTED) for one in (right, *wrong)):
                continue
            options = [right, *wrong]
            if wrong and _are_sure(stage, options):
                facts = {"placed": [one.order for one in stage], "next": block.order}
                yield draft(scene, rng, "pd-next", options, [shown], f"area {rank}", facts=facts)
                return


def can_follow(shown: QuestionPicture, option: QuestionPicture) -> bool:
    """Whether one block was added so that all stays; UnfairError when that is not sure."""
    placed = {block.order for block in shown.blocks}
    added = [block for block in option.blocks if block.order not in placed]
    kept = [block for block in option.blocks if block.order in placed]
    if len(added) != 1 or not same_blocks(kept, shown.blocks):
        raise UnfairError(f"picture {option.label} does not add one block")
    stays = _stays(kept, added[0])
    if stays is None:
        raise UnfairError(f"it is not sure whether all stays in picture {option.label}")
    return stays


def _stage(scene: Scene, rng: np.random.Generator) -> tuple[tuple[Block, ...], Block]:
    """The blocks placed so far, none where there are too few, and one more of the scene's.

    Half of the stages have an annex, whose planks tip where a block is put on them wrongly.
    """
    order = scene.graph.random_order(rng)
    annexed = with_annex(scene, rng) if rng.random() < _ANNEXED else None
    if annexed and all(map(surely_stands, groups(annexed))):
        number = max(block.order for block in annexed) + 1
        return annexed, replace(pick(rng, scene.blocks), order=number)
    least, most = max(1, len(scene) - _MOST_LEFT), len(scene) - 1
    if most < least:
        return (), scene.blocks[0]
    count = int(rng.integers(least, most + 1))
    stage = tuple(scene.blocks[vertex] for vertex in sorted(order[:count]))
    return stage, scene.blocks[pick(rng, order[count:])]


def _places(
    shown: QuestionPicture, block: Block, rng: np.random.Generator
) -> tuple[list[QuestionPicture], list[QuestionPicture]]:
    """Pictures of the block let down here and there: where it stays by statics, and where not."""
    found: dict[bool, list[QuestionPicture]] = {True: [], False: []}
    for _ in range(_PLACES_TRIED):
        under = bounds_m(pick(rng, shown.blocks)).mean(axis=0)
        x, y = (
            float(place) + _STEP_M * int(rng.integers(-_MOST_STEPS, _MOST_STEPS + 1))
            for place in under[:2]
        )
        put = lowered(block, shown.blocks, x, y)
        if bounds_m(put)[0, 2] < _LEAST_HEIGHT_M:
            continue
        picture = replace(shown, blocks=(*shown.blocks, put))
        likely = is_balanced(group_of(picture.blocks, put.order))
        if len(found[likely]) == _MOST_OF_A_SORT:
            continue
        stays = stays_round(put, shown.blocks, RINGS_M[-1:])
        if stays is None:
            continue
        if shown_pixels(picture, seen(picture))[put.order] >= _LEAST_SHOWN:
            found[stays].append(picture)
        if all(len(sort) >= _MOST_OF_A_SORT // 2 for sort in found.values()):
            break
    return shuffled(rng, found[True]), found[False]


def _view(rng: np.random.Generator) -> View:
    """A view from high enough to tell what lies behind from what lies above."""
    low, high = _ELEVATIONS_DEG
    return (drawn_view(rng)[0], float(rng.integers(low, high + 1)))


def _are_sure(stage: Sequence[Block], options: Sequence[QuestionPicture]) -> bool:
    """Whether, by simulation too, the first stays and the others do not."""
    return all(_stays(stage, one.blocks[-1]) is (i == 0) for i, one in enumerate(options))


def _stays(stage: Sequence[Block], put: Block) -> bool | None:
    """Whether a block put down stays, by simulation too, and likewise up to 1 cm off; or None."""
    stays = stays_round(put, stage, RINGS_M)
    return stays if verdict((*stage, put), put.order) is stays else None


_BLOCKS_TRIED = 3
_PUSHES_TRIED = 9
_OPTIONS = 4
_FRONTS_DEG = (0.0, 90.0, 180.0, 270.0)
_ELEVATIONS_DEG_PUSHES = (20, 32)
_DIRECTIONS = {"to the right": 1, "to the left": -1}
_LEAST_SHOWN_PUSHES = 60
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
    low, high = _ELEVATIONS_DEG_PUSHES
    for front_deg in shuffled(rng, _FRONTS_DEG):
        view = (front_deg, float(rng.integers(low, high + 1)))
        plain = replace(state(scene, scene.blocks, view), framed=with_room(scene.blocks))
        if min(shown_pixels(plain, seen(plain)).values()) >= _LEAST_SHOWN_PUSHES:
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


_PUSHED = 0.55
"""How often a push is looked for, which fewer scenes allow than a next step."""


class PredictiveMaker:
    """Kinds: `pd-next` (the next step) and `pd-push` (the settled scene after a push)."""

    subtask: Subtask = "PD"
    scenes_tried = 340
    drafts_a_scene = 1

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """A push or a next step, as drawn, where one is fair."""
        make = push_drafts if rng.random() < _PUSHED else next_drafts
        yield from make(scene, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By statics and simulation."""
        slots = slots_of(question)
        shown, options = picture_of(question, "scene"), option_pictures(question)
        if of_kind(question) == "pd-next":
            return only_index([can_follow(shown, one) for one in options])
        before = shown.blocks
        push = meant_push(shown, marked_order(shown, TAKEN), slots["direction"])
        outcome = sure_push(before, push)
        if outcome is None:
            raise UnfairError("it is not sure what follows the push")
        expected = what_happened(before, replace(shown, blocks=outcome.settled), push)
        return only_index([what_happened(before, one, push) == expected for one in options])
