"""CF: what moves or falls when a block is taken away, by statics and simulation.

The block that goes is marked in the picture, so that no word of the question hints at the answer.
Most questions break the naive rule that what rests on a block falls with it and nothing else:
supports that are one too many, and weights that hold what they stand on. Nor is it enough to ask
what rests on nothing else: a plank may need each of two supports.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import Color
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions import base, sight
from phyblock.making.questions.base import Draft, Maker, UnfairError, draft, pick, shuffled
from phyblock.making.questions.structures import group_of, is_sure, with_annex
from phyblock.sim.balance import is_balanced, surely_stands
from phyblock.sim.contact import support_graph
from phyblock.sim.outcomes import Outcome, after_removal
from phyblock.sim.question_pictures import block_mark, seen, shown_pixels

TAKEN = "X"
"""The letter of the block that is taken away or pushed."""
Lot = frozenset[int]
"""Orders of blocks that move."""
OUTCOME_TEXTS: tuple[str, ...] = tuple(base.WORDS["outcomes_of_removal"])
"""Outcomes of a removal, by the number of other blocks that do not stay; all are offered."""
_ALL_SEEN = 0.12
_STRUCTURES_TRIED, _VIEWS_TRIED, _REMOVALS_TRIED = 6, 3, 6
_SORTS = ((False, False), (False, True), (True, False), (True, True))
"""True where what rests on the block goes with it, and where what rests on nothing else does."""
_SHARES = (0.35, 0.25, 0.25, 0.15)
"""Shares of removals of each sort that are looked for: each rule is right in four cases of ten."""
_STAYS_ASKED = 0.25
"""That none moves is found more often than it is asked."""
_MOST_LOTS, _MOST_TOGETHER = 40, 3
_COLORS: tuple[tuple[Color, Color, Color], ...] = (
    ("red", "yellow", "blue"),
    ("orange", "blue", "green"),
    ("yellow", "blue", "red"),
    ("blue", "orange", "green"),
    ("green", "orange", "blue"),
    ("red", "blue", "yellow"),
)
"""The colors of what moves, of what stays, and of the block that is taken away."""


class CounterfactualMaker(Maker):
    """Kinds: `cf-count` (texts) and `cf-color` (what moves, by colors)."""

    subtask: Subtask = "CF"

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask about removals from the scene, or from a part of it with an annex."""
        sort = _SORTS[int(rng.choice(len(_SORTS), p=_SHARES))]
        propose = pick(rng, (_count, _color))
        for number in range(_STRUCTURES_TRIED):
            blocks = (with_annex(scene, rng) if number else scene.blocks) or ()
            added = [block for block in blocks if block.order > len(scene)]
            for order in shuffled(rng, sight.orders_of(added or blocks))[:_REMOVALS_TRIED]:
                group = group_of(blocks, order)
                left = [block for block in group if block.order != order]
                naive = [resting_on(group, order, only=only) for only in (False, True)]
                # What statics alone say; a simulation decides.
                falls = not is_balanced(left)
                if not left or tuple(bool(lot) is falls for lot in naive) != sort:
                    continue
                shown = _pictured(blocks, order, rng)
                outcome = sure_removal(blocks, order) if shown else None
                if shown and outcome:
                    moved = frozenset(outcome.moved)
                    is_asked = moved or rng.random() < _STAYS_ASKED
                    if is_asked and tuple(moved == lot for lot in naive) == sort:
                        yield from propose(scene, shown, order, moved, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Simulate the removal again."""
        slots, shown = base.slots_of(question), sight.picture_of(question, "scene")
        order = sight.marked_order(shown, TAKEN)
        outcome = sure_removal(shown.blocks, order)
        if outcome is None:
            raise UnfairError(f"it is not sure what follows without block {order}")
        sight.require_seen(
            shown, sight.NAMED, [block for block in shown.blocks if block.order == order]
        )
        if base.stem_of(question.wording) == "cf-count":
            right = _outcome_text(len(outcome.moved))
            return base.only_index([option == right for option in question.options])
        told = [
            sight.highlighted(one, shown.blocks, slots, taken=order)
            for one in sight.option_pictures(question)
        ]
        return base.only_index([one == set(outcome.moved) for one in told])


def _outcome_text(count: int) -> str:
    return OUTCOME_TEXTS[min(count, len(OUTCOME_TEXTS) - 1)]


def _pictured(
    blocks: tuple[Block, ...], order: int, rng: np.random.Generator
) -> QuestionPicture | None:
    """Return the blocks from a view that shows them all, with the one that goes marked."""
    for _ in range(_VIEWS_TRIED):
        plain = QuestionPicture("scene", blocks, base.drawn_view(rng))
        mark = block_mark(plain, seen(plain), order, TAKEN)
        if (
            mark
            and sight.are_seen(plain, [order], sight.NAMED)
            and sight.are_seen(plain, sight.orders_of(blocks), _ALL_SEEN)
        ):
            return replace(plain, marks=(mark,))
    return None


def _count(
    scene: Scene, shown: QuestionPicture, order: int, moved: Lot, rng: np.random.Generator
) -> Iterator[Draft]:
    """Ask how many blocks move."""
    right, *others = base.right_first(_outcome_text(len(moved)), OUTCOME_TEXTS)
    options = [right, *shuffled(rng, others)]
    if sight.are_seen(shown, moved, sight.COUNTED):
        facts = {"removed": order, "moved": sorted(moved)}
        yield draft(scene, rng, "cf-count", options, [shown], {}, facts=facts)


def _color(
    scene: Scene, shown: QuestionPicture, order: int, moved: Lot, rng: np.random.Generator
) -> Iterator[Draft]:
    """Ask which blocks move, by pictures that color them."""
    plain = replace(shown, marks=())
    pixels = shown_pixels(plain, seen(plain))
    lots = [moved, *_other_lots(plain, order, rng, moved)]
    unlike = np.array([[sum(pixels[o] for o in a ^ b) for b in lots] for a in lots], dtype=float)
    measures = np.array([_looks_of_lot(plain, order, lot) for lot in lots])
    four = base.four_alike(measures, unlike, sight.LEAST_PIXELS, rng)
    colors = pick(rng, _COLORS)

    def colored(lot: Lot) -> QuestionPicture:
        color = {b.order: colors[b.order not in lot] for b in plain.blocks} | {order: colors[2]}
        return replace(plain, blocks=tuple(replace(b, color=color[b.order]) for b in plain.blocks))

    options = [colored(lots[place]) for place in four]
    if options and sight.are_seen(shown, moved, sight.COUNTED) and sight.are_told_apart(options):
        slots: dict[str, str] = dict(zip(("color", "other", "taken"), colors, strict=True))
        facts = {"removed": order, "moved": sorted(moved)}
        looks = measures[four].tolist()
        yield draft(scene, rng, "cf-color", options, [shown], slots, looks=looks, facts=facts)


def _other_lots(
    plain: QuestionPicture, taken: int, rng: np.random.Generator, moved: Lot
) -> list[Lot]:
    """Return lots that could move together and do not: some blocks, with all that rests on them."""
    share = sight.shares(plain)
    left = [block for block in plain.blocks if block.order != taken]
    single = [frozenset({b.order}) | resting_on(left, b.order) for b in left]
    found = {frozenset[int]()}
    for number in range(1, _MOST_TOGETHER + 1):
        found |= {frozenset().union(*some) for some in itertools.combinations(single, number)}
        if len(found) > _MOST_LOTS:
            break
    fair = [lot for lot in found if lot != moved and all(share[o] >= sight.COUNTED for o in lot)]
    return shuffled(rng, sorted(fair, key=sorted))[:_MOST_LOTS]


def _looks_of_lot(plain: QuestionPicture, taken: int, lot: Lot) -> tuple[float, ...]:
    """Return area, number and place of what is colored, and how far it is from the naive rules."""
    shot = seen(plain)
    vertices = [i for i, block in enumerate(plain.blocks) if block.order in (lot or {taken})]
    rows, columns = np.nonzero(np.isin(shot.block, vertices))
    side, area = len(shot.block) / 20, max(int((shot.block >= 0).sum()), 1) / 20
    return (
        len(rows) / area if lot else 0.0,
        float(len(lot)),
        *(float(x) / side for x in (rows.mean(), columns.mean(), rows.min(), rows.max())),
        float(len(lot ^ resting_on(plain.blocks, taken))),
        float(len(lot ^ resting_on(plain.blocks, taken, only=True))),
    )


def resting_on(blocks: Sequence[Block], order: int, *, only: bool = False) -> Lot:
    """Return orders of the blocks that rest on one, directly or not; not its own.

    With `only` they rest on nothing but it and others that do. The naive rule says that these, or
    those, fall when it is taken away, and nothing else.
    """
    found: Lot = frozenset({order})
    for _ in blocks:
        found |= {
            one
            for one, under in _below(tuple(blocks)).items()
            if under & found and (not only or under <= found)
        }
    return found - {order}


# The support graph is asked again for every block of a structure.
_below = functools.lru_cache(maxsize=64)(support_graph)


@functools.lru_cache(maxsize=16)
def sure_removal(blocks: tuple[Block, ...], order: int) -> Outcome | None:
    """Return the sure outcome of a removal; None where settings or statics leave a doubt."""
    group = group_of(blocks, order)
    if not surely_stands(group):
        return None
    outcome = after_removal(blocks, order)
    near = [block for block in group if block.order != order]
    is_near = set(outcome.moved) <= {block.order for block in near}
    return outcome if outcome.is_clear and is_near and is_sure(near, outcome.moved) else None
