"""PD, next steps: one more block on an unfinished structure, of which only one lot stays.

All four pictures add the same block, let down where it first touches: here its weight is borne,
there it is not. Right and wrong places are drawn alike, all over the structure.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.alike import AREA, alike_wrong
from phyblock.making.questions.annexes import with_annex
from phyblock.making.questions.choices import pick, shuffled
from phyblock.making.questions.margins import group_of
from phyblock.making.questions.picture_view import COUNTED, View, are_seen, drawn_view
from phyblock.making.questions.pictured_drafts import draft, same_blocks, with_room
from phyblock.making.questions.placing import lowered, stays_round, verdict
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.sim.balance import is_balanced, surely_stands
from phyblock.sim.seeing import seen, shown_pixels
from phyblock.sim.steps import groups
from phyblock.sim.support import bounds_m

__all__ = ["can_follow", "next_drafts"]

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
