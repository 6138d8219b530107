"""CF, PD, AD: what moves when a block goes or comes.

Questions are proposed by statics alone; simulations confirm those that are selected.

CF: the block that goes supports others of the scene. It is marked in the picture, so that no word
of the question hints at the answer.

PD: four pictures show the same blocks laid on an unfinished structure, of which one stays. It is as
often any of the four in order of how far the weights lean to one side, so that where a picture's
change is tells nothing. Of these, drafts vary in how far its plank hangs over beside the others,
where planks that hang over as far count in an order drawn.

AD: all places are on flat faces, and no more central where the block stays than elsewhere. Where it
stays it comes down on the face that is marked. Elsewhere a plank tips under it, as far as such
places are found, or it meets a neighbor first.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

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
from phyblock.making.questions.base import Draft, Maker, UnfairError, View, pick, shuffled
from phyblock.making.questions.structures import (
    SPARE_M,
    Bench,
    bench,
    group_of,
    is_sure,
    lowered,
    lowered_round,
    stays_round,
    surely_stays,
    verdict,
    with_annex,
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
    Top,
    block_mark,
    is_apart,
    is_inside,
    mark_pixel,
    seen,
    seen_order,
    shown_pixels,
    visible_tops,
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
_LEAN, _LEAST_ACROSS = 2.0, 0.5
_SIDES_XY = ((1, 0), (-1, 0), (0, 1), (0, -1))
_PLANS, _FOURS = 400, 4000


class PredictiveMaker(Maker):
    """Kind: `pd-next`, the next step after which all stays."""

    subtask: Subtask = "PD"
    count = 100
    spare, doubtful = 4.7, 1.75
    drafts_a_scene = 3

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose stages of building and ways to go on, of which one stays.

        The kind is the place of that one by its lean, and its rank by how far the plank hangs over.
        """
        for _ in range(self.drafts_a_scene):
            place, rank = (int(number) for number in rng.integers(len(LETTERS), size=2))
            tried = (_next_steps(scene, place, rank, rng) for _ in range(_BENCHES_TRIED))
            first = itertools.islice(itertools.chain.from_iterable(tried), 1)
            yield from (draft for draft in first if _is_told(draft))

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Decide by statics and simulation."""
        base.slots_of(question)
        shown, options = sight.picture_of(question, "scene"), sight.option_pictures(question)
        return base.only_index([_can_follow(shown, one) for one in options])


def _next_steps(scene: Scene, place: int, rank: int, rng: np.random.Generator) -> Iterator[Draft]:
    """Yield a question about a bench drawn, as far as one has such plans for it."""
    on = bench(scene, 2, rng)
    plans = four_plans(on, place, rank, rng) if on else ()
    every = [blocks for offs_m in plans if on and (blocks := on.laid(offs_m))]
    if on is None or len(every) < len(LETTERS):
        return
    view, framed = base.drawn_view(rng, _ELEVATIONS_DEG), _framed(every)
    plain = QuestionPicture("scene", on.base, view, framed=framed)
    options = [replace(plain, blocks=blocks) for blocks in every]
    if (
        sight.are_told_apart(options)
        and min(min(shown_pixels(one, seen(one)).values()) for one in options) >= _SHOWN
        and [surely_stays(p.blocks, p.blocks[-1].order) for p in options] == _ONE_STAYS
    ):
        facts, kind = {"placed": sight.orders_of(on.base)}, f"place {place}, plank {rank}"
        yield Draft(scene, "pd-next", tuple(options), (plain,), {}, facts, kind)


def _is_told(draft: Draft) -> bool:
    """True if the line of the plank runs across the view, and the right picture's blocks by statics
    stay on a floor that leans twice as far as those of simulations, where they are let go at once.
    """
    shown, right = draft.pictures[0], draft.options[0]
    if not isinstance(right, QuestionPicture):
        return False
    plank = right.blocks[len(shown.blocks)]
    line = np.eye(3)[int(np.diff(bounds_m(plank), axis=0)[0, :2].argmax())]
    group, slope = group_of(right.blocks, plank.order), _LEAN * math.tan(math.radians(LEAN_DEG))
    return bool(abs(line @ view_axes(*shown.view_deg)[0]) >= _LEAST_ACROSS) and all(
        is_balanced(group, (x * slope, y * slope)) for x, y in _SIDES_XY
    )


def four_plans(on: Bench, place: int, rank: int, rng: np.random.Generator) -> list[list[float]]:
    """Return how far each loose block is off the middle of the top [m], in four ways: by a lever,
    with margins, all stays in the first only; empty where none are found.

    So many of the others lean less to one side, and in so many the plank hangs over less.
    """
    near, far = on.limits_m
    plans = on.plans_m(_PLANS, rng)
    is_free = np.abs(plans[:, 1] - plans[:, 2]) >= on.lengths_m[1:].mean() + SPARE_M
    plans = plans[is_free]
    leans = on.leans_m(plans)
    (stays,), (falls,) = np.nonzero(np.abs(leans) <= near), np.nonzero(np.abs(leans) >= far)
    if not len(stays) or not len(falls):
        return []
    wrong = rng.choice(falls, size=(_FOURS, len(LETTERS) - 1))
    fours = np.column_stack([rng.choice(stays, size=_FOURS), wrong])
    gaps = np.diff(np.sort(leans[fours], axis=1), axis=1)
    # Of plans that hang over as far, one is drawn.
    over = np.abs(plans[fours, 0]) + rng.uniform(0, SPARE_M, size=fours.shape)
    fitting = (gaps.min(axis=1) >= far - near) & ((gaps[:, :-1] + gaps[:, 1:]).min(axis=1) >= far)
    fitting &= (leans[fours] < leans[fours[:, :1]]).sum(axis=1) == place
    fitting &= (over < over[:, :1]).sum(axis=1) == rank
    chosen = fours[pick(rng, np.flatnonzero(fitting).tolist())] if fitting.any() else ()
    found: list[list[float]] = plans[chosen].tolist() if len(chosen) else []
    return found


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
_ANNEXED, _STRUCTURES_TRIED, _PROPOSED = 0.6, 3, 6
_STEP_PX, _APART_PX, _FLAT_RISE = 5, 18.0, 0.99
_OFF_CENTER_M, _MOST_OF_A_FACE = 0.001, 0.8
_PLACES_TRIED, _GIVEN_UP, _SORT = 60, 20, 8
_SAME_HEIGHT_M, _CLEARLY_HIGHER_M = 0.001, 0.01


class AffordanceMaker(Maker):
    """Kind: `ad-place`."""

    subtask: Subtask = "AD"
    count = 50
    spare, doubtful = 2.0, 1.6

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose a block in a pose drawn, one place where it stays, and three where not."""
        for _ in range(_STRUCTURES_TRIED):
            blocks = (with_annex(scene, rng) if rng.random() < _ANNEXED else None) or scene.blocks
            plain = QuestionPicture("scene", blocks, base.drawn_view(rng))
            if not sight.are_seen(plain, sight.orders_of(blocks), _ALL_SEEN):
                continue
            if not all(map(surely_stands, groups(blocks))):
                continue
            tops = visible_tops(plain, seen(plain), _STEP_PX, _FLAT_RISE)
            block = _drawn_block(plain, rng)
            staying, wrong = _by_statics(plain, block, shuffled(rng, tops))
            both = [*staying, *wrong]
            if not staying or not wrong:
                continue
            pixels = np.array([mark_pixel(plain, top.position_m) for top in both], dtype=float)
            unlike = np.linalg.norm(pixels[:, None] - pixels, axis=2)
            measures = np.array([_looks_of_place(plain, top) for top in both])
            for _ in range(_PROPOSED):
                four = base.four_alike(measures, unlike, _APART_PX, rng, rights=len(staying))
                puts = [lowered(block, blocks, *both[i].position_m[:2]) for i in four]
                if four and None not in (stays_round(one, blocks, _PLACE_RING_M) for one in puts):
                    shown = (plain, QuestionPicture(BLOCK_LABEL, (block,), plain.view_deg))
                    marks = tuple(Mark("A", both[i].position_m) for i in four)
                    facts = {"block": block.type, "euler": list(block.euler_deg)}
                    slots = {"size": _size(block)}
                    yield Draft(scene, "ad-place", marks, shown, slots, facts)
                    break

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


def _drawn_block(plain: QuestionPicture, rng: np.random.Generator) -> Block:
    """Return a block to put down, in a pose whose shape the picture's view shows."""
    order = max(block.order for block in plain.blocks) + 1
    while True:
        block_type, euler = pick(rng, _balanced_poses())
        block = Block(order, block_type, pick(rng, COLORS), (0.0, 0.0, 0.0), euler, (), 1)
        if shows_solid(block, plain.view_deg):
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


def _by_statics(
    plain: QuestionPicture, block: Block, tops: Sequence[Top]
) -> tuple[list[Top], list[Top]]:
    """Return places where a block surely stays by statics on the face that is marked, and where
    not: it falls off that face, or meets a neighbor first and falls.
    """
    found: dict[bool, list[Top]] = {True: [], False: []}
    marks: list[Mark] = []
    for number, top in enumerate(tops[:_PLACES_TRIED]):
        if number == _GIVEN_UP and not found[True]:
            break
        mark = Mark("A", top.position_m)
        put = lowered(block, plain.blocks, *top.position_m[:2])
        blocks, is_on = (*plain.blocks, put), is_on_face(plain, put, top.position_m)
        stays = is_balanced(group_of(blocks, put.order))
        if is_on is None or (stays and not is_on) or len(found[stays]) == _SORT:
            continue
        if is_apart(plain, mark, marks, _APART_PX / 2) and is_inside(replace(plain, marks=(mark,))):
            marks.append(mark)
            if surely_stays(blocks, put.order) is stays:
                found[stays].append(top)
    return found[True], found[False]


def _looks_of_place(plain: QuestionPicture, top: Top) -> tuple[float, ...]:
    """Return measures of a place, in the world and the picture, by which it might stand out."""
    shot = seen(plain)
    row, column = mark_pixel(plain, top.position_m)
    under = shot.block == shot.block[row, column]
    room_px = np.linalg.norm(np.argwhere(~under) - (row, column), axis=1).min()
    middle = np.mean([bounds_m(block).mean(axis=0) for block in plain.blocks], axis=0)
    rows, columns = np.nonzero(shot.block >= 0)
    x, y, z = top.position_m
    return (
        20 * top.off_center_m,
        float(room_px) / 10,
        10 * z,
        3 * float(np.hypot(x - middle[0], y - middle[1])),
        (row - float(rows.mean())) / 30,
        (column - float(columns.mean())) / 30,
        abs(column - float(columns.mean())) / 30,
        5 * float(under.sum() / len(rows)),
    )


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
