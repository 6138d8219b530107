"""CF, PD, AD: what moves when a block goes, comes, or is pushed, by statics and simulation.

CF: the block that goes is marked in the picture, so that no word of the question hints at the
answer. Most questions break the naive rule that what rests on a block falls with it and nothing
else: supports that are one too many, and weights that hold what they stand on. Nor is it enough to
ask what rests on nothing else: a plank may need each of two supports.

PD: all four next steps add the same block to an unfinished structure, let down where it first
touches; right and wrong places are drawn alike, all over the structure. Or a block is pushed to the
right or left as seen, and other pictures show what other pushes close by lead to.

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

from phyblock.domain.blocks import (
    BLOCK_TYPES,
    COLORS,
    SHAPES,
    BlockType,
    Color,
    Euler,
    euler_deg_to_matrix,
)
from phyblock.domain.question import LETTERS, Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions import base, sight
from phyblock.making.questions.base import Draft, Maker, UnfairError, View, draft, pick, shuffled
from phyblock.making.questions.structures import (
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
from phyblock.sim.contact import bounds_m, boxes_near, support_graph, whole_bounds_m
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

_ROOM_M = 0.06


class PredictiveMaker(Maker):
    """Kinds: `pd-next` (the next step) and `pd-push` (the settled scene after a push)."""

    subtask: Subtask = "PD"

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Ask for a next step or about a push, as drawn, where one is fair."""
        yield from pick(rng, (_next_steps, _pushes))(scene, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """Decide by statics and simulation."""
        slots = base.slots_of(question)
        shown, options = sight.picture_of(question, "scene"), sight.option_pictures(question)
        if base.stem_of(question.wording) == "pd-next":
            return base.only_index([_can_follow(shown, one) for one in options])
        push = _meant_push(shown, sight.marked_order(shown, TAKEN), slots["direction"])
        outcome = _sure_push(shown.blocks, push)
        if outcome is None:
            raise UnfairError("it is not sure what follows the push")
        expected = _story(shown.blocks, replace(shown, blocks=outcome.settled), push)
        return base.only_index([_story(shown.blocks, one, push) == expected for one in options])


def _with_room(blocks: Sequence[Block], above_m: float = 0.0) -> tuple[Block, ...]:
    """Return the blocks to frame a picture on for floor all round, and some air above [m]."""
    low, high = whole_bounds_m(blocks)
    first = max(block.order for block in blocks) + 1
    z = round(float(high[2]) + above_m, 4) if above_m else 0.0125
    sides = itertools.product(*((low[i] - _ROOM_M, high[i] + _ROOM_M) for i in (0, 1)))
    places = ((round(float(x), 4), round(float(y), 4), z) for x, y in sides)
    corners = (
        Block(first + i, "cuboid1", "red", place, (0.0, 0.0, 0.0), (), 1)
        for i, place in enumerate(places)
    )
    return (*blocks, *corners)


# Next steps

_STEP_RINGS_M = (0.0025, 0.005, 0.01)
"""The verdict on a next step holds all round it, this far off [m]."""
_STAGES_TRIED, _STEPS_TRIED, _PROPOSED, _STEPS_KEPT = 3, 60, 3, 8
_STAGES_ANNEXED, _MOST_LEFT = 0.5, 6
_STEP_M, _MOST_STEPS, _LEAST_HEIGHT_M, _ABOVE_M = 0.0125, 6, 0.02, 0.03
_LEAST_SHOWN = 250
_ELEVATIONS_DEG = (34, 48)
"""High enough to tell what lies behind from what lies above."""


def _next_steps(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """Propose a stage of building, a block to come, one place where it stays and three others."""
    for _ in range(_STAGES_TRIED):
        stage, block = _stage(scene, rng)
        view, framed = base.drawn_view(rng, _ELEVATIONS_DEG), _with_room(stage, _ABOVE_M)
        shown = QuestionPicture("scene", stage, view, framed=framed)
        staying, falling = _steps(shown, block, rng)
        pictures = [*staying, *falling]
        start, shots = seen(shown), [seen(one) for one in pictures]
        unlike = np.array([[float(differing_pixels(a, b)) for b in shots] for a in shots])
        measures = np.array([_looks_of_step(start, shot) for shot in shots])
        for _ in range(_PROPOSED if staying else 0):
            four = base.four_alike(measures, unlike, sight.LEAST_PIXELS, rng, rights=len(staying))
            if four:
                options, looks = [pictures[i] for i in four], measures[four].tolist()
                facts = {"placed": sight.orders_of(stage), "next": block.order}
                yield draft(scene, rng, "pd-next", options, [shown], {}, looks=looks, facts=facts)


def _stage(scene: Scene, rng: np.random.Generator) -> tuple[tuple[Block, ...], Block]:
    """Return the blocks placed so far, and one more of the scene's."""
    annexed = with_annex(scene, rng) if rng.random() < _STAGES_ANNEXED else None
    if annexed and all(map(surely_stands, groups(annexed))):
        number = max(block.order for block in annexed) + 1
        return annexed, replace(pick(rng, scene.blocks), order=number)
    order, most = scene.graph.random_order(rng), max(1, len(scene) - 1)
    count = int(rng.integers(max(1, len(scene) - _MOST_LEFT), most + 1))
    stage = tuple(scene.blocks[vertex] for vertex in sorted(order[:count]))
    number = max(sight.orders_of(scene.blocks)) + 1
    left = [scene.blocks[vertex] for vertex in order[count:]]
    return stage, pick(rng, left) if left else replace(scene.blocks[0], order=number)


def _steps(
    shown: QuestionPicture, block: Block, rng: np.random.Generator
) -> tuple[list[QuestionPicture], list[QuestionPicture]]:
    """Return pictures of the block let down where it stays by statics, and where not."""
    found: dict[bool, list[QuestionPicture]] = {True: [], False: []}
    start = seen(shown)
    for _ in range(_STEPS_TRIED):
        under = bounds_m(pick(rng, shown.blocks)).mean(axis=0)
        steps = rng.integers(-_MOST_STEPS, _MOST_STEPS + 1, size=2)
        x, y = (float(under[i]) + _STEP_M * int(steps[i]) for i in (0, 1))
        put = lowered(block, shown.blocks, x, y)
        picture = replace(shown, blocks=(*shown.blocks, put))
        if bounds_m(put)[0, 2] < _LEAST_HEIGHT_M or not is_inside(picture):
            continue
        stays = stays_round(put, shown.blocks, _STEP_RINGS_M[-1:])
        if stays is None or len(found[stays]) == _STEPS_KEPT:
            continue
        shot = seen(picture)
        is_shown = shown_pixels(picture, shot)[put.order] >= _LEAST_SHOWN
        is_new = is_shown and differing_pixels(start, shot) >= sight.LEAST_PIXELS
        if is_new and sight.are_seen(picture, [put.order], sight.COUNTED):
            found[stays].append(picture)
    return found[True], found[False]


def _looks_of_step(first: Shot, shot: Shot) -> tuple[float, ...]:
    """Return measures of what a step adds to a picture: how much of it shows, and where."""
    shown, side = shot.block >= 0, len(shot.block) / 10
    area = max(int((first.block >= 0).sum()), 1) / 5
    rows, columns = np.nonzero(shown)
    new_rows, new_columns = np.nonzero(changed_pixels(first, shot))
    return (
        len(rows) / area,
        len(new_rows) / area,
        *(float(x) / side for x in (columns.mean(), rows.mean(), np.ptp(columns), rows.min())),
        *(float(x) / side for x in (new_columns.mean(), new_rows.mean())),
    )


def _can_follow(shown: QuestionPicture, option: QuestionPicture) -> bool:
    """True if one block was added so that all stays; UnfairError when that is not sure."""
    placed = {block.order for block in shown.blocks}
    added = [block for block in option.blocks if block.order not in placed]
    kept = tuple(block for block in option.blocks if block.order in placed)
    if len(added) != 1 or not sight.same_blocks(kept, shown.blocks):
        raise UnfairError(f"picture {option.label} does not add one block")
    stays = _stays(kept, added[0])
    if stays is None:
        raise UnfairError(f"it is not sure whether all stays in picture {option.label}")
    return stays


@functools.lru_cache(maxsize=64)
def _stays(stage: tuple[Block, ...], put: Block) -> bool | None:
    """True if a block put down stays, by simulation too, and likewise up to 1 cm off; or None."""
    stays = stays_round(put, stage, _STEP_RINGS_M)
    return stays if verdict((*stage, put), put.order) is stays else None


# Pushes

_PUSHED_TRIED, _PUSHES_TRIED = 3, 9
_FRONTS_DEG = (0.0, 90.0, 180.0, 270.0)
_ELEVATIONS_DEG_PUSHES = (20, 32)
_DIRECTIONS: Mapping[str, int] = base.WORDS["directions"]
_LEAST_SHOWN_PUSHES = 60
_TOUCH_M, _ALONG_M, _REACH_M = 0.002, 0.01, 0.12
_LEVEL_M, _DOWN_M = 0.004, 0.008


def _pushes(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """Propose pushes of which a picture from the front, back or a side shows every block."""
    for front_deg in shuffled(rng, _FRONTS_DEG):
        view = (front_deg, base.drawn_view(rng, _ELEVATIONS_DEG_PUSHES)[1])
        plain = QuestionPicture("scene", scene.blocks, view, framed=_with_room(scene.blocks))
        shot = seen(plain)
        if min(shown_pixels(plain, shot).values()) >= _LEAST_SHOWN_PUSHES:
            break
    else:
        return
    for block in shuffled(rng, scene.blocks)[:_PUSHED_TRIED]:
        told = _told_apart(plain, block.order, rng)
        if len(told) < len(LETTERS):
            continue
        (order, direction), _ = told.pop(int(rng.integers(len(told))))
        mark = block_mark(plain, shot, order, TAKEN)
        outcome = _sure_push(scene.blocks, _meant_push(plain, order, direction)) if mark else None
        if mark and outcome:
            right = replace(plain, blocks=outcome.settled)
            options = [right, *(picture for _, picture in told)]
            if sight.are_told_apart(options):
                shown, slots = [replace(plain, marks=(mark,))], {"direction": direction}
                facts = {"pushed": order, "moved": list(outcome.moved)}
                yield draft(scene, rng, "pd-push", options, shown, slots, facts=facts)


def _told_apart(
    plain: QuestionPicture, order: int, rng: np.random.Generator
) -> list[tuple[tuple[int, str], QuestionPicture]]:
    """Return four pushes of a block or what it touches, each with a picture of its own story."""
    boxes = {block.order: bounds_m(block) for block in plain.blocks}
    touching = [one for one, box in boxes.items() if boxes_near(box, boxes[order], _TOUCH_M)]
    pushes = shuffled(rng, [*itertools.product(touching, _DIRECTIONS)])[:_PUSHES_TRIED]
    near = next(
        group
        for group in groups(plain.blocks, _REACH_M)
        if any(block.order == order for block in group)
    )
    found: list[tuple[tuple[int, str], QuestionPicture]] = []
    stories: set[object] = set()
    axis = _meant_push(plain, order, next(iter(_DIRECTIONS)))
    for number, (one, direction) in enumerate(pushes):
        if len(found) == len(LETTERS) or len(found) + len(pushes) - number < len(LETTERS):
            break
        outcome = after(near, _meant_push(plain, one, direction), OUTCOME_SETTINGS[:1])
        if not outcome.is_clear or one not in outcome.moved:
            continue
        settled = {block.order: block for block in outcome.settled}
        blocks = tuple(settled.get(block.order, block) for block in plain.blocks)
        picture = replace(plain, blocks=blocks)
        try:
            story = _story(plain.blocks, picture, axis)
        except UnfairError:
            continue
        if story not in stories and sight.are_told_apart(
            [plain, *(one for _, one in found), picture]
        ):
            stories.add(story)
            found.append(((one, direction), picture))
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
_PLACE_RINGS_M = (0.00125, 0.0025, 0.005)
"""The verdict on a place holds all round it, this far off [m]."""
_ANNEXED, _BLOCKS_TRIED = 0.6, 3
_STEP_PX, _APART_PX, _FLAT_RISE = 5, 18.0, 0.99
_OFF_CENTER_M, _MOST_OF_A_FACE = 0.001, 0.8
_PLACES_TRIED, _GIVEN_UP, _SORT = 90, 24, 10
_SAME_HEIGHT_M, _CLEARLY_HIGHER_M = 0.001, 0.01


class AffordanceMaker(Maker):
    """Kind: `ad-place`."""

    subtask: Subtask = "AD"

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
            for _ in range(_BLOCKS_TRIED):
                block = _drawn_block(plain, rng)
                staying, wrong = _by_statics(plain, block, shuffled(rng, tops))
                both = [*staying, *wrong]
                pixels = np.array([mark_pixel(plain, top.position_m) for top in both], dtype=float)
                for _ in range(_PROPOSED if staying and wrong else 0):
                    unlike = np.linalg.norm(pixels[:, None] - pixels, axis=2)
                    measures = np.array([_looks_of_place(plain, top) for top in both])
                    four = base.four_alike(measures, unlike, _APART_PX, rng, rights=len(staying))
                    if four:
                        alone = QuestionPicture(BLOCK_LABEL, (block,), plain.view_deg)
                        marks = [Mark("A", both[i].position_m) for i in four]
                        slots, looks = {"size": _size(block)}, measures[four].tolist()
                        facts = {"block": block.type, "euler": list(block.euler_deg)}
                        shown = [plain, alone]
                        yield draft(
                            scene, rng, "ad-place", marks, shown, slots, looks=looks, facts=facts
                        )

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
    return f"{max(level):g} cm by {min(level):g} cm, and {high:g} cm in height"


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
    around = lowered_round(put, plain.blocks, _PLACE_RINGS_M[-1:])
    is_on = is_on_face(plain, put, at)
    if is_on is None or any(_is_as_high(one, at) is not is_on for one in around):
        return None
    stays = stays_round(put, plain.blocks, _PLACE_RINGS_M)
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
