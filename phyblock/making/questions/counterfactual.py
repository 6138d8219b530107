"""CF: what happens to the rest when a block is taken away, by simulation.

The block is marked in the picture, so that no word of the question hints at the answer. Most
questions break the naive rule that what rests on a block falls with it and nothing else: supports
that are one too many, and weights that hold what they stand on. Nor is it enough to ask what rests
on nothing else: a plank may need each of two supports.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from phyblock.domain.blocks import Color
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.base import (
    COUNTED,
    LEAST_PIXELS,
    NAMED,
    TAKEN,
    WORDS,
    Draft,
    Maker,
    Slots,
    UnfairError,
    are_seen,
    are_told_apart,
    center_m,
    draft,
    drawn_view,
    four_alike,
    marked_order,
    of_kind,
    only_index,
    option_pictures,
    orders_of,
    pick,
    picture_of,
    require_seen,
    right_first,
    shares,
    shuffled,
    slots_of,
)
from phyblock.making.questions.structures import group_of, is_sure, with_annex
from phyblock.sim.balance import is_balanced, surely_stands
from phyblock.sim.contact import support_graph
from phyblock.sim.outcomes import Outcome, after_removal
from phyblock.sim.pictures import Shot
from phyblock.sim.question_pictures import block_mark, seen

Lot = frozenset[int]
"""Orders of blocks that move."""
OUTCOME_TEXTS: tuple[str, ...] = tuple(WORDS["outcomes_of_removal"])
"""Outcomes of a removal, by the number of other blocks that do not stay; all are offered."""
_ALL_SEEN = 0.12
_STRUCTURES_TRIED, _VIEWS_TRIED, _REMOVALS_TRIED = 6, 3, 6
_Sort = tuple[bool, bool]
_SORTS: tuple[_Sort, ...] = ((False, False), (False, True), (True, False), (True, True))
"""True where what rests on the block goes with it, and where what rests on nothing else does."""
_SHARES = (0.35, 0.25, 0.25, 0.15)
"""Shares of removals of each sort that are looked for: each rule is right in four cases of ten."""
_STAYS_ASKED = 0.25
_COLORED = 0.5
_MOST_POOL, _MOST_TOGETHER = 40, 3
_AREA, _ROW = 0, 2
"""Places of two of the measures of `_looks`."""
_COLORS: tuple[tuple[Color, Color, Color], ...] = (
    ("red", "yellow", "blue"),
    ("orange", "blue", "green"),
    ("yellow", "blue", "red"),
    ("blue", "orange", "green"),
    ("green", "orange", "blue"),
    ("red", "blue", "yellow"),
)
"""The colors of what moves, of what stays, and of the block that is taken away."""


class _Case(NamedTuple):
    """A removal: what is shown, the block that goes, and whether anything falls.

    `resting` are the blocks that rest on it, directly or not, `only` those that rest on nothing
    else. Whether anything falls is what statics alone say; a simulation decides.
    """

    blocks: tuple[Block, ...]
    order: int
    resting: Lot
    only: Lot
    falls: bool

    @property
    def sort(self) -> _Sort:
        """True or False for each rule: all that rests on the block goes with it; or on it alone."""
        return (bool(self.resting) is self.falls, bool(self.only) is self.falls)


class CounterfactualMaker(Maker):
    """Kinds: `cf-count` (texts) and `cf-color` (what moves, by colors)."""

    subtask: Subtask = "CF"

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
        outcome = _sure_removal(shown.blocks, order)
        if outcome is None:
            raise UnfairError(f"it is not sure what follows without block {order}")
        require_seen(shown, (order,), NAMED)
        if kind == "cf-count":
            right = _outcome_text(outcome)
            return only_index([option == right for option in question.options])
        told = [_colored_orders(one, shown, order, slots) for one in option_pictures(question)]
        return only_index([one == set(outcome.moved) for one in told])


def _outcome_text(outcome: Outcome) -> str:
    return OUTCOME_TEXTS[min(len(outcome.moved), len(OUTCOME_TEXTS) - 1)]


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
        orders = orders_of(case.blocks)
        if mark and are_seen(plain, (case.order,), NAMED) and are_seen(plain, orders, _ALL_SEEN):
            break
    else:
        return
    outcome = _sure_removal(case.blocks, case.order)
    if outcome is None:
        return
    moved = frozenset(outcome.moved)
    if case.sort != (moved == case.resting, moved == case.only):
        return
    # That none moves is found more often than it is asked.
    is_rare = not moved and rng.random() > _STAYS_ASKED
    if is_rare or not are_seen(plain, moved, COUNTED):
        return
    facts: dict[str, Any] = {
        "removed": case.order,
        "moved": list(outcome.moved),
        "resting": sorted(case.resting),
    }
    shown = [replace(plain, marks=(mark,))]
    if is_colored:
        options, slots, value = _colored_options(plain, case.order, moved, rng)
        if options:
            yield draft(scene, rng, "cf-color", options, shown, slots, value=value, **facts)
        return
    right, *others = right_first(_outcome_text(outcome), OUTCOME_TEXTS)
    texts = [right, *shuffled(rng, others)]
    yield draft(scene, rng, "cf-count", texts, shown, {}, **facts)


def _colored_options(
    plain: QuestionPicture, taken: int, moved: Lot, rng: np.random.Generator
) -> tuple[list[QuestionPicture], Slots, str]:
    """Four pictures, the right one first, and the slots of the text; none where they are too few.

    The last tells if the right one has more colored than most, and lower. `plain` has no marks;
    `moved` are the orders of the blocks that move when `taken` is gone.
    """
    lots = [moved, *_other_lots(plain, taken, moved, rng)]
    shot = seen(plain)
    counts = np.bincount(shot.block[shot.block >= 0], minlength=len(plain.blocks))
    pixels = dict(zip(orders_of(plain.blocks), counts, strict=True))
    unlike = np.array([[sum(pixels[o] for o in a ^ b) for b in lots] for a in lots], dtype=float)
    measures = np.array([_looks(plain, shot, taken, lot) for lot in lots])
    four = four_alike(measures, unlike >= LEAST_PIXELS, rng, unlike=unlike)
    colors = pick(rng, _COLORS)

    def colored(lot: Lot) -> QuestionPicture:
        color = {b.order: colors[b.order not in lot] for b in plain.blocks} | {taken: colors[2]}
        return replace(plain, blocks=tuple(replace(b, color=color[b.order]) for b in plain.blocks))

    options = [colored(lots[place]) for place in four.chosen]
    if not options or not are_told_apart(options):
        return [], {}, ""
    slots = dict(zip(("color", "other", "taken"), colors, strict=True))
    return options, slots, four.halves(_AREA, _ROW)


def _colored_orders(
    picture: QuestionPicture, shown: QuestionPicture, taken: int, slots: Slots
) -> Lot:
    """Orders of the blocks that a picture says move; UnfairError when it says something else."""
    start, same = (
        {block.order: replace(block, color="red") for block in one.blocks}
        for one in (shown, picture)
    )
    color_of = {block.order: block.color for block in picture.blocks}
    rest = {color for order, color in color_of.items() if order != taken}
    if start != same or color_of.get(taken) != slots["taken"]:
        raise UnfairError(f"picture {picture.label} does not show the same structure")
    if not rest <= {slots["color"], slots["other"]}:
        raise UnfairError(f"picture {picture.label} shows other colors than the text names")
    return frozenset(order for order, color in color_of.items() if color == slots["color"])


def _other_lots(
    plain: QuestionPicture, taken: int, moved: Lot, rng: np.random.Generator
) -> list[Lot]:
    """Lots that could move together and do not: some blocks, with all that rests on them."""
    share = shares(plain)
    left = [block for block in plain.blocks if block.order != taken]
    single = [frozenset({b.order}) | resting_on(left, b.order) for b in left]
    found = {frozenset[int]()}
    for number in range(1, _MOST_TOGETHER + 1):
        found |= {frozenset().union(*some) for some in itertools.combinations(single, number)}
        if len(found) > _MOST_POOL:
            break
    fair = [lot for lot in found if lot != moved and all(share[o] >= COUNTED for o in lot)]
    return shuffled(rng, sorted(fair, key=sorted))[:_MOST_POOL]


def _looks(plain: QuestionPicture, shot: Shot, taken: int, lot: Lot) -> tuple[float, ...]:
    """Area, place, height and distance from the block taken of what is colored, and its naivety.

    A lot of no blocks is where the block is that is taken.
    """
    block_of = {block.order: block for block in plain.blocks}
    about = sorted(lot or {taken})
    shown = np.isin(shot.block, [i for i, b in enumerate(plain.blocks) if b.order in about])
    rows, columns = np.nonzero(shown)
    side = len(shot.block)
    middle = center_m(block_of[taken])
    far_m = [float(np.linalg.norm(center_m(block_of[o]) - middle)) for o in about]
    low = min(float(center_m(block_of[o])[2]) for o in about)
    area = len(rows) if lot else 0
    return (
        20 * area / max(int((shot.block >= 0).sum()), 1),
        float(len(lot)),
        20 * float(rows.mean()) / side,
        20 * float(columns.mean()) / side,
        20 * float(rows.min()) / side,
        20 * float(rows.max()) / side,
        10 * low,
        10 * min(far_m),
        10 * float(np.mean(far_m)),
        float(len(lot ^ resting_on(plain.blocks, taken))),
        float(len(lot ^ resting_on(plain.blocks, taken, only=True))),
    )


def resting_on(blocks: Sequence[Block], order: int, *, only: bool = False) -> Lot:
    """Orders of the blocks that rest on one, directly or not; not its own.

    With `only` they rest on nothing but it and others that do. The naive rule says that these, or
    those, fall when it is taken away, and nothing else.
    """
    below = _below(tuple(blocks))
    found: Lot = frozenset({order})
    for _ in blocks:
        found |= {
            one for one, under in below.items() if under & found and (not only or under <= found)
        }
    return found - {order}


@functools.lru_cache(maxsize=64)
def _below(blocks: tuple[Block, ...]) -> Mapping[int, Lot]:
    """The support graph, which is asked again for every block of a structure."""
    return support_graph(blocks)


def _sure_removal(blocks: Sequence[Block], order: int) -> Outcome | None:
    """The sure outcome of a removal; None where settings or statics leave a doubt."""
    group = group_of(blocks, order)
    if not surely_stands(group):
        return None
    outcome = after_removal(blocks, order)
    near = [block for block in group if block.order != order]
    is_near = set(outcome.moved) <= {block.order for block in near}
    return outcome if outcome.is_clear and is_near and is_sure(near, outcome.moved) else None
