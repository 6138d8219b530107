"""PD: what can come next in an unfinished assembly, and what follows a slow push.

The next step is right by the AOV graph and by simulation both, and each wrong one by neither: its
block waits for another that is not there yet or is out of place, and it moves when it is let go.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.sim.outcomes import (
    after,
    holds,
)
from phyblock.sim.seeing import seen, shown_pixels
from phyblock.sim.support import bounds_m, drop_height_m
from phyblock_making.questions.choices import shuffled
from phyblock_making.questions.counterfactual import TAKEN, marked_order
from phyblock_making.questions.goal_view import GOAL_VIEW
from phyblock_making.questions.pictured_drafts import (
    are_alike,
    are_told_apart,
    draft,
    of_kind,
    only_index,
    option_pictures,
    picture_of,
    same_blocks,
    state,
)
from phyblock_making.questions.pushes import meant_push, push_drafts, what_happened
from phyblock_making.questions.question_draft import Draft, UnfairError
from phyblock_making.questions.wording import slots_of

__all__ = ["PredictiveMaker"]

_STAGES_TRIED = 3
_WRONG = 3
_SHIFTS_M = (
    *((0.0315, 0.0), (-0.0315, 0.0), (0.0, 0.0315), (0.0, -0.0315), (0.0, 0.0)),
    *((0.0565, 0.0), (-0.0565, 0.0), (0.0, 0.0565), (0.0, -0.0565)),
)
"""6 mm at the least off the grid that edges lie on, so that no weight is just over an edge."""
_SHIFTS_TRIED = 3
_LIFT_M = 0.5
_LEAST_HEIGHT_M = 0.02
_MOST_LEFT = 6
_LEAST_SHOWN = 20


class PredictiveMaker:
    """Kinds: `pd-next` (the next step) and `pd-push` (the settled scene after a push)."""

    subtask: Subtask = "PD"
    scenes_tried = 200
    drafts_a_scene = 2

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One draft of each kind at most."""
        for make in shuffled(rng, (_next, push_drafts)):
            yield from make(scene, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By graph and simulation."""
        slots = slots_of(question)
        shown, options = picture_of(question, "scene"), option_pictures(question)
        if of_kind(question) == "pd-next":
            return only_index([_can_follow(question.scene, shown, one) for one in options])
        if shown.blocks != question.scene.blocks:
            raise UnfairError("the first picture is not of the whole scene")
        push = meant_push(shown, marked_order(shown, TAKEN), slots["direction"])
        outcome = after(question.scene.blocks, push)
        if not outcome.is_clear:
            raise UnfairError("the settings disagree on what follows the push")
        settled = state(question.scene, outcome.settled, shown.view_deg)
        expected = what_happened(question.scene, settled, push)
        return only_index([what_happened(question.scene, one, push) == expected for one in options])


def _next(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """A stage, a block that is ready, and three that do not stay, one in the air at the most."""
    for _ in range(_STAGES_TRIED):
        stage, ready, waiting = _stage(scene, rng)
        base = [block for block in scene.blocks if block.order in stage]
        shown = state(scene, base, GOAL_VIEW)
        right = _first_fit(scene, base, ready, True, [shown]) if ready else []
        if not right or not waiting:
            continue
        misplaced = shuffled(rng, _misplaced(base, (*ready, *waiting), rng))
        before = [shown, *right]
        wrong = _first_fit(scene, base, misplaced, False, before, _WRONG)
        before += wrong
        wrong += _first_fit(scene, base, waiting, False, before, min(1, _WRONG - len(wrong)))
        if len(wrong) == _WRONG:
            facts = {"placed": sorted(stage), "next": right[0].blocks[-1].order}
            yield draft(scene, rng, "pd-next", [*right, *wrong], [shown], "next", facts=facts)
            return


def _misplaced(
    base: Sequence[Block], blocks: Sequence[Block], rng: np.random.Generator
) -> list[Block]:
    """Blocks let down onto the stage where they lean or overhang: shifted, or come too early."""
    misplaced = []
    for block in blocks:
        for dx, dy in shuffled(rng, _SHIFTS_M)[:_SHIFTS_TRIED]:
            x, y, z = block.position_m
            lifted = replace(block, position_m=(round(x + dx, 4), round(y + dy, 4), z + _LIFT_M))
            fall = drop_height_m(lifted, base)
            lowered = (*lifted.position_m[:2], round(z + _LIFT_M - fall, 4))
            if bounds_m(replace(block, position_m=lowered))[0, 2] > _LEAST_HEIGHT_M:
                misplaced.append(replace(block, position_m=lowered))
    return misplaced


def _stage(scene: Scene, rng: np.random.Generator) -> tuple[set[int], list[Block], list[Block]]:
    """Orders of the blocks placed, and shuffled, the blocks ready and those that wait."""
    order = scene.graph.random_order(rng)
    least, most = max(1, len(scene) - _MOST_LEFT), len(scene) - 1
    if most < least:
        return set(), [], []
    count = int(rng.integers(least, most + 1))
    placed = sum(1 << vertex for vertex in order[:count])
    ready = scene.graph.ready(placed)
    waiting = [v for v in order[count:] if v not in ready]
    blocks = scene.blocks
    return (
        {blocks[v].order for v in order[:count]},
        shuffled(rng, [blocks[v] for v in ready]),
        shuffled(rng, [blocks[v] for v in waiting]),
    )


def _first_fit(
    scene: Scene,
    base: Sequence[Block],
    added: Sequence[Block],
    stays: bool,
    before: Sequence[QuestionPicture],
    wanted: int = 1,
) -> list[QuestionPicture]:
    """Pictures with one of the blocks added, which stays or does not, all told apart."""
    chosen: list[QuestionPicture] = []
    used: set[int] = set()
    for block in added:
        if len(chosen) == wanted:
            break
        picture = state(scene, (*base, block), GOAL_VIEW)
        if block.order in used:
            continue
        if shown_pixels(picture, seen(picture))[block.order] < _LEAST_SHOWN:
            continue
        if holds(picture.blocks, block.order) is stays and are_told_apart(
            [*before, *chosen, picture]
        ):
            chosen.append(picture)
            used.add(block.order)
    return chosen


def _can_follow(scene: Scene, shown: QuestionPicture, option: QuestionPicture) -> bool:
    """Whether one block was added so that all stays; UnfairError when that is not clear.

    A block that stays must be one that the graph calls ready, at its place; one that the graph
    calls ready must stay at its place.
    """
    placed = {block.order for block in shown.blocks}
    added = [block for block in option.blocks if block.order not in placed]
    kept = [block for block in option.blocks if block.order in placed]
    if len(added) != 1 or not same_blocks(kept, shown.blocks):
        raise UnfairError(f"picture {option.label} does not add one block")
    goal = next((b for b in scene.blocks if b.order == added[0].order), None)
    is_ready = goal is not None and are_alike(goal, added[0]) and set(goal.depend) <= placed
    stays = holds(option.blocks, added[0].order)
    if stays is not is_ready:
        raise UnfairError(f"picture {option.label}: the graph and the simulation disagree")
    return is_ready
