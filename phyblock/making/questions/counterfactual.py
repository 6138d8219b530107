"""CF: what happens to the rest when a block is taken away, by simulation.

The block is marked in the picture, so that no word of the question hints at the answer. Most
questions break the naive rule that what rests on a block falls with it and nothing else: supports
that are one too many, and weights that hold what they stand on. Nor is it enough to ask what rests
on nothing else: a plank may need each of two supports.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.annexes import with_annex
from phyblock.making.questions.choices import shuffled
from phyblock.making.questions.colored_outcomes import colored_options, colored_orders
from phyblock.making.questions.margins import group_of, resting_on, sure_removal
from phyblock.making.questions.marked_blocks import TAKEN, marked_order
from phyblock.making.questions.picture_view import (
    COUNTED,
    NAMED,
    are_seen,
    drawn_view,
    require_seen,
)
from phyblock.making.questions.pictured_drafts import (
    draft,
    of_kind,
    only_index,
    option_pictures,
    picture_of,
)
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.wording import slots_of
from phyblock.sim.balance import is_balanced
from phyblock.sim.seeing import block_mark, seen

__all__ = ["OUTCOME_TEXTS", "CounterfactualMaker"]

OUTCOME_TEXTS = (
    "No other block moves or falls.",
    "Exactly one other block moves or falls.",
    "Exactly two other blocks move or fall.",
    "Three or more other blocks move or fall.",
)
"""What can follow a removal, by how many other blocks do not stay; always all offered."""
_ALL_SEEN = 0.12
_STRUCTURES_TRIED = 6
_VIEWS_TRIED = 3
_REMOVALS_TRIED = 6
_Sort = tuple[bool, bool]
_SORTS: tuple[_Sort, ...] = ((False, False), (False, True), (True, False), (True, True))
"""Whether it holds that what rests on the block goes with it, or what rests on nothing else."""
_SHARES = (0.35, 0.25, 0.25, 0.15)
"""How often removals of each sort are looked for: each rule is right in four cases of ten."""
_STAYS_ASKED = 0.25
_COLORED = 0.5


class _Case(NamedTuple):
    """A removal: what is shown, which block goes, and whether anything falls.

    `resting` are the blocks that rest on it, directly or not, `only` those that rest on nothing
    else. Whether anything falls is what statics alone say; a simulation decides.
    """

    blocks: tuple[Block, ...]
    order: int
    resting: frozenset[int]
    only: frozenset[int]
    falls: bool

    @property
    def sort(self) -> _Sort:
        """Whether what rests on the block goes with it, and what rests on it alone."""
        return (bool(self.resting) is self.falls, bool(self.only) is self.falls)

    def is_as_expected(self, moved: Collection[int]) -> bool:
        """Whether both rules hold, or fail, as they were thought to."""
        return self.sort == (set(moved) == self.resting, set(moved) == self.only)


class CounterfactualMaker:
    """Kinds: `cf-count` (texts) and `cf-color` (what moves, by colors)."""

    subtask: Subtask = "CF"
    scenes_tried = 400
    drafts_a_scene = 1

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Drafts about removals from the scene, or from a part of it with an annex."""
        sort = _SORTS[int(rng.choice(len(_SORTS), p=_SHARES))]
        is_colored = bool(rng.random() < _COLORED)
        for number in range(_STRUCTURES_TRIED):
            blocks = scene.blocks if number == 0 else with_annex(scene, rng)
            for case in _cases(scene, blocks, sort, rng) if blocks else ():
                yield from _drafts_of(scene, case, is_colored, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By simulating the removal again."""
        slots = slots_of(question)
        kind, shown = of_kind(question), picture_of(question, "scene")
        order = marked_order(shown, TAKEN)
        outcome = sure_removal(shown.blocks, order)
        if outcome is None:
            raise UnfairError(f"it is not sure what follows without block {order}")
        require_seen(shown, (order,), NAMED)
        if kind == "cf-count":
            right = OUTCOME_TEXTS[min(len(outcome.moved), len(OUTCOME_TEXTS) - 1)]
            return only_index([option == right for option in question.options])
        options = option_pictures(question)
        told = [colored_orders(option, shown, order, slots) for option in options]
        return only_index([one == set(outcome.moved) for one in told])


def _cases(
    scene: Scene, blocks: tuple[Block, ...], sort: _Sort, rng: np.random.Generator
) -> Iterator[_Case]:
    """Removals of the sort wanted, as far as statics tell; from an annex where there is one."""
    known = {block.order for block in scene.blocks}
    added = [block for block in blocks if block.order not in known]
    for block in shuffled(rng, added or blocks)[:_REMOVALS_TRIED]:
        group = group_of(blocks, block.order)
        left = [one for one in group if one.order != block.order]
        resting = resting_on(group, block.order)
        only = resting_on(group, block.order, only=True)
        case = _Case(blocks, block.order, resting, only, not is_balanced(left))
        if left and case.sort == sort:
            yield case


def _drafts_of(
    scene: Scene, case: _Case, is_colored: bool, rng: np.random.Generator
) -> Iterator[Draft]:
    """At most one draft about a removal: who moves, by colors, or how many."""
    for _ in range(_VIEWS_TRIED):
        plain = QuestionPicture("scene", case.blocks, drawn_view(rng))
        mark = block_mark(plain, seen(plain), case.order, TAKEN)
        orders = [block.order for block in case.blocks]
        if mark and are_seen(plain, (case.order,), NAMED) and are_seen(plain, orders, _ALL_SEEN):
            break
    else:
        return
    outcome = sure_removal(case.blocks, case.order)
    if outcome is None or not case.is_as_expected(outcome.moved):
        return
    # That none moves is found more often than it is asked.
    is_rare = not outcome.moved and rng.random() > _STAYS_ASKED
    if is_rare or not are_seen(plain, outcome.moved, COUNTED):
        return
    facts = {
        "removed": case.order,
        "moved": list(outcome.moved),
        "resting": sorted(case.resting),
    }
    shown = [replace(plain, marks=(mark,))]
    if is_colored:
        colored, slots, value = colored_options(plain, case.order, outcome.moved, rng)
        if colored:
            yield draft(scene, rng, "cf-color", colored, shown, value, slots, facts)
        return
    number = min(len(outcome.moved), len(OUTCOME_TEXTS) - 1)
    others = [text for text in OUTCOME_TEXTS if text != OUTCOME_TEXTS[number]]
    options = [OUTCOME_TEXTS[number], *shuffled(rng, others)]
    yield draft(scene, rng, "cf-count", options, shown, str(number), {}, facts)
