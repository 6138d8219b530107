"""CF, PD: what a removal, a further block or a push leads to, by statics and simulation.

CF: the block that goes is marked in the picture, so that no word of the question hints at the
answer. Most questions break the naive rule that what rests on a block falls with it and nothing
else: supports that are one too many, and weights that hold what they stand on. Nor is it enough to
ask what rests on nothing else: a plank may need each of two supports.

PD, next steps: all four pictures add the same block to an unfinished structure, let down where it
first touches; right and wrong places are drawn alike, all over the structure. Pushes: a block is
pushed to the right or left as seen, and other pictures show what other pushes close by lead to.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import Color
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions import base
from phyblock.making.questions.base import (
    COUNTED,
    TAKEN,
    Draft,
    UnfairError,
    are_seen,
    are_told_apart,
    center_m,
    draft,
    only_index,
    pick,
    shuffled,
)
from phyblock.making.questions.structures import (
    group_of,
    is_sure,
    lowered,
    stays_round,
    verdict,
    with_annex,
)
from phyblock.sim.balance import is_balanced, surely_stands
from phyblock.sim.camera import view_axes
from phyblock.sim.contact import bounds_m, boxes_near, support_graph, whole_bounds_m
from phyblock.sim.dynamics import groups
from phyblock.sim.engine import Pose
from phyblock.sim.outcomes import (
    OUTCOME_SETTINGS,
    Outcome,
    Push,
    after,
    after_removal,
    has_moved,
)
from phyblock.sim.pictures import Shot
from phyblock.sim.question_pictures import (
    block_mark,
    changed_pixels,
    differing_pixels,
    is_inside,
    seen,
    shown_pixels,
)

# CF

Lot = frozenset[int]
"""Orders of blocks that move."""
OUTCOME_TEXTS: tuple[str, ...] = tuple(base.WORDS["outcomes_of_removal"])
"""Outcomes of a removal, by the number of other blocks that do not stay; all are offered."""
_ALL_SEEN = 0.12
_STRUCTURES_TRIED, _VIEWS_TRIED, _REMOVALS_TRIED = 6, 3, 6
_SORTS = ([False, False], [False, True], [True, False], [True, True])
"""True where what rests on the block goes with it, and where what rests on nothing else does."""
_SHARES = (0.35, 0.25, 0.25, 0.15)
"""Shares of removals of each sort that are looked for: each rule is right in four cases of ten."""
_STAYS_ASKED = 0.25
_COLORED = 0.5
_MOST_LOTS, _MOST_TOGETHER = 40, 3
_LOT_AREA, _LOT_ROW = 0, 2
"""Places of two of the measures of `_looks_of_lot`."""
_COLORS: tuple[tuple[Color, Color, Color], ...] = (
    ("red", "yellow", "blue"),
    ("orange", "blue", "green"),
    ("yellow", "blue", "red"),
    ("blue", "orange", "green"),
    ("green", "orange", "blue"),
    ("red", "blue", "yellow"),
)
"""The colors of what moves, of what stays, and of the block that is taken away."""


class CounterfactualMaker(base.Maker):
    """Kinds: `cf-count` (texts) and `cf-color` (what moves, by colors)."""

    subtask: Subtask = "CF"

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Drafts about removals from the scene, or from a part of it with an annex."""
        sort = _SORTS[int(rng.choice(len(_SORTS), p=_SHARES))]
        is_colored = bool(rng.random() < _COLORED)
        known = base.orders_of(scene.blocks)
        for number in range(_STRUCTURES_TRIED):
            blocks = (scene.blocks if number == 0 else with_annex(scene, rng)) or ()
            added = [block for block in blocks if block.order not in known]
            for block in shuffled(rng, added or blocks)[:_REMOVALS_TRIED]:
                group = group_of(blocks, block.order)
                left = [one for one in group if one.order != block.order]
                naive = [resting_on(group, block.order, only=only) for only in (False, True)]
                # What statics alone say; a simulation decides.
                falls = not is_balanced(left)
                if left and [bool(lot) is falls for lot in naive] == sort:
                    plain = _pictured(blocks, block.order, rng)
                    outcome = plain and _sure_removal(blocks, block.order)
                    if plain and outcome and [set(outcome.moved) == lot for lot in naive] == sort:
                        made = _removal(scene, plain, block.order, outcome, is_colored, rng)
                        facts = {"removed": block.order, "moved": list(outcome.moved)}
                        for one in made:
                            evidence = {**one.evidence, **facts, "resting": sorted(naive[0])}
                            yield replace(one, evidence=evidence)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By simulating the removal again."""
        slots = base.slots_of(question)
        kind, shown = base.of_kind(question), base.picture_of(question, "scene")
        order = base.marked_order(shown, TAKEN)
        outcome = _sure_removal(shown.blocks, order)
        if outcome is None:
            raise UnfairError(f"it is not sure what follows without block {order}")
        base.require_seen(shown, (order,), base.NAMED)
        if kind == "cf-count":
            return base.index_of(question, _outcome_text(outcome))
        told = [
            base.highlighted(one, shown.blocks, slots, taken=order)
            for one in base.option_pictures(question)
        ]
        return only_index([one == set(outcome.moved) for one in told])


def _outcome_text(outcome: Outcome) -> str:
    return OUTCOME_TEXTS[min(len(outcome.moved), len(OUTCOME_TEXTS) - 1)]


def _pictured(
    blocks: tuple[Block, ...], order: int, rng: np.random.Generator
) -> QuestionPicture | None:
    """The blocks from a view that shows them all, with the one that goes marked."""
    for _ in range(_VIEWS_TRIED):
        plain = QuestionPicture("scene", blocks, base.drawn_view(rng))
        mark = block_mark(plain, seen(plain), order, TAKEN)
        is_named = mark and are_seen(plain, (order,), base.NAMED)
        if mark and is_named and are_seen(plain, base.orders_of(blocks), _ALL_SEEN):
            return replace(plain, marks=(mark,))
    return None


def _removal(
    scene: Scene,
    shown: QuestionPicture,
    order: int,
    outcome: Outcome,
    is_colored: bool,
    rng: np.random.Generator,
) -> Iterator[Draft]:
    """At most one draft about a removal: who moves, by colors, or how many."""
    moved = frozenset(outcome.moved)
    # That none moves is found more often than it is asked.
    is_rare = not moved and rng.random() > _STAYS_ASKED
    if is_rare or not are_seen(shown, moved, COUNTED):
        return
    if is_colored:
        plain = replace(shown, marks=())
        options, slots, value = _colored_options(plain, order, moved, rng)
        if options:
            yield draft(scene, rng, "cf-color", options, [shown], slots, value=value)
        return
    right, *others = base.right_first(_outcome_text(outcome), OUTCOME_TEXTS)
    yield draft(scene, rng, "cf-count", [right, *shuffled(rng, others)], [shown], {})


def _colored_options(
    plain: QuestionPicture, taken: int, moved: Lot, rng: np.random.Generator
) -> tuple[list[QuestionPicture], base.Slots, str]:
    """Four pictures, if any, the right one first, the slots of the text, and the sort of answer."""
    lots = [moved, *_other_lots(plain, taken, moved, rng)]
    shot = seen(plain)
    counts = np.bincount(shot.block[shot.block >= 0], minlength=len(plain.blocks))
    pixels = dict(zip(base.orders_of(plain.blocks), counts, strict=True))
    unlike = np.array([[sum(pixels[o] for o in a ^ b) for b in lots] for a in lots], dtype=float)
    measures = np.array([_looks_of_lot(plain, shot, taken, lot) for lot in lots])
    four = base.four_alike(measures, unlike >= base.LEAST_PIXELS, rng, unlike=unlike)
    colors = pick(rng, _COLORS)

    def colored(lot: Lot) -> QuestionPicture:
        color = {b.order: colors[b.order not in lot] for b in plain.blocks} | {taken: colors[2]}
        return replace(plain, blocks=tuple(replace(b, color=color[b.order]) for b in plain.blocks))

    options = [colored(lots[place]) for place in four.chosen]
    if not options or not are_told_apart(options):
        return [], {}, ""
    slots = dict(zip(("color", "other", "taken"), colors, strict=True))
    return options, slots, four.halves(_LOT_AREA, _LOT_ROW)


def _other_lots(
    plain: QuestionPicture, taken: int, moved: Lot, rng: np.random.Generator
) -> list[Lot]:
    """Lots that could move together and do not: some blocks, with all that rests on them."""
    share = base.shares(plain)
    left = [block for block in plain.blocks if block.order != taken]
    single = [frozenset({b.order}) | resting_on(left, b.order) for b in left]
    found = {frozenset[int]()}
    for number in range(1, _MOST_TOGETHER + 1):
        found |= {frozenset().union(*some) for some in itertools.combinations(single, number)}
        if len(found) > _MOST_LOTS:
            break
    fair = [lot for lot in found if lot != moved and all(share[o] >= COUNTED for o in lot)]
    return shuffled(rng, sorted(fair, key=sorted))[:_MOST_LOTS]


def _looks_of_lot(plain: QuestionPicture, shot: Shot, taken: int, lot: Lot) -> tuple[float, ...]:
    """Area, place, height and distance from the block taken of what is colored, and its naivety."""
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


# PD

_PUSHED = 0.55
"""Share of drafts for which a push is sought, which fewer scenes allow than a next step."""


class PredictiveMaker(base.Maker):
    """Kinds: `pd-next` (the next step) and `pd-push` (the settled scene after a push)."""

    subtask: Subtask = "PD"
    scenes_tried = 340

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """A push or a next step, as drawn, where one is fair."""
        yield from (_push_drafts if rng.random() < _PUSHED else _next_drafts)(scene, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By statics and simulation."""
        slots = base.slots_of(question)
        shown, options = base.picture_of(question, "scene"), base.option_pictures(question)
        if base.of_kind(question) == "pd-next":
            return only_index([_can_follow(shown, one) for one in options])
        push = _meant_push(shown, base.marked_order(shown, TAKEN), slots["direction"])
        outcome = _sure_push(shown.blocks, push)
        if outcome is None:
            raise UnfairError("it is not sure what follows the push")
        expected = _story(shown.blocks, replace(shown, blocks=outcome.settled), push)
        return only_index([_story(shown.blocks, one, push) == expected for one in options])


_ROOM_M = 0.06


def _with_room(blocks: Sequence[Block], above_m: float = 0.0) -> tuple[Block, ...]:
    """The blocks to frame a picture on for floor all round them, and some air above [m]."""
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

RINGS_M = (0.0025, 0.005, 0.01)
"""The verdict on a next step holds all round it, this far off [m]."""
_STAGES_TRIED, _PLACES_TRIED, _RIGHTS_TRIED = 3, 60, 6
_ANNEXED = 0.5
_MOST_LEFT = 6
_STEP_M, _MOST_STEPS = 0.0125, 6
_LEAST_HEIGHT_M, _ABOVE_M = 0.02, 0.03
_LEAST_SHOWN = 250
_ELEVATIONS_DEG = (34, 48)
"""High enough to tell what lies behind from what lies above."""
_ENOUGH, _MOST_OF_A_SORT, _MOST_POOL = 4, 8, 11
_HELD_OFF = 0.5
_AREA = 0
"""Place of the measure how much is colored."""
_AREA_RANKS = (0.1, 0.2, 0.3, 0.4)
"""Shares of each rank of the right picture by colored area that are looked for.

A block that stays hides more of what it stands on, so that the last rank is the hardest to find;
what is found is evened out when questions are chosen.
"""


def _next_drafts(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """At most one draft: a stage of building, a block to come, one place where it stays."""
    for _ in range(_STAGES_TRIED):
        stage, block = _stage(scene, rng)
        if not stage:
            return
        low, high = _ELEVATIONS_DEG
        view = (base.drawn_view(rng)[0], float(rng.integers(low, high + 1)))
        shown = QuestionPicture("scene", stage, view, framed=_with_room(stage, _ABOVE_M))
        staying, falling = _places(shown, block, rng)
        if len(falling) < _ENOUGH:
            continue
        rank = int(rng.choice(len(_AREA_RANKS), p=_AREA_RANKS))
        for right in staying[:_RIGHTS_TRIED]:
            wrong = _alike_wrong(shown, right, falling, rng, {_AREA: rank})
            options = [right, *wrong]
            if not all(are_seen(one, (block.order,), COUNTED) for one in options):
                continue
            if wrong and all(_stays(stage, o.blocks[-1]) is (o is right) for o in options):
                placed = [one.order for one in stage]
                yield draft(
                    *(scene, rng, "pd-next", options, [shown], {}),
                    value=f"area {rank}",
                    placed=placed,
                    next=block.order,
                )
                return


def _can_follow(shown: QuestionPicture, option: QuestionPicture) -> bool:
    """True if one block was added so that all stays; UnfairError when that is not sure."""
    placed = {block.order for block in shown.blocks}
    added = [block for block in option.blocks if block.order not in placed]
    kept = [block for block in option.blocks if block.order in placed]
    if len(added) != 1 or not base.same_blocks(kept, shown.blocks):
        raise UnfairError(f"picture {option.label} does not add one block")
    stays = _stays(kept, added[0])
    if stays is None:
        raise UnfairError(f"it is not sure whether all stays in picture {option.label}")
    return stays


def _stays(stage: Sequence[Block], put: Block) -> bool | None:
    """True if a block put down stays, by simulation too, and likewise up to 1 cm off; or None."""
    stays = stays_round(put, stage, RINGS_M)
    return stays if verdict((*stage, put), put.order) is stays else None


def _stage(scene: Scene, rng: np.random.Generator) -> tuple[tuple[Block, ...], Block]:
    """The blocks placed so far, none where there are too few, and one more of the scene's."""
    order = scene.graph.random_order(rng)
    annexed = with_annex(scene, rng) if rng.random() < _ANNEXED else None
    if annexed and all(map(surely_stands, groups(annexed))):
        number = max(block.order for block in annexed) + 1
        return annexed, replace(pick(rng, scene.blocks), order=number)
    least, most = max(1, len(scene) - _MOST_LEFT), len(scene) - 1
    if most < least:
        return (), scene.blocks[0]
    count = int(rng.integers(least, most + 1))
    stage = tuple(scene.blocks[vertex] for vertex in sorted(order[:count]))
    return stage, scene.blocks[pick(rng, order[count:])]


def _places(
    shown: QuestionPicture, block: Block, rng: np.random.Generator
) -> tuple[list[QuestionPicture], list[QuestionPicture]]:
    """Pictures of the block let down here and there: where it stays by statics, and where not."""
    found: dict[bool, list[QuestionPicture]] = {True: [], False: []}
    for _ in range(_PLACES_TRIED):
        under = bounds_m(pick(rng, shown.blocks)).mean(axis=0)
        x, y = (
            float(place) + _STEP_M * int(rng.integers(-_MOST_STEPS, _MOST_STEPS + 1))
            for place in under[:2]
        )
        put = lowered(block, shown.blocks, x, y)
        if bounds_m(put)[0, 2] < _LEAST_HEIGHT_M:
            continue
        picture = replace(shown, blocks=(*shown.blocks, put))
        likely = is_balanced(group_of(picture.blocks, put.order))
        if len(found[likely]) == _MOST_OF_A_SORT:
            continue
        stays = stays_round(put, shown.blocks, RINGS_M[-1:])
        if stays is None:
            continue
        if shown_pixels(picture, seen(picture))[put.order] >= _LEAST_SHOWN:
            found[stays].append(picture)
        if all(len(sort) >= _MOST_OF_A_SORT // 2 for sort in found.values()):
            break
    return shuffled(rng, found[True]), found[False]


def _alike_wrong(
    first: QuestionPicture,
    right: QuestionPicture,
    pool: Sequence[QuestionPicture],
    rng: np.random.Generator,
    held: Mapping[int, int],
) -> list[QuestionPicture]:
    """Three of the pool, told apart from one another and the rest, or none."""
    whole = [one for one in (right, *pool) if is_inside(one)][: 1 + _MOST_POOL]
    if not whole or whole[0] is not right:
        return []
    start, shots = seen(first), [seen(one) for one in whole]
    together = [start, *shots]
    apart = np.zeros((len(together), len(together)), dtype=np.bool_)
    for (i, one), (j, other) in itertools.combinations(enumerate(together), 2):
        # A picture like the first one is none that could be chosen.
        is_worth_it = i == 0 or (apart[0, i] and apart[0, j])
        apart[i, j] = apart[j, i] = (
            is_worth_it and differing_pixels(one, other) >= base.LEAST_PIXELS
        )
        if (i, j) == (0, 1) and not apart[i, j]:
            return []
    measures = np.array([_looks(start, shot) for shot in shots])
    chosen = ranked_as_drawn(measures, apart[1:, 1:], rng, held)
    return [whole[i] for i in chosen]


def ranked_as_drawn(
    measures: base.Floats,
    apart: NDArray[np.bool_],
    rng: np.random.Generator,
    held: Mapping[int, int],
) -> tuple[int, ...]:
    """Three rows after the first, all apart, among which the first has about the ranks drawn.

    `measures` has shape (n, k), `apart` (n, n). `held` gives ranks that hold exactly for some of
    the k measures. Empty where no three come near enough.
    """
    wanted = np.array(rng.integers(base.WRONG + 1, size=measures.shape[1]), dtype=np.int64)
    fixed = sorted(held)
    for one in fixed:
        wanted[one] = held[one]
    best: tuple[float, tuple[int, ...]] = (base.MOST_OFF, ())
    for chosen in itertools.combinations(range(1, len(measures)), base.WRONG):
        if all(apart[a, b] for a, b in itertools.combinations((0, *chosen), 2)):
            off = np.abs(base.ranks_among(measures, 0, np.array([chosen]))[0] - wanted)
            if (off[fixed] <= _HELD_OFF).all():
                best = min(best, (float(off.mean()), chosen))
    return best[1]


def _looks(first: Shot, shot: Shot) -> tuple[float, ...]:
    """Eight measures of a picture, most of them shares of its side or of what is colored."""
    rows, columns = np.nonzero(shot.block >= 0)
    side, area = len(shot.block), max(int((first.block >= 0).sum()), 1)
    changed_rows, changed_columns = np.nonzero(changed_pixels(first, shot))
    if not len(changed_rows):
        changed_rows, changed_columns = rows, columns
    return (
        5 * len(rows) / area,
        10 * float(columns.mean()) / side,
        10 * float(rows.mean()) / side,
        5 * float(np.ptp(columns)) / side,
        5 * float(rows.min()) / side,
        2 * len(changed_rows) / area,
        2 * float(changed_columns.mean()) / side,
        2 * float(changed_rows.mean()) / side,
    )


# Pushes

_BLOCKS_TRIED, _PUSHES_TRIED = 3, 9
_OPTIONS = 4
_FRONTS_DEG = (0.0, 90.0, 180.0, 270.0)
_ELEVATIONS_DEG_PUSHES = (20, 32)
_DIRECTIONS: Mapping[str, int] = base.WORDS["directions"]
_LEAST_SHOWN_PUSHES = 60
_TOUCH_M, _ALONG_M, _REACH_M = 0.002, 0.01, 0.12
_LEVEL_M, _DOWN_M = 0.004, 0.008
_Pushed = tuple[int, str]
"""The block that is pushed, and the direction."""


def _push_drafts(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """At most one draft: a block pushed, of which a picture from the front, back or a side shows
    every other as well.
    """
    low, high = _ELEVATIONS_DEG_PUSHES
    for front_deg in shuffled(rng, _FRONTS_DEG):
        view = (front_deg, float(rng.integers(low, high + 1)))
        plain = QuestionPicture("scene", scene.blocks, view, framed=_with_room(scene.blocks))
        shot = seen(plain)
        if min(shown_pixels(plain, shot).values()) >= _LEAST_SHOWN_PUSHES:
            break
    else:
        return
    for block in shuffled(rng, scene.blocks)[:_BLOCKS_TRIED]:
        told = _told_apart(plain, _pushes(plain, block.order, rng))
        if len(told) < _OPTIONS:
            continue
        (order, direction), right = told.pop(int(rng.integers(_OPTIONS)))
        mark = block_mark(plain, shot, order, TAKEN)
        outcome = _sure_push(scene.blocks, _meant_push(plain, order, direction)) if mark else None
        if mark is None or outcome is None:
            continue
        options = [replace(right, blocks=outcome.settled), *(picture for _, picture in told)]
        if are_told_apart(options):
            shown, slots = [replace(plain, marks=(mark,))], {"direction": direction}
            yield draft(
                *(scene, rng, "pd-push", options, shown, slots),
                value="falls" if len(outcome.moved) > 1 else "slides",
                pushed=order,
                moved=list(outcome.moved),
            )
            return


def _meant_push(picture: QuestionPicture, order: int, direction: str) -> Push:
    """The push that is meant by a direction in a picture."""
    right = view_axes(*picture.view_deg)[0] * _DIRECTIONS[direction]
    x, y = (round(float(part), 6) + 0.0 for part in right[:2])
    return Push(order, (x, y))


def _sure_push(blocks: Sequence[Block], push: Push) -> Outcome | None:
    """The sure outcome of a push; None where settings, or statics if none came down, doubt it."""
    outcome = after(blocks, push)
    if not outcome.is_clear or push.order not in outcome.moved:
        return None
    height = {block.order: block.position_m[2] for block in blocks}
    if any(height[b.order] - b.position_m[2] > _TOUCH_M for b in outcome.settled):
        return outcome
    return outcome if is_sure(group_of(outcome.settled, push.order), ()) else None


def _story(blocks: Sequence[Block], picture: QuestionPicture, push: Push) -> tuple[object, ...]:
    """Orders of blocks gone, moved, come down, and gone the way pushed; UnfairError if unsure."""
    goal, label = {block.order: block for block in blocks}, picture.label
    moved, down, along = [], [], []
    for block in picture.blocks:
        before = goal.get(block.order)
        if before is None or before.kind != block.kind:
            raise UnfairError(f"picture {label} shows a block that the scene has not")
        has = has_moved(Pose.goal(before), Pose.goal(block))
        x, y, z = (b - a for a, b in zip(before.position_m, block.position_m, strict=True))
        if has:
            moved.append(block.order)
            if _LEVEL_M < abs(z) < _DOWN_M:
                raise UnfairError(f"picture {label} shows a block hardly lower than before")
            down += [block.order] if -z >= _DOWN_M else []
        elif has is None:
            raise UnfairError(f"picture {label} shows block {block.order} hardly moved")
        along += [block.order] if x * push.direction[0] + y * push.direction[1] > _ALONG_M else []
    gone = set(goal) - {block.order for block in picture.blocks}
    return tuple(map(frozenset, (gone, moved, down, along)))


def _pushes(plain: QuestionPicture, order: int, rng: np.random.Generator) -> list[_Pushed]:
    """Pushes of a block and of those that it touches, to either side, in an order drawn."""
    boxes = {block.order: bounds_m(block) for block in plain.blocks}
    touching = [one for one, box in boxes.items() if boxes_near(box, boxes[order], _TOUCH_M)]
    return shuffled(rng, list(itertools.product(touching, _DIRECTIONS)))[:_PUSHES_TRIED]


def _told_apart(
    plain: QuestionPicture, pushes: Sequence[_Pushed]
) -> list[tuple[_Pushed, QuestionPicture]]:
    """The first four pushes of which each leads to a picture that tells a story of its own."""
    found: list[tuple[_Pushed, QuestionPicture]] = []
    stories: set[object] = set()
    first = pushes[0][0]
    reached = groups(plain.blocks, _REACH_M)
    near = next(group for group in reached if any(block.order == first for block in group))
    axis = _meant_push(plain, first, next(iter(_DIRECTIONS)))
    for number, (order, direction) in enumerate(pushes):
        if len(found) + len(pushes) - number < _OPTIONS:
            break
        outcome = after(near, _meant_push(plain, order, direction), OUTCOME_SETTINGS[:1])
        if not outcome.is_clear or order not in outcome.moved:
            continue
        settled = {block.order: block for block in outcome.settled}
        blocks = tuple(settled.get(block.order, block) for block in plain.blocks)
        picture = replace(plain, blocks=blocks)
        try:
            story = _story(plain.blocks, picture, axis)
        except UnfairError:
            continue
        if story not in stories and are_told_apart([plain, *(one for _, one in found), picture]):
            stories.add(story)
            found.append(((order, direction), picture))
        if len(found) == _OPTIONS:
            break
    return found
