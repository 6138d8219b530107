"""CF, PD, AD: what moves when a block goes, comes, or is pushed.

Questions are proposed by statics alone; simulations confirm those that are selected.

CF: the block that goes is marked in the picture, so that no word of the question hints at the
answer. It supports others, all of the scene; or, as a kind of its own, it is a weight that holds
what it rests on.

PD: four pictures show the same blocks laid on an unfinished structure, of which one stays, or one
falls: what is right in one kind of question is wrong in the other. Or a block is pushed to the
right or left as seen, and all pictures show what pushes of it or its neighbors lead to.

AD: all places are on flat faces, and no more central where the block stays than elsewhere. Where it
stays it comes down on the face that is marked. Elsewhere a plank tips under it, as far as such
places are found, or it meets a neighbor first.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence
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
    arrangements,
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
from phyblock.sim.contact import bounds_m, boxes_near, support_graph
from phyblock.sim.dynamics import groups
from phyblock.sim.engine import Pose
from phyblock.sim.geometry import drawn_mesh
from phyblock.sim.outcomes import OUTCOME_SETTINGS, Outcome, Push, after, after_removal, has_moved
from phyblock.sim.pictures import Shot, drawn_m
from phyblock.sim.question_pictures import (
    BLOCK_LABEL,
    Top,
    block_mark,
    changed_pixels,
    differing_pixels,
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
"""The letter of the block that is taken away or pushed."""
Ints = NDArray[np.int64]
Lot = frozenset[int]
"""Orders of blocks that move."""
OUTCOME_TEXTS: tuple[str, ...] = tuple(base.WORDS["outcomes_of_removal"])
"""Outcomes of a removal, by the number of other blocks that do not stay; all are offered."""
_ALL_SEEN = 0.12
_VIEWS_TRIED, _REMOVALS_TRIED = 3, 4
_WEIGHTS_ASKED = 0.25
"""Of so many scenes the block that goes is a weight put on top."""
_MOST_LOTS, _MOST_TOGETHER = 40, 3
_COLORS = tuple(itertools.permutations(sight.PLAIN_COLORS))
"""The colors of what moves, of what stays, and of the block that is taken away."""


class CounterfactualMaker(Maker):
    """Kinds: `cf-count` (texts) and `cf-color` (what moves, by colors), where a support of the
    scene goes; `cf-weight` (texts), where a weight put on it goes. The former are asked as often
    where what rests on the block is what moves as where it is not.
    """

    subtask: Subtask = "CF"
    spare, doubtful = 6.0, 1.2
    drafts_a_scene = 3

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask about removals from the scene, or from a part of it with an annex."""
        is_weight = rng.random() < _WEIGHTS_ASKED
        blocks = (with_annex(scene, rng) if is_weight else scene.blocks) or ()
        below = _below(blocks)
        carrying = frozenset[int]().union(*below.values())
        asked = [o for o in below if (o > len(scene)) is is_weight and (o in carrying) != is_weight]
        for order in shuffled(rng, asked)[:_REMOVALS_TRIED]:
            shown = _pictured(blocks, order, rng)
            moved = falling(group_of(blocks, order), order) if shown else None
            if shown is None or moved is None or not sight.are_seen(shown, moved, sight.COUNTED):
                continue
            if is_weight:
                yield _count(scene, shown, order, moved, rng, "cf-weight", "cf-weight")
                return
            kind = "plain" if moved == resting_on(blocks, order) else "odd"
            yield _count(scene, shown, order, moved, rng, "cf-count", f"cf-count-{kind}")
            yield from _color(scene, shown, order, moved, rng, f"cf-color-{kind}")

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


def _count(
    scene: Scene,
    shown: QuestionPicture,
    order: int,
    moved: Lot,
    rng: np.random.Generator,
    stem: str,
    kind: str,
) -> Draft:
    """Ask how many blocks move."""
    right, *others = base.right_first(_outcome_text(len(moved)), OUTCOME_TEXTS)
    options = (right, *shuffled(rng, others))
    tops_m = {block.order: float(bounds_m(block)[1, 2]) for block in shown.blocks}
    bins = (int(3.99 * tops_m[order] / max(tops_m.values())), min(len(shown.blocks) // 4, 3))
    looks = np.zeros((len(options), len(options), len(bins), 4))
    for row, option in enumerate(options):
        looks[row, OUTCOME_TEXTS.index(option), range(len(bins)), bins] = 1.0
    facts, rows = {"removed": order, "moved": sorted(moved)}, looks.reshape(len(options), -1)
    return Draft(
        *(scene, stem, options, (shown,), {}, facts, kind),
        looks=tuple(map(tuple, rows.tolist())),
        about=order,
    )


def _color(
    scene: Scene,
    shown: QuestionPicture,
    order: int,
    moved: Lot,
    rng: np.random.Generator,
    kind: str,
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
        looks = tuple(map(tuple, measures[four].tolist()))
        yield Draft(scene, "cf-color", options, (shown,), slots, facts, kind, looks, order)


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


class PredictiveMaker(Maker):
    """Kinds: `pd-next` and `pd-fall` (next steps), `pd-push` (the settled scene after a push)."""

    subtask: Subtask = "PD"
    spare, doubtful = 3.0, 1.7
    drafts_a_scene = 4

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask for a next step or about a push, as drawn, where one is fair."""
        yield from (_pushes if rng.random() < _PUSHES_ASKED else _next_steps)(scene, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Decide by statics and simulation."""
        slots = base.slots_of(question)
        shown, options = sight.picture_of(question, "scene"), sight.option_pictures(question)
        if question.wording != "pd-push":
            stays = [_can_follow(shown, one) for one in options]
            return base.only_index([one is (question.wording == "pd-next") for one in stays])
        push = _meant_push(shown, sight.marked_order(shown, TAKEN), slots["direction"])
        outcome = _sure_push(shown.blocks, push)
        if outcome is None:
            raise UnfairError("it is not sure what follows the push")
        expected = _story(shown.blocks, replace(shown, blocks=outcome.settled), push)
        return base.only_index([_story(shown.blocks, one, push) == expected for one in options])


def _framed(every: Sequence[Sequence[Block]]) -> tuple[Block, ...]:
    """Return the blocks of all pictures that are compared, to frame a camera on."""
    poses = {(block.type, block.position_m, block.euler_deg): block for s in every for block in s}
    return tuple(replace(block, order=i) for i, block in enumerate(poses.values(), 1))


# Next steps

_PUSHES_ASKED, _STAGES_TRIED, _MOST_WAYS = 0.45, 6, 8
_LEAST_DIFFERENCE = 2 * sight.LEAST_PIXELS
_ELEVATIONS_DEG = (20, 38)


def _next_steps(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """Propose a stage of building and ways to go on, of which one stays, and of which one falls."""
    drafts: list[Draft] = []
    for _ in range(_STAGES_TRIED):
        stage, staying, falling = arrangements(scene, rng, _MOST_WAYS)
        if min(len(staying), len(falling)) < len(LETTERS) - 1:
            continue
        for stem, some, others in (("pd-next", staying, falling), ("pd-fall", falling, staying)):
            every = [blocks for blocks, _ in (*some, *others)]
            view = base.drawn_view(rng, _ELEVATIONS_DEG)
            plain = QuestionPicture("scene", stage, view, framed=_framed(every))
            pictures = [replace(plain, blocks=blocks) for blocks in every]
            shots = [seen(one) for one in pictures]
            unlike = np.array([[float(differing_pixels(a, b)) for b in shots] for a in shots])
            laid = [20 * looks for _, looks in (*some, *others)]
            measures = np.hstack([laid, [[*_looks_of(plain, shot)] for shot in shots]])
            four = base.four_alike(measures, unlike, _LEAST_DIFFERENCE, rng, rights=len(some))
            options = [pictures[i] for i in four]
            if options and all(
                sight.are_seen(one, sight.orders_of(one.blocks), _ALL_SEEN) for one in options
            ):
                framed = _framed([one.blocks for one in options])
                shown, *options = (replace(one, framed=framed) for one in (plain, *options))
                facts = {"placed": sight.orders_of(stage)}
                kept = tuple(map(tuple, measures[four].tolist()))
                drafts.append(Draft(scene, stem, tuple(options), (shown,), {}, facts, looks=kept))
        if drafts:
            break
    yield from drafts


def _looks_of(plain: QuestionPicture, shot: Shot) -> Iterator[float]:
    """Yield measures of what a picture changes: how much of it, and where."""
    area = max(int((seen(plain).block >= 0).sum()), 1) / 5
    for mask in (shot.block >= 0, changed_pixels(seen(plain), shot)):
        rows, columns = np.nonzero(mask)
        yield len(rows) / area
        yield from (float(x) * 10 / len(shot.block) for x in _spread(rows, columns))


def _spread(rows: Ints, columns: Ints) -> tuple[float, ...]:
    """Return middle and extent of a mask, in pixels; zeros where it is empty."""
    if not len(rows):
        return (0.0,) * 4
    return columns.mean(), rows.mean(), float(np.ptp(columns)), float(np.ptp(rows))


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


# Pushes

_PUSHES_TRIED, _OF_A_SCENE = 10, 3
_FRONTS_DEG = (0.0, 90.0, 180.0, 270.0)
_ELEVATIONS_DEG_PUSHES = (20, 32)
_DIRECTIONS: Mapping[str, int] = base.WORDS["directions"]
_LEAST_SHOWN_PUSHES = 60
_TOUCH_M, _ALONG_M, _REACH_M = 0.002, 0.01, 0.12
_LEVEL_M, _DOWN_M = 0.004, 0.008


def _pushes(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """Propose pushes of neighbors, seen from the front, back or a side, and what each leads to."""
    block = pick(rng, scene.blocks)
    view = (pick(rng, _FRONTS_DEG), base.drawn_view(rng, _ELEVATIONS_DEG_PUSHES)[1])
    plain = QuestionPicture("scene", scene.blocks, view)
    told = _told_apart(plain, block.order, rng)
    plain = replace(plain, framed=_framed([scene.blocks, *(blocks for *_, blocks in told)]))
    shot = seen(plain)
    is_shown = min(shown_pixels(plain, shot).values()) >= _LEAST_SHOWN_PUSHES
    if len(told) < len(LETTERS) or not is_shown:
        return
    pictures = [replace(plain, blocks=blocks) for *_, blocks in told]
    shots = [seen(one) for one in pictures]
    unlike = np.array([[float(differing_pixels(a, b)) for b in shots] for a in shots])
    for number in rng.permutation(len(told))[:_OF_A_SCENE].tolist():
        order, direction, _ = told[number]
        mark = block_mark(plain, shot, order, TAKEN)
        if mark is None:
            continue
        here = mark_pixel(plain, mark.position_m)
        measures = np.array([_looks_of_push(plain, s, here, direction) for s in shots])
        turn = [number, *(i for i in range(len(told)) if i != number)]
        four = base.four_alike(measures[turn], unlike[np.ix_(turn, turn)], sight.LEAST_PIXELS, rng)
        framed = _framed([scene.blocks, *(pictures[turn[i]].blocks for i in four)])
        options = tuple(replace(pictures[turn[i]], framed=framed) for i in four)
        if four and sight.are_told_apart([replace(plain, framed=framed), *options]):
            shown = (replace(plain, marks=(mark,), framed=framed),)
            slots = {"direction": direction}
            looks = tuple(map(tuple, measures[turn][four].tolist()))
            yield Draft(
                scene, "pd-push", options, shown, slots, {"pushed": order}, "", looks, order
            )


def _looks_of_push(
    plain: QuestionPicture, shot: Shot, here: tuple[int, int], direction: str
) -> list[float]:
    """Return measures of an outcome, from the mark and the way of the push: area, place, way."""
    size, sign = len(shot.block) / 10, _DIRECTIONS[direction]
    start = seen(plain)
    changed = changed_pixels(start, shot)
    rows, columns = np.nonzero(changed)
    x, y, wide, high = _spread(rows, columns)
    way = [float(np.mean(np.nonzero(one.block >= 0), axis=1)[1]) for one in (start, shot)]
    far = float(np.hypot(rows - here[0], columns - here[1]).min(initial=size))
    return [
        len(rows) / size**2,
        *((x - here[1]) * sign / size, (y - here[0]) / size, wide / size, high / size),
        float(np.hypot(x - here[1], y - here[0])) / size,
        far / size,
        (way[1] - way[0]) * sign,
    ]


def _told_apart(
    plain: QuestionPicture, order: int, rng: np.random.Generator
) -> list[tuple[int, str, tuple[Block, ...]]]:
    """Return pushes of a block or what it touches, and what comes of each: a story of its own."""
    boxes = {block.order: bounds_m(block) for block in plain.blocks}
    touching = [one for one, box in boxes.items() if boxes_near(box, boxes[order], _TOUCH_M)]
    pushes = shuffled(rng, [*itertools.product(touching, _DIRECTIONS)])[:_PUSHES_TRIED]
    near = next(
        group
        for group in groups(plain.blocks, _REACH_M)
        if any(block.order == order for block in group)
    )
    found: list[tuple[int, str, tuple[Block, ...]]] = []
    stories: set[object] = set()
    axis = _meant_push(plain, order, next(iter(_DIRECTIONS)))
    for number, (one, direction) in enumerate(pushes):
        if len(found) + len(pushes) - number < len(LETTERS):
            break
        outcome = after(near, _meant_push(plain, one, direction), OUTCOME_SETTINGS[:1])
        if not outcome.is_clear or one not in outcome.moved:
            continue
        settled = {block.order: block for block in outcome.settled}
        blocks = tuple(settled.get(block.order, block) for block in plain.blocks)
        try:
            story = _story(plain.blocks, replace(plain, blocks=blocks), axis)
        except UnfairError:
            continue
        if story not in stories:
            stories.add(story)
            found.append((one, direction, blocks))
    return found


def _meant_push(picture: QuestionPicture, order: int, direction: str) -> Push:
    """Return the push that is meant by a direction in a picture."""
    right = view_axes(*picture.view_deg)[0] * _DIRECTIONS[direction]
    x, y = (round(float(part), 6) + 0.0 for part in right[:2])
    return Push(order, (x, y))


@functools.lru_cache(maxsize=16)
def _sure_push(blocks: tuple[Block, ...], push: Push) -> Outcome | None:
    """Return the sure outcome of a push; None where settings, or statics if none fell, doubt it."""
    outcome = after(blocks, push)
    if not outcome.is_clear or push.order not in outcome.moved:
        return None
    height = {block.order: block.position_m[2] for block in blocks}
    if any(height[b.order] - b.position_m[2] > _TOUCH_M for b in outcome.settled):
        return outcome
    return outcome if is_sure(group_of(outcome.settled, push.order), ()) else None


def _story(blocks: Sequence[Block], picture: QuestionPicture, push: Push) -> tuple[object, ...]:
    """Return orders of blocks gone, moved, come down, and gone the way pushed.

    UnfairError where that cannot be told.
    """
    goal, label = {block.order: block for block in blocks}, picture.label
    moved, down, along = [], [], []
    for block in picture.blocks:
        before = goal.get(block.order)
        if before is None or before.kind != block.kind:
            raise UnfairError(f"picture {label} shows a block that the scene has not")
        has = has_moved(Pose.goal(before), Pose.goal(block))
        if has is None:
            raise UnfairError(f"picture {label} shows block {block.order} hardly moved")
        x, y, z = (b - a for a, b in zip(before.position_m, block.position_m, strict=True))
        if has and _LEVEL_M < abs(z) < _DOWN_M:
            raise UnfairError(f"picture {label} shows a block hardly lower than before")
        moved += [block.order] if has else []
        down += [block.order] if has and -z >= _DOWN_M else []
        along += [block.order] if x * push.direction[0] + y * push.direction[1] > _ALONG_M else []
    gone = set(goal) - {block.order for block in picture.blocks}
    return tuple(map(frozenset, (gone, moved, down, along)))


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
    spare, doubtful = 1.6, 1.1

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
                    looks = tuple(map(tuple, measures[four].tolist()))
                    facts = {"block": block.type, "euler": list(block.euler_deg)}
                    slots = {"size": _size(block)}
                    yield Draft(scene, "ad-place", marks, shown, slots, facts, "", looks)
                    return

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
