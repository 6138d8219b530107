"""CF: what happens to the rest when a block is taken away, by simulation.

The block is marked in the picture, so that no word of the question hints at the answer. Most
questions break the naive rule that what rests on a block falls with it and nothing else: supports
that are one too many, and weights that hold what they stand on. Nor is it enough to ask what rests
on nothing else: a plank may need each of two supports.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from phyblock.domain.question import LETTERS, Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.sim.balance import is_balanced, surely_stands
from phyblock.sim.outcomes import Outcome, after_removal
from phyblock.sim.seeing import Top, block_mark, is_apart, is_inside, seen, seen_order, visible_tops
from phyblock_making.questions.alike import AREA, CHANGE, alike_wrong, ranked_as_drawn
from phyblock_making.questions.annexes import with_annex
from phyblock_making.questions.choices import shuffled
from phyblock_making.questions.margins import group_of, is_sure, resting_on
from phyblock_making.questions.picture_view import (
    COUNTED,
    NAMED,
    are_seen,
    drawn_view,
    require_seen,
)
from phyblock_making.questions.pictured_drafts import (
    draft,
    of_kind,
    only_index,
    option_pictures,
    picture_of,
    story_of,
    with_room,
)
from phyblock_making.questions.question_draft import Draft, Option, UnfairError
from phyblock_making.questions.resting_states import states_at_rest
from phyblock_making.questions.wording import slots_of

__all__ = ["OUTCOME_TEXTS", "TAKEN", "CounterfactualMaker", "marked_order"]

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
_STRUCTURES_TRIED = 6
_VIEWS_TRIED = 3
_REMOVALS_TRIED = 6
_Sort = tuple[bool, bool]
_SORTS: tuple[_Sort, ...] = ((False, False), (False, True), (True, False), (True, True))
"""Whether it holds that what rests on the block goes with it, or what rests on nothing else."""
_SHARES = (0.35, 0.25, 0.25, 0.15)
"""How often removals of each sort are looked for: each rule is right in four cases of ten."""
_WRONG = 3
_STAYS_ASKED = 0.25
_STEP_PX = 6
_SPOTS_OF_A_BLOCK, _MOST_STAYING, _RIGHTS_TRIED = 2, 12, 4
_LEVEL_RISE = 0.99


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
    """Kinds: `cf-count` (texts), `cf-which` (marked blocks), `cf-picture` (settled scenes)."""

    subtask: Subtask = "CF"
    scenes_tried = 400
    drafts_a_scene = 1

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Drafts about removals from the scene, or from a part of it with an annex."""
        sort = _SORTS[int(rng.choice(len(_SORTS), p=_SHARES))]
        # Nearly every removal can be counted, few can be pictured or marked: those come first.
        kinds = [*shuffled(rng, (_which, _pictured)), _count]
        for number in range(_STRUCTURES_TRIED):
            blocks = scene.blocks if number == 0 else with_annex(scene, rng)
            for case in _cases(scene, blocks, sort, rng) if blocks else ():
                yield from _drafts_of(scene, case, kinds, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By simulating the removal again."""
        slots_of(question)
        kind, shown = of_kind(question), picture_of(question, "scene")
        order = marked_order(shown, TAKEN)
        outcome = _outcome(shown.blocks, order)
        if outcome is None:
            raise UnfairError(f"it is not sure what follows without block {order}")
        require_seen(shown, (order,), NAMED)
        if kind == "cf-count":
            right = OUTCOME_TEXTS[min(len(outcome.moved), 3)]
            return only_index([option == right for option in question.options])
        if kind == "cf-which":
            marked = [marked_order(shown, letter) for letter in LETTERS]
            return only_index([one in outcome.moved for one in marked])
        settled = replace(shown, blocks=outcome.settled)
        expected = story_of(shown.blocks, settled)
        options = option_pictures(question)
        return only_index([story_of(shown.blocks, one) == expected for one in options])


def marked_order(picture: QuestionPicture, letter: str) -> int:
    """Order of the block that shows at a mark; UnfairError when there is none."""
    for mark in picture.marks:
        if mark.letter == letter:
            order = seen_order(picture, seen(replace(picture, marks=())), mark.position_m)
            if order is not None:
                return order
    raise UnfairError(f"no block is marked {letter}")


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


def _outcome(blocks: Sequence[Block], order: int) -> Outcome | None:
    """What surely follows a removal; None where settings or statics leave a doubt."""
    group = group_of(blocks, order)
    if not surely_stands(group):
        return None
    outcome = after_removal(blocks, order)
    near = [block for block in group if block.order != order]
    is_near = set(outcome.moved) <= {block.order for block in near}
    return outcome if outcome.is_clear and is_near and is_sure(near, outcome.moved) else None


def _drafts_of(
    scene: Scene, case: _Case, kinds: Sequence[_Kind], rng: np.random.Generator
) -> Iterator[Draft]:
    """At most one draft about a removal, of the first kind that fits."""
    for _ in range(_VIEWS_TRIED):
        plain = QuestionPicture("scene", case.blocks, drawn_view(rng))
        mark = block_mark(plain, seen(plain), case.order, TAKEN)
        orders = [block.order for block in case.blocks]
        if mark and are_seen(plain, (case.order,), NAMED) and are_seen(plain, orders, _ALL_SEEN):
            break
    else:
        return
    outcome = _outcome(case.blocks, case.order)
    if outcome is None or not case.is_as_expected(outcome.moved):
        return
    facts = {
        "removed": case.order,
        "moved": list(outcome.moved),
        "resting": sorted(case.resting),
    }
    for kind in kinds:
        asked = kind(plain, case.order, outcome, rng)
        if asked:
            shown = replace(asked.about, marks=(mark,))
            yield draft(scene, rng, asked.kind, asked.options, [shown], asked.value, {}, facts)
            return


class _Asked(NamedTuple):
    """A kind of question, the picture that it is about, before any mark, options and value."""

    kind: str
    about: QuestionPicture
    options: Sequence[Option]
    value: str


_Kind = Callable[[QuestionPicture, int, Outcome, np.random.Generator], _Asked | None]


def _count(
    plain: QuestionPicture, _: int, outcome: Outcome, rng: np.random.Generator
) -> _Asked | None:
    """How many others do not stay; that none moves is asked less often than it is found."""
    is_rare = not outcome.moved and rng.random() > _STAYS_ASKED
    if is_rare or not are_seen(plain, outcome.moved, COUNTED):
        return None
    number = min(len(outcome.moved), 3)
    others = [text for text in OUTCOME_TEXTS if text != OUTCOME_TEXTS[number]]
    return _Asked("cf-count", plain, [OUTCOME_TEXTS[number], *shuffled(rng, others)], str(number))


def _which(
    plain: QuestionPicture, order: int, outcome: Outcome, rng: np.random.Generator
) -> _Asked | None:
    """One of four marked blocks that does not stay, its mark no more central than the others."""
    taken = block_mark(plain, seen(plain), order, TAKEN)
    if not outcome.moved or taken is None:
        return None
    spots = _spots(plain, taken, rng)
    staying = [spot for spot in spots if spot[0] != order and spot[0] not in outcome.moved]
    resting = resting_on(plain.blocks, order)
    central = int(rng.integers(_WRONG + 1))
    for right in [spot for spot in spots if spot[0] in outcome.moved][:_RIGHTS_TRIED]:
        together = [right, *staying[:_MOST_STAYING]]
        marks = [Mark("A", top.position_m) for _, top in together]
        apart = np.array([[is_apart(plain, a, [b]) for b in marks] for a in marks])
        orders = np.array([one for one, _ in together])
        apart &= orders[:, None] != orders
        measures = [[*_mark_looks(top, taken), one in resting] for one, top in together]
        wrong = ranked_as_drawn(np.array(measures, dtype=float), apart, rng, {0: central})
        if wrong:
            return _Asked("cf-which", plain, [marks[i] for i in (0, *wrong)], "place")
    return None


def _spots(plain: QuestionPicture, taken: Mark, rng: np.random.Generator) -> list[tuple[int, Top]]:
    """Places for marks in an order drawn, a few on each block, none near the mark X."""
    shot = seen(plain)
    found: list[tuple[int, Top]] = []
    number: Counter[int] = Counter()
    for top in shuffled(rng, visible_tops(plain, shot, _STEP_PX, -1.0)):
        order = seen_order(plain, shot, top.position_m)
        is_free = order is not None and number[order] < _SPOTS_OF_A_BLOCK
        if order is not None and is_free and is_apart(plain, Mark("A", top.position_m), [taken]):
            number[order] += 1
            found.append((order, top))
    return found


def _mark_looks(top: Top, taken: Mark) -> tuple[float, ...]:
    """How central a mark is, those on level faces first; and how far it is from the mark X."""
    is_level = top.rise >= _LEVEL_RISE
    far_m = math.dist(top.position_m, taken.position_m)
    return 20 * (top.off_center_m + (not is_level)), 20 * top.off_center_m, 3 * far_m


def _pictured(
    plain: QuestionPicture, order: int, outcome: Outcome, rng: np.random.Generator
) -> _Asked | None:
    """The settled scene among others at rest, all of which lack the block.

    As nothing changed less than a scene in which nothing moved, that is right in one of four.
    """
    if not outcome.moved and rng.random() > _STAYS_ASKED:
        return None
    roomy = replace(plain, framed=with_room(plain.blocks))
    right = replace(roomy, blocks=outcome.settled)
    change = int(rng.integers(1, _WRONG + 1)) if outcome.moved else 0
    ranks = {CHANGE: change, AREA: int(rng.integers(_WRONG + 1))}
    pool: list[QuestionPicture] = []
    try:
        known = {story_of(plain.blocks, right)}
    except UnfairError:
        return None
    for blocks in states_at_rest(plain.blocks, order, outcome, rng):
        picture = replace(right, blocks=blocks)
        try:
            story = story_of(plain.blocks, picture)
        except UnfairError:
            continue
        if story not in known and is_inside(picture):
            known.add(story)
            pool.append(picture)
    wrong = alike_wrong(roomy, right, pool, rng, ranks) if len(pool) >= _WRONG else []
    return _Asked("cf-picture", roomy, [right, *wrong], f"change {change}") if wrong else None
