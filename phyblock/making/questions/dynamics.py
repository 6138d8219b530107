"""CF, PD, AD: what moves when a block goes or comes.

Questions are proposed by statics alone; simulations confirm those that are selected.

CF: the block that goes supports others of the scene. It is marked in the picture, so that no word
of the question hints at the answer.

PD: four pictures show the same blocks laid on an unfinished structure, of which one stays. In none,
one or two of the others the plank hangs over less; by how far all leans off the middle of the
structure it is about as often any of the four.

AD: all places are on two planks in balance. By how far the right one is off the middle of its
plank, and of the structure, it is about as often any of the four.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import (
    BLOCK_TYPES,
    COLORS,
    SHAPES,
    BlockType,
    Euler,
    euler_deg_to_matrix,
)
from phyblock.domain.question import LETTERS, Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions import base, sight
from phyblock.making.questions.base import Draft, Floats, Maker, UnfairError, View, pick, shuffled
from phyblock.making.questions.structures import (
    SPARE_M,
    THIN_M,
    UNIT_M,
    WIDE_M,
    Bench,
    bench,
    free_tops,
    group_of,
    is_sure,
    lots_of,
    lowered,
    lowered_round,
    stage,
    stays_round,
    surely_stays,
    verdict,
)
from phyblock.making.scenes.sketch import POSES
from phyblock.sim.balance import is_balanced, surely_stands
from phyblock.sim.camera import view_axes
from phyblock.sim.contact import bounds_m, support_graph
from phyblock.sim.dynamics import groups
from phyblock.sim.geometry import drawn_mesh
from phyblock.sim.outcomes import LEAN_DEG, Outcome, after_removal
from phyblock.sim.pictures import drawn_m
from phyblock.sim.question_pictures import (
    BLOCK_LABEL,
    are_apart,
    block_mark,
    is_inside,
    mark_pixel,
    seen,
    seen_order,
    shown_pixels,
)

# CF

TAKEN = "X"
"""The letter of the block that is taken away."""
Ints = NDArray[np.int64]
Lot = frozenset[int]
"""Orders of blocks that move."""
OUTCOME_TEXTS: tuple[str, ...] = tuple(base.WORDS["outcomes_of_removal"])
"""Outcomes of a removal, by the number of other blocks that do not stay; all are offered."""
_ALL_SEEN = 0.12
_VIEWS_TRIED, _REMOVALS_TRIED = 3, 4
_MOST_LOTS, _MOST_TOGETHER = 40, 3
_COLORS = tuple(itertools.permutations(sight.PLAIN_COLORS))
"""The colors of what moves, of what stays, and of the block that is taken away."""


class CounterfactualMaker(Maker):
    """Kinds: `cf-count` (texts) and `cf-color` (what moves, by colors)."""

    subtask: Subtask = "CF"
    spare, doubtful = 6.0, 1.3
    drafts_a_scene = 3

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask about removals of blocks that others rest on."""
        carrying = frozenset[int]().union(*_below(scene.blocks).values())
        asked = [block.order for block in scene.blocks if block.order in carrying]
        for order in shuffled(rng, asked)[:_REMOVALS_TRIED]:
            shown = _pictured(scene.blocks, order, rng)
            moved = falling(group_of(scene.blocks, order), order) if shown else None
            if shown and moved is not None and sight.are_seen(shown, moved, sight.COUNTED):
                right, *others = base.right_first(_outcome_text(len(moved)), OUTCOME_TEXTS)
                options = (right, *shuffled(rng, others))
                facts = {"removed": order, "moved": sorted(moved)}
                yield Draft(scene, "cf-count", options, (shown,), facts=facts, about=order)
                yield from _color(scene, shown, order, moved, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Simulate the removal again."""
        slots, shown = base.slots_of(question), sight.picture_of(question, "scene")
        order = sight.marked_order(shown, TAKEN)
        outcome = sure_removal(shown.blocks, order)
        if outcome is None:
            raise UnfairError(f"it is not sure what follows without block {order}")
        gone = [block for block in shown.blocks if block.order == order]
        if not any(order in block.depend for block in shown.blocks):
            raise UnfairError(f"block {order} supports no other")
        sight.require_seen(shown, sight.NAMED, gone)
        if question.wording != "cf-color":
            right = _outcome_text(len(outcome.moved))
            return base.only_index([option == right for option in question.options])
        told = [
            sight.highlighted(one, shown.blocks, slots, taken=order)
            for one in sight.option_pictures(question)
        ]
        return base.only_index([one == set(outcome.moved) for one in told])


def falling(blocks: Sequence[Block], order: int) -> Lot | None:
    """Return the orders of the blocks that by statics move when one goes; None where unsure.

    These are blocks next to it, with all that rests on them.
    """
    left, below = [block for block in blocks if block.order != order], _below(tuple(blocks))
    near = [o for o in below if order in below[o]] or [o for o in below[order] if o in below]
    with_load = [(frozenset({o}) | resting_on(blocks, o)) - {order} for o in near]
    lots = {
        frozenset[int]().union(*some)
        for count in range(len(with_load) + 1)
        for some in itertools.combinations(with_load, count)
    }
    for lot in sorted(lots, key=sorted):
        still = [block for block in left if block.order not in lot]
        loose = lots_of([block for block in left if block.order in lot])
        is_so = is_balanced(still) and not any(is_balanced([*still, *one]) for one in loose)
        if is_so and surely_stands(blocks) and is_sure(left, lot):
            return lot
    return None


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

    options = tuple(colored(lots[place]) for place in four)
    if options and sight.are_told_apart(options):
        slots: dict[str, str] = dict(zip(("color", "other", "taken"), colors, strict=True))
        facts = {"removed": order, "moved": sorted(moved)}
        yield Draft(scene, "cf-color", options, (shown,), slots, facts, about=order)


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
    """Return the orders of the blocks that rest on a block, directly or not, without its own.

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


# PD


_BENCHES_TRIED, _SHOWN, _ONE_STAYS = 80, 60, [True, False, False, False]
_ELEVATIONS_DEG = (20, 38)
_LEAN, _LEAST_ACROSS, _ON_A_PILLAR = 2.0, 0.5, 0.8
_SIDES_XY = ((1, 0), (-1, 0), (0, 1), (0, -1))
_PLANS, _FOURS = 400, 4000
_OVER = (0, 1, 1, 2, 2, 2)
"""Ranks of the right plank that are asked for; the higher, the harder to find."""
Ranks = tuple[int, int]
"""Of how many of the other options two measures are below that of the right one."""


class PredictiveMaker(Maker):
    """Kind: `pd-next`, the next step after which all stays."""

    subtask: Subtask = "PD"
    count = 100
    spare, doubtful = 4.7, 1.75
    drafts_a_scene = 3

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose stages of building and ways to go on, of which one stays."""
        for _ in range(self.drafts_a_scene):
            ranks = (pick(rng, _OVER), int(rng.integers(len(LETTERS))))
            tried = (_next_steps(scene, ranks, rng) for _ in range(_BENCHES_TRIED))
            yield from itertools.islice(itertools.chain.from_iterable(tried), 1)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Decide by statics and simulation."""
        base.slots_of(question)
        shown, options = sight.picture_of(question, "scene"), sight.option_pictures(question)
        return base.only_index([_can_follow(shown, one) for one in options])


def _next_steps(scene: Scene, ranks: Ranks, rng: np.random.Generator) -> Iterator[Draft]:
    """Yield a question about a bench drawn, as far as one has such plans for it."""
    stages = stage(scene, rng)
    if not (tops := free_tops(stages)):
        return
    pillar_m = THIN_M if rng.random() < _ON_A_PILLAR else 0.0
    first = max(sight.orders_of(scene.blocks)) + 1
    on = bench(stages, pick(rng, tops), 2, pillar_m, first, rng)
    every = [blocks for offs_m in four_plans(on, ranks, rng) if (blocks := on.laid(offs_m))]
    if len(every) < len(LETTERS):
        return
    view, framed = base.drawn_view(rng, _ELEVATIONS_DEG), _framed(every)
    plain = QuestionPicture("scene", on.base, view, framed=framed)
    options = [replace(plain, blocks=blocks) for blocks in every]
    if (
        is_across(on, view)
        and sight.are_told_apart(options)
        and min(min(shown_pixels(one, seen(one)).values()) for one in options) >= _SHOWN
        and [surely_stays(p.blocks, p.blocks[-1].order) for p in options] == _ONE_STAYS
        and stays_leaning(every[0], every[0][-1].order)
    ):
        facts, kind = {"placed": sight.orders_of(on.base)}, f"plank {ranks[0]}"
        yield Draft(scene, "pd-next", tuple(options), (plain,), {}, facts, kind)


def is_across(on: Bench, view: View) -> bool:
    """True if the line of the plank runs across the view."""
    return bool(abs(view_axes(*view)[0][on.along]) >= _LEAST_ACROSS)


def stays_leaning(blocks: Sequence[Block], order: int) -> bool:
    """True if by statics all near a block stay on a floor that leans twice as far as those of
    simulations, where they are let go at once.
    """
    group, slope = group_of(blocks, order), _LEAN * math.tan(math.radians(LEAN_DEG))
    return all(is_balanced(group, (x * slope, y * slope)) for x, y in _SIDES_XY)


def four_plans(on: Bench, ranks: Ranks, rng: np.random.Generator) -> list[list[float]]:
    """Return four plans, of which by a lever, with margins, all stays in the first only; empty
    where none are found.

    Its ranks are by how far the plank hangs over, and by how far all leans off the middle of the
    structure.
    """
    near, far = on.limits_m
    plans = on.plans_m(_PLANS, rng)
    leans = on.leans_m(plans)
    fours = one_stays(np.abs(leans) <= near, np.abs(leans) >= far, rng)
    gaps = np.diff(np.sort(leans[fours], axis=1), axis=1)
    fitting = (gaps.min(axis=1) >= far - near) & ((gaps[:, :-1] + gaps[:, 1:]).min(axis=1) >= far)
    fitting &= ranks_of(np.abs(plans[fours, 0])) == ranks[0]
    fitting &= ranks_of(np.abs(leans - on.middle_m)[fours]) == ranks[1]
    found: list[list[float]] = plans[pick(rng, fours[fitting])].tolist() if fitting.any() else []
    return found


def one_stays(stays: NDArray[np.bool_], falls: NDArray[np.bool_], rng: np.random.Generator) -> Ints:
    """Return fours drawn, (n, 4), of which the first stays and the others fall; none where there
    are no such.
    """
    if not stays.any() or not falls.any():
        return np.empty((0, len(LETTERS)), dtype=np.int64)
    wrong = rng.choice(np.flatnonzero(falls), size=(_FOURS, len(LETTERS) - 1))
    return np.column_stack([rng.choice(np.flatnonzero(stays), size=_FOURS), wrong])


def ranks_of(fours: Floats) -> Ints:
    """Return how many of each four, (n, 4), are below the first; -1 where one is equal to it."""
    steps = fours[:, 1:] - fours[:, :1]
    is_apart = (np.abs(steps) >= SPARE_M).all(axis=1)
    return np.where(is_apart, (steps < 0).sum(axis=1), -1)


def _framed(every: Sequence[Sequence[Block]]) -> tuple[Block, ...]:
    """Return the blocks of all pictures that are compared, to frame a camera on."""
    poses = {(block.type, block.position_m, block.euler_deg): block for s in every for block in s}
    return tuple(replace(block, order=i) for i, block in enumerate(poses.values(), 1))


def _can_follow(shown: QuestionPicture, option: QuestionPicture) -> bool:
    """True if blocks were added so that all stays; UnfairError when that is not sure."""
    placed = {block.order for block in shown.blocks}
    added = [block for block in option.blocks if block.order not in placed]
    kept = tuple(block for block in option.blocks if block.order in placed)
    if not added or not sight.same_blocks(kept, shown.blocks):
        raise UnfairError(f"picture {option.label} does not add to the structure")
    stays = verdict(option.blocks, added[0].order)
    if stays is None:
        raise UnfairError(f"it is not sure whether all stays in picture {option.label}")
    return stays


# AD

Place = tuple[float, float, float]
"""A point of the world [m]."""
_PLACE_RING_M = 0.005
"""The verdict on a place holds all round it, this far off [m]."""
_STRUCTURES_TRIED, _LEAST_APART_M, _ROUND_PX, _CLEAR_M = 80, 0.025, 2, 0.006
_OFF_CENTER_M, _MOST_OF_A_FACE = 0.001, 0.8
_SAME_HEIGHT_M, _CLEARLY_HIGHER_M = 0.001, 0.01


class AffordanceMaker(Maker):
    """Kind: `ad-place`."""

    subtask: Subtask = "AD"
    spare, doubtful = 2.5, 2.0
    drafts_a_scene = 8

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose a block in a pose drawn, one place where it stays, and three where not."""
        for _ in range(self.drafts_a_scene):
            ranks = (int(rng.integers(len(LETTERS))), int(rng.integers(len(LETTERS))))
            tried = (_set_down(scene, ranks, rng) for _ in range(_STRUCTURES_TRIED))
            yield from itertools.islice(itertools.chain.from_iterable(tried), 1)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Decide by statics and simulation of the block at every place, and statics all round."""
        slots = base.slots_of(question)
        shown, alone = sight.picture_of(question, "scene"), sight.picture_of(question, BLOCK_LABEL)
        if len(alone.blocks) != 1:
            raise UnfairError("the second picture is not of one block")
        block = alone.blocks[0]
        if slots.get("size") != _size(block) or not shows_solid(block, alone.view_deg):
            raise UnfairError("the block is not as large as told, or does not show its shape")
        sight.require_seen(shown, _ALL_SEEN)
        plain, stays = replace(shown, marks=()), []
        for letter in LETTERS:
            places = [mark.position_m for mark in shown.marks if mark.letter == letter]
            places = [at for at in places if seen_order(plain, seen(plain), at) is not None]
            if not places:
                raise UnfairError(f"no place {letter} is marked on a block")
            stays.append(stays_at(plain, block, places[0]))
            if stays[-1] is None:
                raise UnfairError(f"it is not sure whether the block stays at place {letter}")
        return base.only_index(stays)


def _set_down(scene: Scene, ranks: Ranks, rng: np.random.Generator) -> Iterator[Draft]:
    """Yield a question about places on two planks on the scene, as far as some fit."""
    blocks, view = stage(scene, rng), base.drawn_view(rng)
    block = _drawn_block(0, view, rng)
    spots: list[Spot] = []
    tops = free_tops(blocks)
    for top in shuffled(rng, tops)[:2] if len(tops) > 1 else ():
        first = max(sight.orders_of((*scene.blocks, *blocks))) + 1
        on = bench(blocks, top, int(rng.integers(2)), pick(rng, (THIN_M, WIDE_M)), first, rng)
        plans = on.plans_m(_PLANS, rng)
        plans = plans[np.abs(on.leans_m(plans)) <= on.limits_m[0]]
        # Planks that hang over far have more places where a block stays off their middle.
        plans = plans[np.abs(plans[:, 0]).argsort(kind="stable")][len(plans) * 2 // 3 :]
        laid = on.laid(pick(rng, plans.tolist())) if len(plans) else None
        if laid is None:
            return
        spots += free_spots(on, laid, block)
        blocks = laid
    four = four_spots(spots, blocks, view, ranks, rng)
    plain = QuestionPicture("scene", blocks, view)
    marks = [Mark("A", spot.place) for spot in four]
    if not marks or not _are_shown(plain, marks):
        return
    block = replace(block, order=max(sight.orders_of(blocks)) + 1)
    puts = [lowered(block, blocks, *spot.place[:2]) for spot in four]
    if (
        all(is_on_face(plain, put, spot.place) for put, spot in zip(puts, four, strict=True))
        and all(map(surely_stands, groups(blocks)))
        and [surely_stays((*blocks, put), put.order) for put in puts] == _ONE_STAYS
        and stays_leaning((*blocks, puts[0]), block.order)
    ):
        shown = (plain, QuestionPicture(BLOCK_LABEL, (block,), view))
        facts = {"block": block.type, "euler": list(block.euler_deg)}
        slots, kind = {"size": _size(block)}, f"ranks {ranks}"
        yield Draft(scene, "ad-place", tuple(marks), shown, slots, facts, kind)


class Spot(NamedTuple):
    """A point on the plank of a bench, and how far it is off the middle of the plank.

    By a lever a block put there stays, or falls, or neither is sure.
    """

    place: Place
    off_center_m: float
    stays: bool
    falls: bool


def free_spots(on: Bench, laid: Sequence[Block], block: Block) -> Iterator[Spot]:
    """Yield spots on the plank, as it was laid, where a block has room beside the weights."""
    (near, far), mass_kg = on.limits_m, SHAPES[block.type].mass_kg
    boxes = [bounds_m(one) for one in laid[len(on.base) :]]
    offs_m = np.array([box.mean(axis=0) for box in boxes]) - bounds_m(on.top).mean(axis=0)
    offs_m, middle = offs_m[:, on.along], [*boxes[0].mean(axis=0)[:2], boxes[0][1, 2]]
    room_m = (on.lengths_m[1:] + np.ptp(bounds_m(block)[:, on.along])) / 2 + _CLEAR_M
    most = round(float(on.lengths_m[0]) / UNIT_M / 2) - 1
    for step, aside in itertools.product(range(-most, most + 1), (-1, 0, 1)):
        off_m = offs_m[0] + step * UNIT_M
        if (np.abs(offs_m[1:] - off_m) >= room_m).all():
            lean_m = abs(offs_m @ on.masses_kg + mass_kg * off_m) / (on.masses_kg.sum() + mass_kg)
            at = np.array(middle)
            at[[on.along, 1 - on.along]] += (step * UNIT_M, aside * UNIT_M)
            x, y, z = np.round(at, 6).tolist()
            off_center_m = math.hypot(step, aside) * UNIT_M
            yield Spot((x, y, z), off_center_m, bool(lean_m <= near), bool(lean_m >= far))


def four_spots(
    spots: Sequence[Spot],
    blocks: Sequence[Block],
    view: View,
    ranks: Ranks,
    rng: np.random.Generator,
) -> list[Spot]:
    """Return four spots, apart as they are seen, of which a block stays on the first only; empty
    where there are no such.

    Its ranks are by how far it is off the middle of its plank, and of the structure.
    """
    stays, falls = (np.array([spot[i] for spot in spots], dtype=bool) for i in (2, 3))
    fours = one_stays(stays, falls, rng)
    if not len(fours):
        return []
    places_m = np.array([spot.place for spot in spots])
    seen_m = places_m @ np.array(view_axes(*view)[:2]).T
    apart_m = np.linalg.norm(seen_m[:, None] - seen_m, axis=2)
    for i, j in itertools.combinations(range(len(LETTERS)), 2):
        fours = fours[apart_m[fours[:, i], fours[:, j]] >= _LEAST_APART_M]
    corners = np.concatenate([bounds_m(block) for block in blocks])
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    out_m = np.linalg.norm((places_m - middle)[:, :2], axis=1)
    off_m = np.array([spot.off_center_m for spot in spots])
    fitting = (ranks_of(off_m[fours]) == ranks[0]) & (ranks_of(out_m[fours]) == ranks[1])
    return [spots[i] for i in pick(rng, fours[fitting].tolist())] if fitting.any() else []


def _are_shown(plain: QuestionPicture, marks: Sequence[Mark]) -> bool:
    """True if all blocks show, and each mark is well inside of one, apart from the others."""
    if not is_inside(replace(plain, marks=tuple(marks))) or not are_apart(plain, marks):
        return False
    for mark in marks:
        row, column = mark_pixel(plain, mark.position_m)
        rows, columns = (slice(at - _ROUND_PX, at + _ROUND_PX + 1) for at in (row, column))
        near = seen(plain).block[rows, columns]
        if near.min() < 0 or near.min() < near.max():
            return False
    return sight.are_seen(plain, sight.orders_of(plain.blocks), _ALL_SEEN)


def _drawn_block(order: int, view: View, rng: np.random.Generator) -> Block:
    """Return a block to put down, in a pose whose shape the view shows."""
    while True:
        block_type, euler = pick(rng, _balanced_poses())
        block = Block(order, block_type, pick(rng, COLORS), (0.0, 0.0, 0.0), euler, (), 1)
        if shows_solid(block, view):
            return block


@functools.cache
def _balanced_poses() -> list[tuple[BlockType, Euler]]:
    """Return poses that stand, with the center of mass under the middle seen from above."""
    poses = []
    for block_type in BLOCK_TYPES:
        for euler in POSES[block_type].values():
            block = lowered(Block(1, block_type, "red", (0.0, 0.0, 0.0), euler, (), 1), (), 0, 0)
            center = euler_deg_to_matrix(euler) @ np.array(SHAPES[block_type].center_of_mass_m)
            is_central = np.abs(center[:2] + block.position_m[:2]).max() < _OFF_CENTER_M
            if is_central and surely_stands((block,)):
                poses.append((block_type, euler))
    return poses


def shows_solid(block: Block, view: View) -> bool:
    """True if a view shows its profile, and no one face is nearly all that shows of the block."""
    along = view_axes(*view)[2]
    corners = drawn_m(block)[drawn_mesh(block.type).triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shown = np.maximum(-normals @ along, 0.0)
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    _, faces = np.unique(np.round(normals / lengths, 2), axis=0, return_inverse=True)
    largest = np.bincount(faces.ravel(), shown).max() / shown.sum()
    return sight.shows_profile(block, view) and bool(largest <= _MOST_OF_A_FACE)


def _size(block: Block) -> str:
    """Return length, width and height of a block as it is turned, to half a centimeter."""
    *level, high = (round(float(side) * 200) / 2 for side in np.diff(bounds_m(block), axis=0)[0])
    return f"{max(level):g} by {min(level):g} cm, {high:g} cm high"


@functools.lru_cache(maxsize=64)
def stays_at(plain: QuestionPicture, block: Block, at: Place) -> bool | None:
    """True if the block stays at a place, by simulation too, and likewise up to 5 mm off.

    None where that is not sure, where it is not sure on which face it comes down, and where it
    stays on another than the one that is marked.
    """
    put = lowered(block, plain.blocks, *at[:2])
    around = lowered_round(put, plain.blocks, _PLACE_RING_M)
    is_on = is_on_face(plain, put, at)
    if is_on is None or any(_is_as_high(one, at) is not is_on for one in around):
        return None
    stays = stays_round(put, plain.blocks, _PLACE_RING_M)
    if verdict((*plain.blocks, put), put.order) is not stays or (stays and not is_on):
        return None
    return stays


def is_on_face(plain: QuestionPicture, put: Block, at: Place) -> bool | None:
    """True if a block let down at a place came down on the marked face, as without others.

    False if it met a neighbor clearly before; None where neither is so.
    """
    is_as_high = _is_as_high(put, at)
    if not is_as_high:
        return is_as_high
    under = seen_order(plain, seen(plain), at)
    alone = [one for one in plain.blocks if one.order == under]
    return True if _is_as_high(lowered(put, alone, *at[:2]), at) else None


def _is_as_high(put: Block, at: Place) -> bool | None:
    """True if a block has come down as far as a place; None where it is lower, or hardly higher."""
    above_m = float(bounds_m(put)[0, 2]) - at[2]
    if abs(above_m) < _SAME_HEIGHT_M:
        return True
    return False if above_m > _CLEARLY_HIGHER_M else None
