"""CF, PD, AD: what moves when a block goes or comes.

Questions are proposed by statics alone; simulations confirm those that are selected.

CF: the block that goes supports others of the scene. It is marked in the picture, so that no word
of the question hints at the answer.

PD: four pictures show the same blocks laid on an unfinished structure, of which one stays. In none,
one or two of the others the plank hangs over less; by how far all leans off the middle of the
structure it is about as often any of the four.

AD: what becomes of the block at each of four places is plain to the eye, and checked with margins.
The rank of the right place by height is drawn; it is still too often the one nearest to the middle
of its face.
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
    WIDE_M,
    Bench,
    bench,
    free_tops,
    group_of,
    is_sure,
    lowered,
    lowered_round,
    stage,
    stays_round,
    surely_stays,
    verdict,
)
from phyblock.making.scenes.sketch import POSES
from phyblock.sim.balance import MARGIN_M, is_balanced, surely_stands
from phyblock.sim.camera import view_axes
from phyblock.sim.contact import GROUND, bounds_m, support_graph
from phyblock.sim.dynamics import groups
from phyblock.sim.geometry import cross, drawn_mesh
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
        loose = groups([block for block in left if block.order in lot])
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
STAYS, IN_THE_WAY, TIPS, SLIDES = range(1, 5)
"""What happens to a block that is set down: it stays; it comes down on a neighbor first, and tips
off that; it tips what it is set on; it slides off a slope or a round back."""
_PLACE_RING_M, _WIDE_RING_M = 0.005, 0.01
"""The verdict on a place holds all round it, this far off; in proposals farther [m]."""
_STRUCTURES_TRIED, _BLOCKS_TRIED, _POINTS, _AREA_M2 = 120, 12, 40, 0.0006
_MOST_BLOCKS, _PILLARS_M = 10, (0.0, THIN_M, THIN_M, WIDE_M)
_VIEWED_FROM_DEG, _VIEWS_OF_PLACES = (20, 34), 8
_FLAT, _LOOKS_UP, _LOOKS_HERE, _ROUND_PX, _APART_M = 0.9999, 0.4, 0.2, 2, 0.025
_INSIDE_M, _CLEAR_M, _CLEAR_OF_OTHERS_M, _BESIDE_M = 0.015, 0.0125, 0.025, 0.001
_OVER_M, _OUT_M, _LEANS_OUT_M, _OFF_CONTACT_M = 0.005, 0.015, 0.0075, 0.01
_SMALL_M, _ODDS_OF_SMALL, _OFF_CENTER_M, _MOST_OF_A_FACE = 0.08, 0.35, 0.001, 0.8
_SAME_HEIGHT_M, _CLEARLY_HIGHER_M = 0.001, 0.01


class AffordanceMaker(Maker):
    """Kind: `ad-place`."""

    subtask: Subtask = "AD"
    spare, doubtful = 2.0, 1.3
    drafts_a_scene = 3

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose a block in a pose drawn, one place where it stays, and three where not."""
        for _ in range(self.drafts_a_scene):
            rank = int(rng.integers(len(LETTERS)))
            tried = (_set_down(scene, rank, rng) for _ in range(_STRUCTURES_TRIED))
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


def _set_down(scene: Scene, rank: int, rng: np.random.Generator) -> Iterator[Draft]:
    """Yield at most one question about places on part of the scene, with a few blocks added.

    Of the three wrong places, `rank` are lower than the right one.
    """
    blocks = _built_on(stage(scene, rng, _MOST_BLOCKS), sight.orders_of(scene.blocks), rng)
    points, last = points_of(blocks, rng), max(sight.orders_of(blocks))
    put = [_drawn_block(last + 1, rng) for _ in range(_BLOCKS_TRIED)]
    outcomes = [outcomes_of(blocks, block, points) for block in put]
    found = [
        (block, outcome, *four)
        for block, outcome in zip(put, outcomes, strict=True)
        if STAYS in outcome and np.isin(outcome, (IN_THE_WAY, TIPS)).sum() > 1
        for four in fours_of(blocks, points, outcome, rank, rng)
    ]
    if not found:
        return
    odds = np.array([one[-1] for one in found])
    block, outcome, four, kind, _ = found[rng.choice(len(found), p=odds / odds.sum())]
    chosen = points.those(four)
    places = [(x, y, z) for x, y, z in chosen.at_m.tolist()]
    if not all(map(surely_stands, groups(blocks))):
        return
    for place, stays in zip(places, _ONE_STAYS, strict=True):
        if stays_round(lowered(block, blocks, *place[:2]), blocks, _WIDE_RING_M) is not stays:
            return
    told = [blocks[k] for k in chosen.on[np.isin(outcome[four], (STAYS, TIPS))]]
    marks = tuple(Mark("A", place) for place in places)
    for _ in range(_VIEWS_OF_PLACES):
        plain = QuestionPicture("scene", blocks, base.drawn_view(rng, _VIEWED_FROM_DEG))
        if shows_solid(block, plain.view_deg) and _are_shown(plain, marks, chosen, told):
            shown = (plain, QuestionPicture(BLOCK_LABEL, (block,), plain.view_deg))
            facts = {"block": block.type, "euler": list(block.euler_deg)}
            yield Draft(scene, "ad-place", marks, shown, {"size": _size(block)}, facts, kind)
            return


def _built_on(
    blocks: tuple[Block, ...], taken: Sequence[int], rng: np.random.Generator
) -> tuple[Block, ...]:
    """Return blocks with up to two planks laid on them, most on pillars, and small blocks set down
    where they plainly stay.
    """
    order = max(taken) + 1
    for top in shuffled(rng, free_tops(blocks))[: int(rng.integers(3))]:
        on = bench(blocks, top, 0, pick(rng, _PILLARS_M), order, rng)
        plans = on.plans_m(_POINTS, rng)
        plans = plans[np.abs(on.leans_m(plans)) <= on.limits_m[0] - MARGIN_M / 2]
        laid = on.laid(plans[np.abs(plans[:, 0]).argmax()].tolist()) if len(plans) else None
        blocks, order = laid or blocks, order + 2
    for _ in range(int(rng.integers(2, 5))):
        block = _drawn_block(order, rng, is_small=True)
        points = points_of(blocks, rng)
        where = points.at_m[outcomes_of(blocks, block, points) == STAYS].tolist()
        if where:
            blocks, order = (*blocks, lowered(block, blocks, *pick(rng, where)[:2])), order + 1
    return blocks


class Points(NamedTuple):
    """Points [m], (n, 3), the index of the block that each is on, and normals of their faces."""

    at_m: Floats
    on: Ints
    normals: Floats

    def those(self, chosen: Sequence[int]) -> Points:
        """Return some of the points."""
        return Points(self.at_m[chosen], self.on[chosen], self.normals[chosen])


def points_of(blocks: Sequence[Block], rng: np.random.Generator) -> Points:
    """Return points drawn on all faces that look up, on flat tops well inside."""
    found = [Points(np.empty((0, 3)), np.empty(0, dtype=np.int64), np.empty((0, 3)))]
    for i, block in enumerate(blocks):
        corners = drawn_m(block)[drawn_mesh(block.type).triangles]
        normals = cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.linalg.norm(normals, axis=1)
        normals /= areas[:, None]
        is_up = normals[:, 2] > (_FLAT if block.type == "arch" else _LOOKS_UP)
        if not is_up.any():
            continue
        faces = rng.choice(np.flatnonzero(is_up), size=_POINTS, p=areas[is_up] / areas[is_up].sum())
        parts = rng.dirichlet((1, 1, 1), size=_POINTS)
        at_m = np.einsum("pk,pkc->pc", parts, corners[faces]).round(4)
        low, high = bounds_m(block)
        is_inside = np.minimum(at_m - low, high - at_m)[:, :2].min(axis=1) >= _INSIDE_M
        kept = np.flatnonzero(is_inside | (normals[faces, 2] <= _FLAT))
        kept = kept[: math.ceil(areas[is_up].sum() / _AREA_M2)]
        found.append(Points(at_m[kept], np.full(len(kept), i), normals[faces[kept]]))
    return Points(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def outcomes_of(blocks: tuple[Block, ...], block: Block, points: Points) -> Ints:
    """Return what plainly happens to a block set down at each point; 0 where that is not plain.

    A person can tell by eye that the block keeps 1.25 cm from higher blocks beside the one it is
    set on, and 2.5 cm from all others, or overlaps one by as much; and that what it is set on has
    supports under the point, or on both sides of it, or bears nothing else and ends at least
    1.5 cm before the point.
    """
    boxes = np.array([bounds_m(one) for one in blocks])
    (low, high), top, at = (boxes[:, i, :2] for i in (0, 1)), boxes[:, 1, 2], points.at_m[:, None]
    half = np.ptp(bounds_m(block), axis=0)[:2] / 2
    is_higher = top > at[..., 2] + _SAME_HEIGHT_M
    is_higher[np.arange(len(points.on)), points.on] = False

    def met(reach_m: Floats | float) -> NDArray[np.bool_]:
        """Blocks that are higher than a point and so near to it, (points, blocks)."""
        near = (low < at[..., :2] + reach_m) & (high > at[..., :2] - reach_m)
        return np.asarray(is_higher & near.all(axis=2))

    gaps = np.maximum(boxes[:, None, 0] - boxes[:, 1], boxes[:, 0] - boxes[:, None, 1])
    is_beside = (gaps.max(axis=2) <= _BESIDE_M)[points.on]
    is_near = met(half + _CLEAR_M) | (met(half + _CLEAR_OF_OTHERS_M) & ~is_beside)
    is_open, is_clear = ~met(0.0).any(axis=1), ~is_near.any(axis=1)
    # What it comes down on first, if anything is in the way.
    on = met(half)
    on &= top > np.where(on, top, 0.0).max(axis=1, keepdims=True) - _SAME_HEIGHT_M
    first = np.where(on[..., None], np.maximum(low, at[..., :2] - half), np.inf).min(axis=1)
    last = np.where(on[..., None], np.minimum(high, at[..., :2] + half), -np.inf).max(axis=1)
    is_met = met(half - _CLEAR_OF_OTHERS_M) | (met(half - _CLEAR_M) & is_beside)
    is_met &= top > at[..., 2] + _CLEARLY_HIGHER_M
    is_blocked = is_met.any(axis=1) & (_out_m(at[:, 0], first, last) >= _OFF_CONTACT_M)
    # Whether what it is set on holds.
    below, xy = _below(blocks), points.at_m[:, :2]
    borne = np.array([_borne_by(one, blocks, below) for one in blocks])[points.on]
    masses = np.array([SHAPES[one.type].mass_kg for one in (block, *blocks)])
    share = (masses[0] / (masses[0] + masses[1:]))[points.on, None]
    leans = share * xy + (1 - share) * boxes.mean(axis=1)[points.on, :2]
    is_loaded = np.array([any(one.order in under for under in below.values()) for one in blocks])
    tips = (_out_m(xy, *borne.swapaxes(0, 1)) >= _OUT_M) & ~is_loaded[points.on]
    tips &= _out_m(leans, *borne.swapaxes(0, 1)) >= _LEANS_OUT_M
    is_held = _out_m(xy, *borne.swapaxes(0, 1)) <= -_OVER_M
    free, flat = is_open & is_clear, points.normals[:, 2] > _FLAT
    cases = [is_open & is_blocked & flat, free & ~flat, free & is_held, free & tips]
    return np.select(cases, [IN_THE_WAY, SLIDES, STAYS, TIPS], 0)


def _borne_by(block: Block, blocks: Sequence[Block], below: sight.Below) -> Floats:
    """Return the corners (2, 2) of the box round what bears a block, seen from above [m]."""
    low, high = bounds_m(block)[:, :2]
    under = [bounds_m(one)[:, :2] for one in blocks if one.order in below[block.order]]
    if GROUND in below[block.order] or not under:
        return np.array([low, high])
    corners = np.array(under)
    return np.array(
        [np.maximum(low, corners[:, 0].min(axis=0)), np.minimum(high, corners[:, 1].max(axis=0))]
    )


def _out_m(at_m: Floats, low_m: Floats, high_m: Floats) -> Floats:
    """Return how far points are outside of boxes seen from above, below 0 inside [m]."""
    outside: Floats = np.maximum(low_m - at_m[:, :2], at_m[:, :2] - high_m).max(axis=1)
    return outside


def fours_of(
    blocks: Sequence[Block], points: Points, outcomes: Ints, rank: int, rng: np.random.Generator
) -> list[tuple[list[int], str, float]]:
    """Return fours of points, the first of which is right and has the rank by height, with kinds
    and odds; a four for each two ranks that it can have by how far it is off the middle of its
    block, and of the structure.

    Rare ranks have high odds.
    """
    fours = one_stays(outcomes == STAYS, outcomes > STAYS, rng)
    apart_m = np.linalg.norm(points.at_m[:, None] - points.at_m, axis=2)
    for i, j in itertools.combinations(range(len(LETTERS)), 2):
        fours = fours[apart_m[fours[:, i], fours[:, j]] >= _APART_M]
    fours = fours[(outcomes[fours] == SLIDES).sum(axis=1) <= 1]
    boxes = np.array([bounds_m(block) for block in blocks])
    middle = (boxes.min(axis=(0, 1)) + boxes.max(axis=(0, 1))) / 2
    offs = [points.at_m - center for center in (boxes.mean(axis=1)[points.on], middle)]
    measures = [points.at_m[:, 2], *(np.linalg.norm(off[:, :2], axis=1) for off in offs)]
    # Points less than half a millimeter apart come in an order drawn.
    drawn = [one + rng.random(len(one)) * 2 * SPARE_M for one in measures]
    ranks = np.array([ranks_of(one[fours]) for one in drawn]).T
    is_fit = (ranks.min(axis=1) >= 0) & (ranks[:, 0] == rank)
    fours, ranks = fours[is_fit], ranks[is_fit]
    kinds, first = np.unique(ranks, axis=0, return_index=True)
    odds = (1 + kinds[:, 1]) ** 5.0 * (1 + kinds[:, 2]) ** 0.5
    told = [f"ranks {high} {off}" for high, off, _ in kinds]
    return list(zip(fours[first].tolist(), told, odds.tolist(), strict=True))


def _are_shown(
    plain: QuestionPicture, marks: tuple[Mark, ...], points: Points, told: Sequence[Block]
) -> bool:
    """True if all blocks and marks show, and well so what some of the blocks rest on."""
    if (points.normals @ view_axes(*plain.view_deg)[2]).max() > -_LOOKS_HERE:
        return False
    if not is_inside(replace(plain, marks=marks)) or not are_apart(plain, marks):
        return False
    for mark, on in zip(marks, points.on, strict=True):
        row, column = mark_pixel(plain, mark.position_m)
        rows, columns = (slice(at - _ROUND_PX, at + _ROUND_PX + 1) for at in (row, column))
        if (seen(plain).block[rows, columns] != on).any():
            return False
    below = _below(plain.blocks)
    under = frozenset[int]().union(*(below[block.order] for block in told)) - {GROUND}
    deep = frozenset[int]().union(*(sight.all_below(block.order, below) for block in told))
    return (
        sight.are_seen(plain, sight.orders_of(plain.blocks), _ALL_SEEN)
        and sight.are_seen(plain, under, sight.NAMED)
        and sight.are_seen(plain, deep, sight.COUNTED)
    )


def _drawn_block(order: int, rng: np.random.Generator, is_small: bool = False) -> Block:
    """Return a block to put down; more often a large one than not."""
    small, large = _balanced_poses()
    poses = small if is_small or rng.random() < _ODDS_OF_SMALL else large
    block_type, euler = pick(rng, poses)
    return Block(order, block_type, pick(rng, COLORS), (0.0, 0.0, 0.0), euler, (), 1)


@functools.cache
def _balanced_poses() -> tuple[list[tuple[BlockType, Euler]], ...]:
    """Return poses of small and of large blocks that stand, with the center of mass under the
    middle seen from above. An arch has a gap there.
    """
    small, large = list[tuple[BlockType, Euler]](), list[tuple[BlockType, Euler]]()
    for block_type in BLOCK_TYPES:
        for euler in POSES[block_type].values() if block_type != "arch" else ():
            block = lowered(Block(1, block_type, "red", (0.0, 0.0, 0.0), euler, (), 1), (), 0, 0)
            center = euler_deg_to_matrix(euler) @ np.array(SHAPES[block_type].center_of_mass_m)
            is_central = np.abs(center[:2] + block.position_m[:2]).max() < _OFF_CENTER_M
            if is_central and surely_stands((block,)):
                is_small = np.ptp(bounds_m(block), axis=0)[:2].max() < _SMALL_M
                (small if is_small else large).append((block_type, euler))
    return small, large


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
    """True if the block stays at a place, by simulation too, and likewise up to 1 cm off.

    None where that is not sure, and where it stays on something else than what is marked.
    """
    put = lowered(block, plain.blocks, *at[:2])
    stays = stays_round(put, plain.blocks, _PLACE_RING_M)
    if verdict((*plain.blocks, put), put.order) is not stays:
        return None
    around = (put, *lowered_round(put, plain.blocks, _PLACE_RING_M))
    heights_m = [abs(float(bounds_m(one)[0, 2]) - at[2]) for one in around]
    return None if stays and max(heights_m) > _SAME_HEIGHT_M else stays
