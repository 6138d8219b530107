"""CF: what happens to the rest when a block is taken away, by simulation.

Texts name the block taken away only where the options are pictures; where they are texts or
places it is marked in the picture, so that no word of the question hints at the answer.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from phyblock.domain.question import LETTERS, Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.sim.outcomes import OUTCOME_SETTINGS, Outcome, Push, after, after_removal
from phyblock.sim.seeing import block_mark, is_apart, seen, seen_order
from phyblock_making.questions.choices import pick, shuffled
from phyblock_making.questions.goal_view import COUNTED, GOAL_VIEW, NAMED, are_seen, require_seen
from phyblock_making.questions.pictured_drafts import (
    are_told_apart,
    draft,
    moved_between,
    of_kind,
    only_index,
    option_pictures,
    picture_of,
    state,
)
from phyblock_making.questions.question_draft import Draft, UnfairError
from phyblock_making.questions.referring import names, resolve_one
from phyblock_making.questions.wording import slots_of

__all__ = ["OUTCOME_TEXTS", "CounterfactualMaker", "marked_order"]

OUTCOME_TEXTS = (
    "No other block moves or falls.",
    "Exactly one other block moves or falls.",
    "Exactly two other blocks move or fall.",
    "Three or more other blocks move or fall.",
)
"""What can follow a removal, by how many other blocks do not stay; always all offered."""
TAKEN = "X"
"""The letter of the block that is taken away or pushed."""
_ALL_SEEN = 0.12
_REMOVALS_TRIED = 5
_OTHERS_TRIED = 4
_TOPPLED_M = 0.06


class CounterfactualMaker:
    """Kinds: `cf-count` (texts), `cf-which` (marked blocks), `cf-picture` (settled scenes)."""

    subtask: Subtask = "CF"
    scenes_tried = 170
    drafts_a_scene = 3

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Drafts of all kinds about removals in a scene of which every block can be seen."""
        orders = [block.order for block in scene.blocks]
        plain = state(scene, scene.blocks, GOAL_VIEW)
        if len(scene) < 4 or not are_seen(plain, orders, _ALL_SEEN):
            return
        taken = shuffled(rng, [o for o in orders if are_seen(plain, (o,), NAMED)])
        makers = shuffled(rng, (_count, _which, _pictured))
        for number, order in enumerate(taken[:_REMOVALS_TRIED]):
            outcome = after_removal(scene.blocks, order)
            if outcome.is_clear:
                yield from makers[number % 3](scene, order, outcome, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By simulating the removal again."""
        slots, kind = slots_of(question), of_kind(question)
        shown, scene = picture_of(question, "scene"), question.scene
        if shown.blocks != scene.blocks:
            raise UnfairError("the first picture is not of the whole scene")
        order = _taken(question, slots)
        outcome = after_removal(scene.blocks, order)
        if not outcome.is_clear:
            raise UnfairError(f"the settings disagree on what follows without block {order}")
        require_seen(shown, (order,), NAMED)
        if kind == "cf-count":
            right = OUTCOME_TEXTS[min(len(outcome.moved), 3)]
            return only_index([option == right for option in question.options])
        if kind == "cf-which":
            marked = [marked_order(shown, letter) for letter in LETTERS]
            return only_index([one in outcome.moved for one in marked])
        expected = ((order,), outcome.moved)
        movements = [moved_between(scene, option) for option in option_pictures(question)]
        return only_index([one == expected for one in movements])


def marked_order(picture: QuestionPicture, letter: str) -> int:
    """Order of the block that shows at a mark; UnfairError when there is none."""
    for mark in picture.marks:
        if mark.letter == letter:
            order = seen_order(picture, seen(replace(picture, marks=())), mark.position_m)
            if order is not None:
                return order
    raise UnfairError(f"no block is marked {letter}")


def _taken(question: Question, slots: Mapping[str, str]) -> int:
    if of_kind(question) == "cf-picture":
        return resolve_one(slots["block"], picture_of(question, "scene")).order
    return marked_order(picture_of(question, "scene"), TAKEN)


def _count(scene: Scene, order: int, outcome: Outcome, rng: np.random.Generator) -> Iterator[Draft]:
    """How many others do not stay."""
    moved = outcome.moved
    plain = state(scene, scene.blocks, GOAL_VIEW)
    mark = block_mark(plain, seen(plain), order, TAKEN)
    if mark is None or not are_seen(plain, moved, COUNTED):
        return
    number = min(len(moved), 3)
    others = [text for text in OUTCOME_TEXTS if text != OUTCOME_TEXTS[number]]
    options = [OUTCOME_TEXTS[number], *shuffled(rng, others)]
    shown = replace(plain, marks=(mark,))
    facts = {"removed": order, "moved": list(moved)}
    yield draft(scene, rng, "cf-count", options, [shown], str(number), facts=facts)


def _which(scene: Scene, order: int, outcome: Outcome, rng: np.random.Generator) -> Iterator[Draft]:
    """One of four marked blocks that does not stay."""
    moved = outcome.moved
    plain = state(scene, scene.blocks, GOAL_VIEW)
    shot = seen(plain)
    taken = block_mark(plain, shot, order, TAKEN)
    if taken is None:
        return
    rest = [b.order for b in scene.blocks if b.order != order]
    chosen: list[Mark] = []
    for group, most in ((moved, 1), ([o for o in rest if o not in moved], 4)):
        for one in shuffled(rng, group):
            mark = block_mark(plain, shot, one, "A")
            if mark is not None and len(chosen) < most and is_apart(plain, mark, [taken, *chosen]):
                chosen.append(mark)
        if not chosen:
            return
    if len(chosen) == 4 and are_seen(plain, moved[:1], COUNTED):
        facts = {"removed": order, "moved": list(moved)}
        shown = replace(plain, marks=(taken,))
        yield draft(scene, rng, "cf-which", chosen, [shown], "place", facts=facts)


def _pictured(
    scene: Scene, order: int, outcome: Outcome, rng: np.random.Generator
) -> Iterator[Draft]:
    """The settled scene among others of which some also lack the block."""
    block = next(b for b in scene.blocks if b.order == order)
    plain = state(scene, scene.blocks, GOAL_VIEW)
    expressions = names(block, plain, ("color", "type", "layer", "side"))
    if not expressions:
        return
    right = state(scene, outcome.settled, GOAL_VIEW)
    chosen = [right]
    for wrong in chain(_same_gone(scene, order, outcome, rng), _other_gone(scene, order, rng)):
        tried = [*chosen, state(scene, wrong, GOAL_VIEW)]
        if are_told_apart([plain, *tried]) and _are_clear(scene, tried):
            chosen = tried
        if len(chosen) == 4:
            if not any(_lacks_only(scene, one, order) for one in chosen[1:]):
                return
            facts = {"removed": order, "moved": list(outcome.moved)}
            slots = {"block": pick(rng, expressions[:2])}
            value = "falls" if outcome.moved else "stays"
            yield draft(scene, rng, "cf-picture", chosen, [plain], value, slots, facts)
            return


def _are_clear(scene: Scene, pictures: Sequence[QuestionPicture]) -> bool:
    """Whether each picture tells which blocks are gone or moved, no two of them the same."""
    try:
        movements = [moved_between(scene, picture) for picture in pictures]
    except UnfairError:
        return False
    return len(set(movements)) == len(movements)


def _lacks_only(scene: Scene, picture: QuestionPicture, order: int) -> bool:
    return moved_between(scene, picture)[0] == (order,)


def _same_gone(
    scene: Scene, order: int, outcome: Outcome, rng: np.random.Generator
) -> Iterator[tuple[Block, ...]]:
    """Wrong outcomes without the right block: nothing falls, only a part falls, or too much."""
    rest = tuple(block for block in scene.blocks if block.order != order)
    if not outcome.moved:
        yield from _toppled(rest, rng)
        return
    yield rest
    settled = {block.order: block for block in outcome.settled}
    for top in shuffled(rng, outcome.moved)[:2]:
        yield tuple(b if b.order == top else settled[b.order] for b in rest)


def _toppled(rest: Sequence[Block], rng: np.random.Generator) -> Iterator[tuple[Block, ...]]:
    """The rest after a block that carries nothing was pushed off."""
    carrying = {order for block in rest for order in block.depend}
    tops = [b for b in rest if b.order not in carrying and b.depend]
    for block in shuffled(rng, tops)[:2]:
        direction = pick(rng, ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)))
        push = Push(block.order, direction, _TOPPLED_M)
        outcome = after(rest, push, OUTCOME_SETTINGS[:1])
        if outcome.is_clear and outcome.moved:
            yield outcome.settled


def _other_gone(scene: Scene, order: int, rng: np.random.Generator) -> Iterator[tuple[Block, ...]]:
    """What the removal of other blocks leaves; no answer hangs on it, so one setting will do."""
    others = [block.order for block in scene.blocks if block.order != order]
    for other in shuffled(rng, others)[:_OTHERS_TRIED]:
        outcome = after_removal(scene.blocks, other, OUTCOME_SETTINGS[:1])
        if outcome.is_clear:
            yield outcome.settled
