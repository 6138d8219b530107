"""CF, PD, AD: effects of removing or adding blocks.

Questions are proposed by statics alone; simulations confirm those that are selected. The block that
CF removes is marked in the picture, so that no word hints at the answer. The right options of PD
and AD have each rank about equally often in measures to guess by (`four_plans`, `four_of`).
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import COLORS, SHAPES, BlockType, Euler
from phyblock.domain.question import LETTERS, Mark, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions import base, sight
from phyblock.making.questions.base import Draft, Floats, Maker, Slots, UnfairError, pick, shuffled
from phyblock.making.scenes.sketch import lowered
from phyblock.sim import contact
from phyblock.sim import question_pictures as drawn
from phyblock.sim.balance import MARGIN_M, is_balanced, surely_falls, surely_stands
from phyblock.sim.contact import GROUND, Turned, bounds_m, support_graph
from phyblock.sim.dynamics import LEAN_DEG, after_removal, groups, holds
from phyblock.sim.geometry import corners_m
from phyblock.sim.question_pictures import is_inside, mark_pixel, seen, shown_pixels
from phyblock.sim.raster import view_axes

Ints = NDArray[np.int64]
Lot = frozenset[int]
"""Orders of blocks that move."""
_ALL_SEEN = 0.12
"""Minimum visible share of every block of a structure."""
# The support graph is needed again for every block of a structure.
_below = functools.lru_cache(maxsize=64)(support_graph)

# Verdicts of statics and simulation

_DIRECTIONS = 8


def new_block(pose: Turned, order: int, rng: np.random.Generator) -> Block:
    """Return a block of a random color in a pose, at the origin."""
    return replace(contact.at(pose), order=order, color=pick(rng, COLORS))


def lowered_round(put: Block, onto: Sequence[Block], radius_m: float) -> Iterator[Block]:
    """Yield the block lowered again at this distance [m] in each of eight directions."""
    x, y, _ = bounds_m(put).mean(axis=0).tolist()
    for number in range(_DIRECTIONS):
        angle = 2 * math.pi * number / _DIRECTIONS
        yield lowered(put, onto, x + radius_m * math.cos(angle), y + radius_m * math.sin(angle))


def surely_stays(blocks: Sequence[Block], order: int) -> bool | None:
    """True if by statics one of the blocks and all near it stay; None if unsure."""
    group = group_of(blocks, order)
    if is_balanced(group):
        return True if surely_stands(group) else None
    return False if surely_falls(group) else None


def stays_round(put: Block, onto: Sequence[Block], radius_m: float) -> bool | None:
    """True if by statics a lowered block stays, here and all around; None if unsure."""
    stays = surely_stays((*onto, put), put.order)
    is_alike = stays is not None and all(
        is_balanced(group_of((*onto, moved), moved.order)) is stays
        for moved in lowered_round(put, onto, radius_m)
    )
    return stays if is_alike else None


def group_of(blocks: Sequence[Block], order: int) -> tuple[Block, ...]:
    """Return the blocks in reach of one, including that one."""
    return next(group for group in groups(blocks) if any(b.order == order for b in group))


def is_sure(left: Sequence[Block], moved: Collection[int]) -> bool:
    """True if statics are sure of the outcome of a simulation.

    The blocks that stay stand without the moved ones, and cannot hold any lot of these: with every
    weight 5 mm off to any side, other masses, and friction to spare.
    """
    still = [block for block in left if block.order not in moved]
    lots = sight.lots_of([block for block in left if block.order in moved])
    falls = (surely_falls([*still, *lot]) for lot in lots)
    return all(map(surely_stands, groups(still))) and all(falls)


def resting_on(blocks: Sequence[Block], order: int, *, only: bool = False) -> Lot:
    """Return the orders of the blocks that rest on a block, directly or not, without its own.

    With `only`, they rest on nothing else. By naive rules, exactly these fall when it is removed.
    """
    found, below = frozenset({order}), _below(tuple(blocks)).items()
    for _ in blocks:
        found |= {one for one, under in below if under & found and (not only or under <= found)}
    return found - {order}


# CF

TAKEN = "X"
"""The letter of the removed block."""
OUTCOME_TEXTS: tuple[str, ...] = tuple(base.WORDS["outcomes_of_removal"])
"""Outcomes of a removal, by the number of other blocks that move; all are offered."""
_VIEWS_TRIED, _REMOVALS_TRIED = 3, 4
_MOST_LOTS, _MOST_TOGETHER = 40, 3
_COLORS = tuple(itertools.permutations(sight.PLAIN_COLORS))
"""The colors of blocks that move, of blocks that stay, and of the removed block."""


class CounterfactualMaker(Maker):
    """Kinds: `cf-count` (texts) and `cf-color` (pictures that highlight the blocks that move)."""

    subtask: Subtask = "CF"
    spare, doubtful = 6.0, 1.3
    drafts_a_scene = 3

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask about removals of blocks that others rest on."""
        carrying = frozenset[int]().union(*_below(scene.blocks).values())
        asked = [block.order for block in scene.blocks if block.order in carrying]
        for order in shuffled(rng, asked)[:_REMOVALS_TRIED]:
            # From a view that shows all blocks, with the removed block marked.
            for _ in range(_VIEWS_TRIED):
                plain = QuestionPicture("scene", scene.blocks, base.drawn_view(rng))
                mark = drawn.block_mark(plain, seen(plain), order, TAKEN)
                if (
                    mark
                    and sight.are_seen(plain, sight.NAMED, [order])
                    and sight.are_seen(plain, _ALL_SEEN)
                ):
                    break
            else:
                continue
            shown, moved = replace(plain, marks=(mark,)), falling(scene.blocks, order)
            if moved is None or not sight.are_seen(shown, sight.COUNTED, moved):
                continue
            facts = {"removed": order, "moved": sorted(moved)}
            right = _outcome_text(len(moved))
            options = (right, *shuffled(rng, [text for text in OUTCOME_TEXTS if text != right]))
            yield Draft("cf-count", scene, (shown,), {}, options, facts=facts, about=order)
            slots, pictures = _by_colors(shown, order, moved, rng)
            if pictures:
                yield Draft("cf-color", scene, (shown,), slots, pictures, "", facts, about=order)

    def answer(self, asked: Draft) -> tuple[int, ...]:
        """Simulate the removal again."""
        shown = asked.picture
        order = sight.marked(shown, TAKEN)[1]
        moved = falling(shown.blocks, order)
        outcome = None if moved is None else after_removal(shown.blocks, order)
        if moved is None or not outcome or not outcome.is_clear or set(outcome.moved) != moved:
            raise UnfairError(f"it is not sure what follows without block {order}")
        if not any(order in block.depend for block in shown.blocks):
            raise UnfairError(f"block {order} supports no other")
        sight.require_seen(shown, sight.NAMED, [sight.block_of(shown.blocks, order)])
        if asked.wording == "cf-count":
            right = _outcome_text(len(moved))
            return base.only_index([option == right for option in asked.options])
        told = [sight.lot_of(one, shown.blocks, asked.slots, order) for one in asked.drawn]
        return base.only_index([one == moved for one in told])


def _outcome_text(count: int) -> str:
    return OUTCOME_TEXTS[min(count, len(OUTCOME_TEXTS) - 1)]


def falling(whole: Sequence[Block], order: int) -> Lot | None:
    """Return the orders of the blocks that by statics move when one is removed.

    They are next to it, or rest on those; None if unsure, or if some would stay on edges alone.
    """
    blocks = group_of(whole, order)
    left, below = [block for block in blocks if block.order != order], _below(blocks)
    near = [o for o in below if order in below[o]] or [o for o in below[order] if o in below]
    with_load = [(frozenset({o}) | resting_on(blocks, o)) - {order} for o in near]
    for lot in sorted(_joined(with_load, len(with_load)), key=sorted):
        still = [block for block in left if block.order not in lot]
        loose = sight.lots_of([block for block in left if block.order in lot])
        is_so = is_balanced(still) and not any(is_balanced([*still, *one]) for one in loose)
        if is_so and surely_stands(blocks) and is_sure(left, lot):
            return None if balances_on_edges(blocks, order, lot) else lot
    return None


def balances_on_edges(blocks: Sequence[Block], order: int, moved: Lot) -> bool:
    """True if a block that rested on the removed one stays on edges alone: nobody can tell."""
    still = [block for block in blocks if block.order not in moved | {order}]
    flat, below = support_graph(still, only_areas=True), _below(tuple(blocks))
    return any(order in under and not flat.get(one, True) for one, under in below.items())


def _joined(lots: Sequence[Lot], most: int, enough: int | None = None) -> set[Lot]:
    """Return the unions of 0 to `most` lots; of fewer if these give more than `enough`."""
    found = {frozenset[int]()}
    for number in range(1, most + 1):
        found |= {frozenset[int]().union(*some) for some in itertools.combinations(lots, number)}
        if enough is not None and len(found) > enough:
            break
    return found


def _by_colors(
    shown: QuestionPicture, order: int, moved: Lot, rng: np.random.Generator
) -> tuple[Slots, Sequence[QuestionPicture]]:
    """Return colors, and four pictures that highlight blocks: first those that move, then three
    other sets with all that rests on them. No pictures if there are no such sets.
    """
    plain = replace(shown, marks=())
    share, left = sight.sizes(plain).shown, [b for b in plain.blocks if b.order != order]
    with_load = [frozenset({b.order}) | resting_on(left, b.order) for b in left]
    found = _joined(with_load, _MOST_TOGETHER, _MOST_LOTS)
    fair = [lot for lot in found if lot != moved and all(share[o] >= sight.COUNTED for o in lot)]
    lots = [moved, *shuffled(rng, sorted(fair, key=sorted))[:_MOST_LOTS]]
    pixels = shown_pixels(plain, seen(plain))
    unlike = np.array([[sum(pixels[o] for o in a ^ b) for b in lots] for a in lots], dtype=float)
    # Area, number and place of highlighted blocks, and differences from naive rules.
    block_at, looks = seen(plain).block, list[tuple[float, ...]]()
    side, area = len(block_at) / 20, max(int((block_at >= 0).sum()), 1) / 20
    fall_by_rule = [resting_on(plain.blocks, order, only=only) for only in (False, True)]
    for lot in lots:
        vertices = [i for i, block in enumerate(plain.blocks) if block.order in (lot or {order})]
        rows, columns = np.nonzero(np.isin(block_at, vertices))
        places = (rows.mean(), columns.mean(), rows.min(), rows.max())
        size = (len(rows) / area if lot else 0.0, float(len(lot)))
        unlike_rules = (float(len(lot ^ one)) for one in fall_by_rule)
        looks.append((*size, *(float(x) / side for x in places), *unlike_rules))
    four = base.four_alike(np.array(looks), unlike, sight.LEAST_PIXELS, rng)
    slots = dict(zip(("color", "other", "taken"), pick(rng, _COLORS), strict=True))
    shades = [sight.highlighted(plain.blocks, lots[place], slots, order) for place in four]
    options = [replace(plain, blocks=blocks) for blocks in shades]
    return slots, options if options and sight.are_told_apart(options) else ()


# PD: structures of the data set stand at every step, few of their blocks have more supports than
# they need, and none is held down by a weight. So planks with weights are laid on them.

SPARE_M = 0.0005
"""Added to the margin of statics around the support, since positions are rounded [m]."""
UNIT_M = 0.0125
"""Step between places along a plank [m]."""
THIN_M, WIDE_M, _PILLAR_OFF_M = 0.025, 0.05, 0.0125
"""Thicknesses of pillars, and offset of thin ones from the middle of a top [m]."""
_FLAT: Euler = (0.0, 0.0, 0.0)
WEIGHTS: tuple[tuple[BlockType, Euler], ...] = (
    *(("cube", _FLAT), ("cylinder", _FLAT), ("cuboid2", (0.0, 90.0, 0.0))),
    *(("cuboid2", (0.0, 0.0, 90.0)), ("cuboid3", (0.0, 90.0, 0.0))),
)
_PLANKS: tuple[BlockType, ...] = ("cuboid3", "cuboid3", "cuboid2")
_MOST_LEFT_OUT, _WEIGHTS_LAID = 5, 2
_FLAT_M, _LEAST_TOP_M, _HIGHEST_M = 0.0005, 0.045, 0.2


class Bench(NamedTuple):
    """A nearly finished structure, with loose blocks to lay along a line over one of its flat tops.

    The first loose block is a plank that lies on the top, the others are weights on it: a balance,
    or a cantilever held by a weight. Offsets along the line count from the middle of the top.
    """

    base: tuple[Block, ...]
    top: Block
    along: int
    loose: tuple[Block, ...]

    def laid(self, offs_m: Sequence[float]) -> tuple[Block, ...] | None:
        """Return all blocks, the loose ones at these offsets [m]; None if any overlap."""
        middle, blocks = bounds_m(self.top).mean(axis=0), self.base
        for block, off_m in zip(self.loose, offs_m, strict=True):
            x, y = (float(middle[i]) + (off_m if i == self.along else 0.0) for i in (0, 1))
            onto = blocks[len(self.base) :][:1] or [self.top]
            blocks = (*blocks, lowered(block, onto, x, y))
        return None if contact.find_overlaps(blocks) else blocks

    @property
    def limits_m(self) -> tuple[float, float]:
        """Offsets of the center of mass [m] up to which all stay, and from which they fall."""
        reach_m = float(np.ptp(bounds_m(self.top)[:, self.along])) / 2
        return reach_m - MARGIN_M - SPARE_M, reach_m + MARGIN_M + SPARE_M

    @property
    def middle_m(self) -> float:
        """Offset of the middle of the structure [m]."""
        middle = contact.whole_bounds_m(self.base).mean(axis=0) - bounds_m(self.top).mean(axis=0)
        return float(middle[self.along])

    def plans_m(self, count: int, rng: np.random.Generator) -> Floats:
        """Return random offsets of loose blocks, (plans, blocks) [m]: of `count` plans, those whose
        weights are apart.
        """
        plank_m, *weights_m = (np.ptp(bounds_m(one)[:, self.along]) for one in self.loose)
        half = int(plank_m / UNIT_M / 2)
        steps = rng.integers(1 - half, half, size=(count, len(self.loose)))
        plans: Floats = steps.astype(np.float64) * UNIT_M
        plans[:, 1:] += plans[:, :1]
        is_apart = np.ptp(plans[:, 1:], axis=1) >= np.mean(weights_m) + SPARE_M
        return np.asarray(plans[is_apart])

    def leans_m(self, plans_m: Floats) -> Floats:
        """Return the offset of the center of mass, by plan [m]."""
        masses = np.array([SHAPES[block.type].mass_kg for block in self.loose])
        leans: Floats = plans_m @ masses / masses.sum()
        return leans


def free_tops(blocks: Sequence[Block]) -> list[Block]:
    """Return blocks that are square to the axes, not too high, and free on a flat top."""
    carrying = {order for block in blocks for order in block.depend}
    tops = []
    for block in blocks:
        corners = corners_m(block.type, block.position_m, block.euler_deg)
        high_m = float(corners[:, 2].max())
        flat = corners[corners[:, 2] > high_m - _FLAT_M, :2]
        is_wide = bool(np.ptp(flat, axis=0).min() >= _LEAST_TOP_M)
        if block.order not in carrying and is_square(block) and is_wide and high_m <= _HIGHEST_M:
            tops.append(block)
    return tops


def is_square(block: Block) -> bool:
    """True if the sides of a block are square to the axes."""
    return all(abs(angle % 90.0) < 1e-6 for angle in block.euler_deg)


@functools.cache
def pillars(along: int, thick_m: float) -> list[Turned]:
    """Return blocks to lay a plank on, in poses with this thickness along an axis."""
    return [
        (block_type, euler)
        for block_type in ("cuboid1", "cuboid2")
        for euler in SHAPES[block_type].poses.values()
        if abs(np.ptp(corners_m(block_type, (0.0, 0.0, 0.0), euler)[:, along]) - thick_m) < _FLAT_M
    ]


def bench(
    base: tuple[Block, ...], top: Block, first: int, rng: np.random.Generator, *, has_pillar: bool
) -> Bench:
    """Return a bench on a top or on a thin pillar on it, with new blocks of orders from `first`."""
    along = int(rng.integers(2))
    if has_pillar:
        pillar = new_block(pick(rng, pillars(along, THIN_M)), first, rng)
        at = bounds_m(top).mean(axis=0)[:2]
        at[along] += int(rng.integers(-1, 2)) * _PILLAR_OFF_M
        top, first = lowered(pillar, base, *at.tolist()), first + 1
        base = (*base, top)
    kinds = [(pick(rng, _PLANKS), _FLAT), *(pick(rng, WEIGHTS) for _ in range(_WEIGHTS_LAID))]
    loose = tuple(
        new_block((block_type, (roll, pitch, (yaw + 90.0 * along) % 180.0)), order, rng)
        for order, (block_type, (roll, pitch, yaw)) in enumerate(kinds, first)
    )
    return Bench(base, top, along, loose)


_BENCHES_TRIED, _SHOWN, _ONE_STAYS = 80, 60, [True, False, False, False]
_ELEVATIONS_DEG = (20, 38)
_LEAST_ACROSS, _ON_A_PILLAR = 0.5, 0.8
_LEAN = 2.0 * math.tan(math.radians(LEAN_DEG))
"""Slope of a floor on which the right plank also stays: twice the tilt of simulations, which
release all blocks at once."""
_LEANS = ((_LEAN, 0.0), (-_LEAN, 0.0), (0.0, _LEAN), (0.0, -_LEAN))
_PLANS, _FOURS = 400, 4000
_OVER = (0, 1, 1, 2, 2, 2)
"""Wanted ranks of the right plank's overhang; the higher, the harder it is to find."""


class PredictiveMaker(Maker):
    """Kind: `pd-next`, the next step after which all blocks stay."""

    subtask: Subtask = "PD"
    count = 100
    spare, doubtful = 4.7, 1.75
    drafts_a_scene = 3

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose unfinished structures and next steps, only one of which stays in place."""
        for _ in range(self.drafts_a_scene):
            ranks = (pick(rng, _OVER), int(rng.integers(len(LETTERS))))
            tried = (_next_steps(scene, ranks, rng) for _ in range(_BENCHES_TRIED))
            yield from itertools.islice(filter(None, tried), 1)

    def answer(self, asked: Draft) -> tuple[int, ...]:
        """Decide by statics and simulation."""
        placed, stays = set(sight.orders_of(asked.picture.blocks)), []
        for option in asked.drawn:
            added = [block for block in option.blocks if block.order not in placed]
            kept = tuple(block for block in option.blocks if block.order in placed)
            if not added or kept != asked.picture.blocks:
                raise UnfairError(f"picture {option.label} does not add to the structure")
            stays.append(surely_stays(option.blocks, added[0].order))
            if stays[-1] is None or holds(option.blocks, added[0].order) is not stays[-1]:
                raise UnfairError(f"it is not sure whether all stays in picture {option.label}")
        return base.only_index(stays)


def _next_steps(scene: Scene, ranks: tuple[int, int], rng: np.random.Generator) -> Draft | None:
    """Return a question about a bench on a nearly finished scene, or None if none was found."""
    order = scene.graph.random_order(rng)
    kept = len(order) - int(rng.integers(min(_MOST_LEFT_OUT, max(len(order) - 2, 0)) + 1))
    stages = tuple(scene.blocks[vertex] for vertex in sorted(order[:kept]))
    if not (tops := free_tops(stages)):
        return None
    has_pillar = rng.random() < _ON_A_PILLAR
    first = max(sight.orders_of(scene.blocks)) + 1
    on = bench(stages, pick(rng, tops), first, rng, has_pillar=has_pillar)
    every = [blocks for offs_m in four_plans(on, ranks, rng) if (blocks := on.laid(offs_m))]
    if len(every) < len(LETTERS):
        return None
    view = base.drawn_view(rng, _ELEVATIONS_DEG)
    # All pictures are framed on the blocks of all of them.
    poses = {(block.type, block.position_m, block.euler_deg): block for s in every for block in s}
    framed = tuple(replace(block, order=i) for i, block in enumerate(poses.values(), 1))
    plain = QuestionPicture("scene", on.base, view, framed=framed)
    options = [replace(plain, blocks=blocks) for blocks in every]
    if (
        abs(view_axes(*view)[0][on.along]) >= _LEAST_ACROSS
        and sight.are_told_apart(options)
        and min(min(shown_pixels(one, seen(one)).values()) for one in options) >= _SHOWN
        and [surely_stays(p.blocks, p.blocks[-1].order) for p in options] == _ONE_STAYS
        and all(is_balanced(group_of(every[0], every[0][-1].order), lean) for lean in _LEANS)
    ):
        facts, kind = {"placed": sight.orders_of(on.base)}, f"plank {ranks[0]}"
        return Draft("pd-next", scene, (plain,), {}, options, kind, facts)
    return None


def four_plans(on: Bench, ranks: tuple[int, int], rng: np.random.Generator) -> list[list[float]]:
    """Return four plans or none: only the first has its center of mass over the support, clearly.

    Its `ranks` are by the plank's overhang, and how far the center of mass is from the middle.
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
    """Return random fours, (n, 4), or none, in which the first stays and the others fall."""
    if not stays.any() or not falls.any():
        return np.empty((0, len(LETTERS)), dtype=np.int64)
    wrong = rng.choice(np.flatnonzero(falls), size=(_FOURS, len(LETTERS) - 1))
    return np.column_stack([rng.choice(np.flatnonzero(stays), size=_FOURS), wrong])


def ranks_of(fours: Floats) -> Ints:
    """Return the number of each four, (n, 4), below the first; -1 if one is equal to it."""
    steps = fours[:, 1:] - fours[:, :1]
    is_apart = (np.abs(steps) >= SPARE_M).all(axis=1)
    return np.where(is_apart, (steps < 0).sum(axis=1), -1)


# AD

Place = tuple[float, float, float]
"""A point of the world [m]."""
STAYS, IN_THE_WAY, TIPS = range(1, 4)
"""Outcomes for a block set down: it stays, tips off a higher neighbor, or tips its support."""
_PLACE_RING_M, _WIDE_RING_M = 0.005, 0.01
"""Distances around a place at which its verdict holds, too: in answers and in proposals [m]."""
_STRUCTURES_TRIED, _AREA_M2, _ROUND_PX = 60, 0.0003, 2
_MOST_OF_SCENE, _ADDED, _BESIDE = 3, (8, 13), (0, 2)
"""Maximum number of blocks of a scene; ranges of blocks added, and beside or on each plank."""
_LONG: tuple[BlockType, ...] = ("cuboid2", "cuboid3")
_SET_DOWN = [(one, euler) for one in _LONG for euler in SHAPES[one].poses.values()]
"""The blocks to set down, with their poses."""
_AWAY_M, _GAPS_M, _ODDS_ON = (0.075, 0.125), (0.0, 0.0125, 0.025, 0.0375), 0.25
_SIDES_OF_SCENE = [(x, y) for x, y in itertools.product((-1, 0, 1), repeat=2) if x or y]
_PILLARS_M: tuple[tuple[tuple[float, ...], float], ...] = (
    *(((-0.005,), THIN_M), ((0.005,), THIN_M), ((-0.0175,), WIDE_M), ((0.0175,), WIDE_M)),
    *(((-0.05, 0.05), THIN_M), ((-0.0375, 0.05), THIN_M), ((-0.05, 0.05), WIDE_M), ((), THIN_M)),
)
"""Offsets of pillars from the middle of a plank, and their thickness [m]."""
_VIEWED_FROM_DEG, _PLAINLY_ACROSS, _HANGS_M, _HELD_M = (24, 38), 0.85, 0.02, 0.0075
_INSIDE_M, _CLEAR_M = 0.01, 0.025
_OVER_M, _OUT_M, _LEANS_OUT_M, _OFF_CONTACT_M = 0.005, 0.0225, 0.0075, 0.01
_SAME_HEIGHT_M, _CLEARLY_HIGHER_M = 0.001, 0.01


class AffordanceMaker(Maker):
    """Kind: `ad-place`."""

    subtask: Subtask = "AD"
    spare, doubtful = 2.5, 1.2
    drafts_a_scene = 3

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose a block in a random pose, a place where it stays, and three where it does not."""
        for _ in range(self.drafts_a_scene):
            rank = int(rng.integers(len(LETTERS)))
            tried = (_set_down(scene, rank, rng) for _ in range(_STRUCTURES_TRIED))
            yield from itertools.islice(filter(None, tried), 1)

    def answer(self, asked: Draft) -> tuple[int, ...]:
        """Decide by statics and simulation at every place, and by statics all around it."""
        shown, alone = asked.pictures
        block = alone.blocks[0]
        is_alone = alone.label == drawn.BLOCK_LABEL and len(alone.blocks) == 1
        if not is_alone or asked.slots["size"] != _size(block):
            raise UnfairError("the second picture is not of one block of the size in the text")
        sight.require_seen(shown, _ALL_SEEN)
        plain, stays = replace(shown, marks=()), []
        for letter in LETTERS:
            stays.append(stays_at(plain, block, sight.marked(shown, letter)[0]))
            if stays[-1] is None:
                raise UnfairError(f"it is not sure whether the block stays at place {letter}")
        return base.only_index(stays)


def _set_down(scene: Scene, rank: int, rng: np.random.Generator) -> Draft | None:
    """Return a question about places on part of a scene and on planks around it, or None.

    Of the three wrong places, `rank` are nearer to the middle of their block than the right one.
    """
    view = base.drawn_view(rng, _VIEWED_FROM_DEG)
    across = np.abs(view_axes(*view)[0])
    if across.max() < _PLAINLY_ACROSS:
        return None
    # The first blocks of the scene in some order, and planks set up around them. Planks that
    # overhang a single pillar do so along the axis that runs across the view.
    count, more = int(rng.integers(2, _MOST_OF_SCENE + 1)), int(rng.integers(*_ADDED))
    blocks = tuple(scene.blocks[i] for i in sorted(scene.graph.random_order(rng)[:count]))
    low, high = contact.whole_bounds_m(blocks)[:, :2]
    order = max(sight.orders_of(scene.blocks)) + 1
    for side in shuffled(rng, _SIDES_OF_SCENE):
        if len(blocks) < count + more:
            at_m = (low + high) / 2 + ((high - low) / 2 + rng.uniform(*_AWAY_M, size=2)) * side
            blocks = _with_plank(blocks, at_m, order, int(across.argmax()), rng)
            order = max(order, max(sight.orders_of(blocks)) + 1)
    plain = QuestionPicture("scene", blocks, view)
    if not is_inside(plain) or not sight.are_seen(plain, _ALL_SEEN):
        return None
    points, order = points_of(plain, rng), max(sight.orders_of(blocks)) + 1
    for pose in shuffled(rng, _SET_DOWN):
        block = new_block(pose, order, rng)
        four, kind = four_of(plain, points, outcomes_of(blocks, block, points), rank, rng)
        if not four:
            continue
        if not all(map(surely_stands, groups(blocks))):
            return None
        marks = tuple(Mark("A", (x, y, round(z, 6))) for x, y, z in points.at_m[four].tolist())
        puts = [lowered(block, blocks, *mark.position_m[:2]) for mark in marks]
        if [stays_round(put, blocks, _WIDE_RING_M) for put in puts] == _ONE_STAYS:
            shown = (plain, QuestionPicture(drawn.BLOCK_LABEL, (block,), view))
            facts = {"block": block.type, "euler": list(block.euler_deg)}
            slots = {"size": _size(block)}
            return Draft("ad-place", scene, shown, slots, marks, kind, facts)
    return None


def _with_plank(
    blocks: tuple[Block, ...], at_m: Floats, first: int, across: int, rng: np.random.Generator
) -> tuple[Block, ...]:
    """Return blocks with a plank on up to two pillars and others by it, or unchanged if unsure."""
    offs_m, thick_m = pick(rng, _PILLARS_M)
    along = across if len(offs_m) == 1 else int(rng.integers(2))
    pillar: Turned = pick(rng, pillars(along, thick_m))
    plank: Turned = ("cuboid3", (0.0, 0.0, 90.0 * along))
    on_m = [at_m + off_m * np.eye(2)[along] for off_m in offs_m]
    parts: list[tuple[Turned, Floats]] = [*((pillar, one) for one in on_m), (plank, at_m)]
    for _ in range(int(rng.integers(*_BESIDE))):
        other = pick(rng, WEIGHTS)
        sizes = [np.ptp(bounds_m(contact.at(one)), axis=0)[:2] for one in (plank, other)]
        off_m = (sizes[0] + sizes[1]) / 2 + pick(rng, _GAPS_M)
        off_m[int(rng.integers(2))] *= rng.random()
        beside_m = at_m + off_m * rng.choice((-1, 1), size=2)
        is_on = rng.random() < _ODDS_ON
        parts.append((other, pick(rng, on_m or [at_m]) if is_on else beside_m))
    laid = blocks
    for order, (pose, (x, y)) in enumerate(parts, first):
        laid = (*laid, lowered(new_block(pose, order, rng), laid, x, y))
        below, middle = _below(laid), bounds_m(laid[-1]).mean(axis=0)
        is_held = _out_m(middle[None], *_borne_by(laid[-1], laid, below))[0] <= -_HELD_M
        is_own = order <= first + len(offs_m) or below[order] <= {GROUND, *range(first, order)}
        if not is_held or not is_own:
            return blocks
    return laid


class Points(NamedTuple):
    """Points [m], (n, 3), and the index of the block that each is on."""

    at_m: Floats
    on: Ints


def points_of(plain: QuestionPicture, rng: np.random.Generator) -> Points:
    """Return random points well inside the flat tops of boxes, where the picture shows the point,
    the supports of the box, and, from the side, its overhang.
    """
    below, shot = _below(plain.blocks), seen(plain).block
    across = np.abs(view_axes(*plain.view_deg)[0][:2])
    at_m, on = list[Place](), list[int]()
    for i, block in enumerate(plain.blocks):
        box = bounds_m(block)[:, :2]
        room = np.ptp(box, axis=0) - 2 * _INSIDE_M
        hangs = np.abs(_borne_by(block, plain.blocks, below) - box).max(axis=0) > _HANGS_M
        if (
            not (SHAPES[block.type].is_box and is_square(block) and room.min() > 0)
            or across[hangs].min(initial=1.0) < _PLAINLY_ACROSS
            or not sight.are_seen(plain, sight.COUNTED, sight.all_below(block.order, below))
        ):
            continue
        count = math.ceil(np.ptp(box, axis=0).prod() / _AREA_M2)
        drawn_m = box[0] + _INSIDE_M + room * rng.random((count, 2))
        for x, y in (drawn_m.round(4) + 0.0).tolist():
            at = (x, y, float(bounds_m(block)[1, 2]))
            rows, columns = (slice(n - _ROUND_PX, n + _ROUND_PX + 1) for n in mark_pixel(plain, at))
            if (shot[rows, columns] == i).all():
                at_m.append(at)
                on.append(i)
    return Points(np.array(at_m).reshape(-1, 3), np.array(on, dtype=np.int64))


def outcomes_of(blocks: tuple[Block, ...], block: Block, points: Points) -> Ints:
    """Return the clear outcome of setting a block down at each point; 0 if it is not clear.

    A person can see that the block keeps 2.5 cm from everything higher than the point, or overlaps
    something by as much; and that the block below has supports under the point, or on both sides
    of it, or carries nothing else and has no support within 2.25 cm.
    """
    boxes = np.array([bounds_m(one) for one in blocks])
    (low, high), at = (boxes[:, i, :2] for i in (0, 1)), points.at_m[:, None]
    half = np.ptp(bounds_m(block), axis=0)[:2] / 2

    def meets(reach_m: Floats | float, above_m: float = _SAME_HEIGHT_M) -> NDArray[np.bool_]:
        """True for points within reach of a block that is higher by `above_m`, (points,)."""
        near = (low < at[..., :2] + reach_m) & (high > at[..., :2] - reach_m)
        is_met = near.all(axis=2) & (boxes[:, 1, 2] > at[..., 2] + above_m)
        return np.asarray(is_met.any(axis=1))

    is_clear = ~meets(half + _CLEAR_M)
    is_blocked = meets(half - _CLEAR_M, _CLEARLY_HIGHER_M) & ~meets(_OFF_CONTACT_M)
    # Stability of the block that it is set on.
    below, xy = _below(blocks), points.at_m[:, :2]
    borne = np.array([_borne_by(one, blocks, below) for one in blocks])[points.on].swapaxes(0, 1)
    masses = np.array([SHAPES[one.type].mass_kg for one in (block, *blocks)])
    share = (masses[0] / (masses[0] + masses[1:]))[points.on, None]
    leans = share * xy + (1 - share) * boxes.mean(axis=1)[points.on, :2]
    is_loaded = np.array([any(one.order in under for under in below.values()) for one in blocks])
    tips = (_out_m(xy, *borne) >= _OUT_M) & (_out_m(leans, *borne) >= _LEANS_OUT_M)
    is_held = _out_m(xy, *borne) <= -_OVER_M
    cases = [is_blocked, is_clear & is_held, is_clear & tips & ~is_loaded[points.on]]
    return np.select(cases, [IN_THE_WAY, STAYS, TIPS], 0)


def _borne_by(block: Block, blocks: Sequence[Block], below: sight.Below) -> Floats:
    """Return the corners (2, 2) of the box around a block's supports, seen from above [m]."""
    box = bounds_m(block)[:, :2]
    under = [bounds_m(one)[:, :2] for one in blocks if one.order in below[block.order]]
    if GROUND in below[block.order] or not under:
        return box
    ends = np.array(under)
    borne: Floats = np.clip([ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)], *box)
    return borne


def _out_m(at_m: Floats, low_m: Floats, high_m: Floats) -> Floats:
    """Return the distance of points outside of boxes seen from above, below 0 inside [m]."""
    outside: Floats = np.maximum(low_m - at_m[:, :2], at_m[:, :2] - high_m).max(axis=1)
    return outside


def four_of(
    plain: QuestionPicture, points: Points, outcomes: Ints, rank: int, rng: np.random.Generator
) -> tuple[list[int], str]:
    """Return points on four blocks, the first of them right, or none, and their kind.

    The kind has the ranks of the right one: `rank` by distance from the middle of its block, then
    by height, and by distance to the nearest higher block.
    """
    falls, tips = outcomes > STAYS, int((outcomes == TIPS).sum())
    if tips:
        # Keep at most as many points with something in the way as points that tip.
        falls[rng.permutation(np.flatnonzero(outcomes == IN_THE_WAY))[tips:]] = False
    fours = one_stays(outcomes == STAYS, falls, rng)
    pixels = np.array([mark_pixel(plain, at) for at in points.at_m.tolist()]).reshape(-1, 2)
    pairs = list(itertools.combinations(fours.T, 2))
    apart = np.array([np.linalg.norm(pixels[i] - pixels[j], axis=1) for i, j in pairs])
    is_other = np.array([points.on[i] != points.on[j] for i, j in pairs])
    fours = fours[(apart.min(axis=0) >= drawn.MARKS_APART_PX) & is_other.all(axis=0)]
    # Points that are nearly equal in a measure come in random order.
    boxes, at_m = np.array([bounds_m(block) for block in plain.blocks]), points.at_m
    off_m = np.linalg.norm((at_m - boxes.mean(axis=1)[points.on])[:, :2], axis=1)
    gaps_m = np.maximum(boxes[:, 0] - at_m[:, None], at_m[:, None] - boxes[:, 1])[..., :2]
    is_higher = boxes[:, 1, 2] > at_m[:, 2:] + _SAME_HEIGHT_M
    near_m = np.where(is_higher, np.linalg.norm(gaps_m.clip(0), axis=2), 1.0).min(axis=1)
    measures = np.array([off_m, at_m[:, 2], near_m]) + rng.random((3, len(at_m))) * 2 * SPARE_M
    ranks = np.array([ranks_of(measure[fours]) for measure in measures]).T
    is_fit = (ranks.min(axis=1) >= 0) & (ranks[:, 0] == rank)
    if not is_fit.any():
        return [], ""
    kinds, of_kind = np.unique(ranks[is_fit], axis=0, return_inverse=True)
    odds = (len(LETTERS) - kinds[:, 2]) ** 2
    kind = int(rng.choice(len(kinds), p=odds / odds.sum()))
    found: list[int] = pick(rng, fours[is_fit][of_kind.ravel() == kind]).tolist()
    return found, f"ranks {kinds[kind].tolist()}"


def _size(block: Block) -> str:
    """Return length, width and height of a block in its orientation, to half a centimeter."""
    *level, high = (round(float(side) * 200) / 2 for side in np.diff(bounds_m(block), axis=0)[0])
    return f"{max(level):g} by {min(level):g} cm, {high:g} cm high"


@functools.lru_cache(maxsize=64)
def stays_at(plain: QuestionPicture, block: Block, at: Place) -> bool | None:
    """True if the block stays at a place by simulation, and 5 mm around it by statics; None if that
    is not sure, or if it stays on something other than the marked block.
    """
    put = lowered(block, plain.blocks, *at[:2])
    stays = stays_round(put, plain.blocks, _PLACE_RING_M)
    if stays is None or holds((*plain.blocks, put), put.order) is not stays:
        return None
    around = (put, *lowered_round(put, plain.blocks, _PLACE_RING_M))
    heights_m = [abs(float(bounds_m(one)[0, 2]) - at[2]) for one in around]
    return None if stays and max(heights_m) > _SAME_HEIGHT_M else stays
