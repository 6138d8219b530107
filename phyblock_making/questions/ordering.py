"""OR: four stages of one structure, to be put in the order of building, or of taking apart."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.sim.outcomes import OUTCOME_SETTINGS, after
from phyblock_making.questions.choices import pick
from phyblock_making.questions.goal_view import GOAL_VIEW
from phyblock_making.questions.pictured_drafts import (
    are_alike,
    are_told_apart,
    draft,
    of_kind,
    option_pictures,
    state,
)
from phyblock_making.questions.question_draft import Draft, UnfairError
from phyblock_making.questions.wording import slots_of

__all__ = ["OrderingMaker"]

_STAGES = 4
_MOST_STEP = 4
_ORDERS_TRIED = 4


class OrderingMaker:
    """Kinds: `or-build` and `or-apart`."""

    subtask: Subtask = "OR"
    scenes_tried = 90
    drafts_a_scene = 1

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One draft, of either kind, of a structure of four blocks at the least."""
        if len(scene) < _STAGES:
            return
        for _ in range(_ORDERS_TRIED):
            stages = _stages(scene, rng)
            pictures = [state(scene, stage, GOAL_VIEW) for stage in stages]
            if are_told_apart(pictures) and all(_stands(stage) for stage in stages):
                kind = pick(rng, ("or-build", "or-apart"))
                options = pictures if kind == "or-build" else pictures[::-1]
                numbers = [[block.order for block in stage] for stage in stages]
                yield draft(scene, rng, kind, options, [], kind, facts={"stages": numbers})
                return

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By which blocks each picture shows: every stage holds all of the one before it."""
        slots_of(question)
        options = option_pictures(question)
        order = sorted(range(_STAGES), key=lambda index: len(options[index].blocks))
        for earlier, later in itertools.pairwise(order):
            if not _grows(options[earlier], options[later]):
                raise UnfairError("the stages do not follow from one another in one order")
        for option in options:
            if not _can_be_built(question.scene, option.blocks):
                raise UnfairError("a stage shows a block before what it rests on")
        return tuple(order if of_kind(question) == "or-build" else order[::-1])


def _stages(scene: Scene, rng: np.random.Generator) -> list[tuple[Block, ...]]:
    """Four stages of a random order of building, one to four blocks apart."""
    order = scene.graph.random_order(rng)
    room = len(scene) - _STAGES
    counts = [1 + int(rng.integers(room + 1))]
    for left in range(_STAGES - 2, -1, -1):
        most = min(_MOST_STEP, len(scene) - counts[-1] - left)
        counts.append(counts[-1] + 1 + int(rng.integers(most)))
    return [tuple(scene.blocks[vertex] for vertex in sorted(order[:count])) for count in counts]


def _stands(stage: Sequence[Block]) -> bool:
    outcome = after(stage, settings=OUTCOME_SETTINGS[:2])
    return outcome.is_clear and not outcome.moved


def _grows(earlier: QuestionPicture, later: QuestionPicture) -> bool:
    held = all(any(are_alike(block, other) for other in later.blocks) for block in earlier.blocks)
    return held and len(earlier.blocks) < len(later.blocks)


def _can_be_built(scene: Scene, blocks: Sequence[Block]) -> bool:
    """Whether all blocks are the scene's, and what each rests on is there."""
    goal = {block.order: block for block in scene.blocks}
    there = {block.order for block in blocks}
    return all(
        block.order in goal
        and are_alike(block, goal[block.order])
        and set(goal[block.order].depend) <= there
        for block in blocks
    )
