"""RP, AP, RD, RR: where blocks are to one another, how far, which rests on which, and how turned.

Scenes are recolored so that most blocks have a name.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from phyblock.domain.blocks import (
    SHAPES,
    BlockType,
    Euler,
    euler_deg_to_matrix,
    orientation_class,
)
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.domain.symmetry import angles_deg
from phyblock.making.questions import base
from phyblock.making.questions.base import (
    NAMED,
    STUDIED,
    WORDS,
    Draft,
    Floats,
    Slots,
    StaticMaker,
    UnfairError,
    View,
    are_seen,
    center_m,
    draft,
    goal_picture,
    orders_of,
    pick,
    recolored,
    require_seen,
    right_first,
    seen_blocks,
    shuffled,
)
from phyblock.making.questions.names import plain_names, resolve_one, shape_word
from phyblock.sim.contact import (
    FIT_TOLERANCE_M,
    GROUND,
    bounds_m,
    boxes_near,
    drop_height_m,
    find_overlaps,
    support_graph,
    whole_bounds_m,
)
from phyblock.sim.outcomes import holds

# RP

_CORNERS: Sequence[str] = WORDS["sides_of_floor"]
_UPRIGHT: Sequence[str] = WORDS["places_upright"]
_CLEAR_M, _ABOVE_M, _LEVEL_M, _GAP_M = 0.03, 0.015, 0.005, 0.024
_SIDES = ("farthest left", "farthest right")
_RANKED = ("highest", "lowest", "front", "back")
"""Asked by wordings of their own, because they are not about the picture but about the ground."""
_NEARER = 0.75
"""The nearest block is at most this share of the next one's distance away."""


class PositionMaker(StaticMaker):
    """RP: where one block is from another as seen in the picture; the outermost, the nearest."""

    subtask: Subtask = "RP"
    drafts_a_view = 16

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Pairs of blocks, and choices of one of four."""
        for _ in range(5):
            shown = recolored(scene, rng)
            picture = goal_picture(shown, view)
            named = plain_names(picture)
            blocks = [block for block in shown.blocks if block.order in named]
            for _ in range(6):
                chosen = shuffled(rng, blocks)[:5]
                if len(chosen) == 5:
                    yield from _of_four(shown, picture, named, chosen, rng)
            for one, other in shuffled(rng, list(itertools.permutations(blocks, 2)))[:2]:
                offset = [round(float(x), 6) for x in _offset_m(one, other, view)]
                slots = {"block": named[one.order], "other": named[other.order]}
                for kind, (rule, words) in _PAIR_RULES.items():
                    try:
                        options = right_first(rule(one, other, view), words)
                    except UnfairError:
                        continue
                    about = (f"rp-{kind}", options, [picture], slots)
                    yield draft(shown, rng, *about, kind=kind, offset_m=offset)

    def answer(self, question: Question, picture: QuestionPicture, slots: Slots) -> tuple[int, ...]:
        """By the places of the blocks that the text or the options name."""
        if "block" in slots:
            one, other = (resolve_one(slots[name], picture) for name in ("block", "other"))
            require_seen(picture, orders_of([one, other]), NAMED)
            rule = _corner if set(question.options) == set(_CORNERS) else _upright
            return base.index_of(question, rule(one, other, picture.view_deg))
        named = [resolve_one(option, picture) for option in question.options]
        anchor = [resolve_one(slots["other"], picture)] if "other" in slots else []
        require_seen(picture, orders_of([*named, *anchor]), NAMED)
        if anchor:
            return (named.index(_nearest(anchor[0], named)),)
        kind = slots.get("extreme") or base.stem_of(question.wording).removeprefix("rp-")
        return (named.index(_extreme(kind, named, picture)),)


def _of_four(
    scene: Scene,
    picture: QuestionPicture,
    named: Mapping[int, str],
    chosen: Sequence[Block],
    rng: np.random.Generator,
) -> Iterator[Draft]:
    """The outermost of the last four blocks, or the one nearest to the first."""
    anchor, *four = chosen
    kind = pick(rng, (*_SIDES, *_RANKED, "nearest"))
    stem, slots = f"rp-{kind}", {}
    try:
        if kind == "nearest":
            right, slots = _nearest(anchor, four), {"other": named[anchor.order]}
        else:
            right = _extreme(kind, four, picture)
    except UnfairError:
        return
    if kind in _SIDES:
        stem, slots = "rp-extreme", {"extreme": kind}
    ranked = right_first(right, four)
    options = [f"the {named[block.order]}" for block in ranked]
    yield draft(scene, rng, stem, options, [picture], slots, kind=kind, ranked=orders_of(ranked))


def _offset_m(block: Block, other: Block, view: View) -> Floats:
    """From `other` to `block`: to the right of the picture, away from the viewer, up [m], (3,)."""
    right, away = base.picture_axes(view)
    step = center_m(block) - center_m(other)
    return np.array([step @ right, step @ away, step[2]])


def _corner(one: Block, other: Block, view: View) -> str:
    """The quarter of the floor round `other` that holds `one`, as the viewer sees it."""
    across, away, _ = _offset_m(one, other, view)
    if min(abs(across), abs(away)) < _CLEAR_M:
        raise UnfairError("is neither clearly to a side nor clearly in front or behind")
    return _CORNERS[int(2 * (away > 0) + (across > 0))]


def _upright(one: Block, other: Block, view: View) -> str:
    """Over or under it, or beside it at its height; UnfairError for all that lies between."""
    across, away, _ = _offset_m(one, other, view)
    low, high = bounds_m(one)[:, 2] - bounds_m(other)[::-1, 2]
    if max(abs(across), abs(away)) < _ABOVE_M and (low > -_LEVEL_M or high < _LEVEL_M):
        return _UPRIGHT[int(low <= -_LEVEL_M)]
    bottoms = abs(bounds_m(one)[0, 2] - bounds_m(other)[0, 2])
    if abs(across) > _CLEAR_M and bottoms < _LEVEL_M:
        return _UPRIGHT[int(2 + (across > 0))]
    raise UnfairError("is neither over, under nor beside it")


_PAIR_RULES = {"corner": (_corner, _CORNERS), "upright": (_upright, _UPRIGHT)}


def _nearest(anchor: Block, blocks: Sequence[Block]) -> Block:
    """The block whose middle is clearly nearest to that of another."""
    far = {b.order: float(np.linalg.norm(center_m(b) - center_m(anchor))) for b in blocks}
    ranked = sorted(blocks, key=lambda block: far[block.order])
    if far[ranked[0].order] > _NEARER * far[ranked[1].order]:
        raise UnfairError("two blocks are about as near")
    return ranked[0]


def _extreme(extreme: str, blocks: Sequence[Block], picture: QuestionPicture) -> Block:
    """The one of `blocks` that is clearly farthest to a side, to the front, or reaches highest."""
    if extreme in _SIDES:
        order = base.outermost(orders_of(blocks), picture, to_left=extreme == _SIDES[0])
        if order is None:
            raise UnfairError(f"two blocks are about the {extreme}")
        return next(block for block in blocks if block.order == order)
    if extreme not in _RANKED:
        raise UnfairError(f"{extreme!r} is no place")
    away = base.picture_axes(picture.view_deg)[1]
    is_upright, sign = extreme in _RANKED[:2], -1.0 if extreme in ("highest", "back") else 1.0
    reach = {
        b.order: sign * (_top_m(b) if is_upright else float(center_m(b) @ away)) for b in blocks
    }
    ranked = sorted(blocks, key=lambda block: reach[block.order])
    if reach[ranked[1].order] - reach[ranked[0].order] < _GAP_M:
        raise UnfairError(f"two blocks are about as {extreme}")
    return ranked[0]


# AP

Values = tuple[float, ...]
"""A length, or how far along and across [cm]."""
_SIDE_M, _EXACT_CM = 0.001, 0.1
_SCALES: Mapping[str, str] = WORDS["scales"]
_STEP_CM, _LONGEST_CM, _PLACE_STEP_CM = 2.5, 50.0, 5.0
_APART = (1.2, 2.0)
"""Values that are options together: each at least and at most so many times the one before."""
_KINDS = {
    **{"top": "height", "bottom": "height"},
    **{"rise": "rise", "apart": "apart", "gap": "gap", "place": "place"},
}
"""Wordings, and the sorts of questions whose shares are even: heights are one of five."""
_PAIRED = ("apart", "rise", "gap", "place")
"""Kinds that are asked of two blocks."""
_FEW_A_SCENE = ("gap", "place")
"""Kinds of which hardly any scene has four values that could be offered together."""


def _top_m(block: Block) -> float:
    """Height of a block's highest point above the ground [m]."""
    return float(bounds_m(block)[1, 2])


def grid_cm(length_m: float) -> float:
    """Return the length in centimeters where it is a multiple of 2.5 cm; else UnfairError."""
    steps = round(length_m * 100 / _STEP_CM)
    if abs(length_m * 100 - _STEP_CM * steps) > _EXACT_CM:
        raise UnfairError(f"{length_m * 100:.1f} cm is no multiple of 2.5 cm")
    return _STEP_CM * steps


def _apart(one: Block, other: Block, blocks: Sequence[Block]) -> float:
    x, y, _ = np.abs(center_m(one) - center_m(other)).tolist()
    if min(x, y) > _SIDE_M:
        raise UnfairError("the blocks stand askew, so that their distance cannot be counted")
    _require_joined(one, other, blocks)
    return float(max(x, y))


def _gap(one: Block, other: Block, blocks: Sequence[Block]) -> float:
    """The clear way between two boxes that face each other, with nothing between them."""
    if any(not SHAPES[block.type].is_box or block.euler_deg[2] % 90 for block in (one, other)):
        raise UnfairError("the blocks do not face each other with flat sides")
    _require_joined(one, other, blocks)
    low = np.minimum(bounds_m(one)[1], bounds_m(other)[1])
    high = np.maximum(bounds_m(one)[0], bounds_m(other)[0])
    is_open = high - low > _SIDE_M
    shared = low - high >= 0.5 * np.diff(bounds_m(one), axis=0)[0]
    if is_open[2] or is_open.sum() != 1 or not (shared | is_open).all():
        raise UnfairError("the blocks do not face each other")
    start, end = np.minimum(low, high) + _SIDE_M, np.maximum(low, high) - _SIDE_M
    for block in blocks:
        its_low, its_high = bounds_m(block)
        if block not in (one, other) and np.all(its_low < end) and np.all(its_high > start):
            raise UnfairError("another block stands in the gap")
    return float((high - low)[is_open][0])


LENGTHS: Mapping[str, Callable[[Block, Block, Sequence[Block]], float]] = {
    "top": lambda one, *_: _top_m(one),
    "bottom": lambda one, *_: float(bounds_m(one)[0, 2]),
    "apart": _apart,
    "rise": lambda one, other, _: abs(_top_m(one) - _top_m(other)),
    "gap": _gap,
}
"""By kind, of a block, another, and all blocks; UnfairError for what cannot be determined."""


def _require_joined(one: Block, other: Block, blocks: Sequence[Block]) -> None:
    """UnfairError unless the two belong to one structure, by what rests on what."""
    reached, waiting = {one.order}, [one.order]
    while waiting:
        order = waiting.pop()
        touching = {b.order for b in blocks if order in b.depend}
        touching.update(*(b.depend for b in blocks if b.order == order))
        waiting += sorted(touching - reached)
        reached |= touching
    if other.order not in reached:
        raise UnfairError("the blocks are parts of structures that stand apart")


class DistanceMaker(StaticMaker):
    """AP: heights, distances and places in centimeters, on the blocks' grid.

    A block of known size, named in the text, stands in the picture as the scale.
    """

    subtask: Subtask = "AP"
    views_a_scene = 2
    drafts_a_view = 20

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Heights of blocks and distances of pairs, as far as they are on the grid."""
        for _ in range(3):
            shown = recolored(scene, rng)
            picture = goal_picture(shown, view)
            types = {block.type for block in seen_blocks(picture, NAMED)}
            scales = [text for kind, text in _SCALES.items() if kind in types]
            if scales:
                yield from _distances(shown, picture, pick(rng, scales), rng)

    def answer(self, question: Question, picture: QuestionPicture, slots: Slots) -> tuple[int, ...]:
        """By the places of the blocks that the text names."""
        named = [resolve_one(slots[name], picture) for name in ("block", "other") if name in slots]
        require_seen(picture, orders_of(named), NAMED)
        if slots["scale"] not in [_SCALES.get(b.type) for b in seen_blocks(picture, NAMED)]:
            raise UnfairError("the block that gives the scale cannot be seen")
        rule = base.stem_of(question.wording).removeprefix("ap-")
        if rule not in _KINDS or (rule in _PAIRED) != (len(named) == 2):
            raise UnfairError(f"the wording {question.wording!r} asks for no length")
        right_cm = _values_cm(rule, named[0], named[-1], picture)
        if rule != "place":
            try:
                values = sorted(float(option.removesuffix(" cm")) for option in question.options)
            except ValueError as error:
                raise UnfairError("some option is no length in centimeters") from error
            if any(high < _APART[0] * low for low, high in itertools.pairwise(values)):
                raise UnfairError("two values are less than 20 % apart")
        return base.index_of(question, _text_of(right_cm))


def _distances(
    scene: Scene, picture: QuestionPicture, scale: str, rng: np.random.Generator
) -> Iterator[Draft]:
    """One draft of each kind, as far as there are four values to offer."""
    named = plain_names(picture)
    blocks = [block for block in scene.blocks if block.order in named]
    pairs = shuffled(rng, list(itertools.permutations(blocks, 2)))[:90]
    for rule in shuffled(rng, list(_KINDS)):
        found: dict[Values, list[tuple[Block, Block]]] = {}
        for one, other in pairs if rule in _PAIRED else [(block, block) for block in blocks]:
            try:
                found.setdefault(_values_cm(rule, one, other, picture), []).append((one, other))
            except UnfairError:
                continue
        values = _four_values(rule, found, rng)
        if not values:
            continue
        one, other = pick(rng, found[values[0]])
        slots = {"block": named[one.order], "scale": scale}
        if rule in _PAIRED:
            slots["other"] = named[other.order]
        right, *_ = options = list(map(_text_of, values))
        about = (f"ap-{rule}", options, [picture], slots)
        yield draft(scene, rng, *about, kind=_KINDS[rule], right=right)


def _values_cm(rule: str, one: Block, other: Block, picture: QuestionPicture) -> Values:
    """The length asked for, or steps along and across the length of `other`; or UnfairError."""
    if rule != "place":
        return (grid_cm(LENGTHS[rule](one, other, picture.blocks)),)
    _require_joined(one, other, picture.blocks)
    axis, step = base.length_axis(other), np.abs(center_m(one) - center_m(other))
    return grid_cm(float(step[axis])), grid_cm(float(step[1 - axis]))


def _four_values(
    rule: str, found: Collection[Values], rng: np.random.Generator
) -> Sequence[Values]:
    """Four values, the right one first; none where no four stand together."""
    # All four are true of something in the picture and the one asked for is drawn, so that a
    # frequent length is not right more often. Where no scene has four, `keeping_odds` sees to it.
    fours = _squares(found) if rule == "place" else _ladders()
    whole = [four for four in fours if set(four) <= set(found)]
    if whole:
        four = pick(rng, whole)
        return right_first(pick(rng, four), four)
    if rule not in _FEW_A_SCENE or not found:
        return ()
    right = pick(rng, sorted(found))
    beside = [four for four in fours if right in four]
    return right_first(right, pick(rng, beside)) if beside else ()


@functools.cache
def _ladders() -> Sequence[Sequence[Values]]:
    """All sets of four lengths on the grid that may stand together, rising."""
    grid = [_STEP_CM * n for n in range(1, round(_LONGEST_CM / _STEP_CM) + 1)]
    return [
        [(length,) for length in four]
        for four in itertools.combinations(grid, 4)
        if all(_APART[0] * a <= b <= _APART[1] * a for a, b in itertools.pairwise(four))
    ]


def _squares(found: Collection[Values]) -> Sequence[Sequence[Values]]:
    """Places 5 cm from one another along and across, four at a time, one of them among `found`."""
    steps = (0, _PLACE_STEP_CM)
    corners = sorted({(a - x, b - y) for a, b in found for x in steps for y in steps})
    return [[(a + x, b + y) for x in steps for y in steps] for a, b in corners if min(a, b) >= 0]


def _text_of(values_cm: Values) -> str:
    if len(values_cm) == 1:
        return f"{values_cm[0]:g} cm"
    along, across = values_cm
    return f"{along:g} cm along and {across:g} cm across"


# RD

Below = Mapping[int, frozenset[int]]
"""The orders that each block rests on, by its order."""
_RELATIONS: Mapping[str, Callable[[int, int, Below], bool]] = {
    "on": lambda block, anchor, below: anchor in below[block],
    "under": lambda block, anchor, below: block in below[anchor],
    "needed": lambda block, anchor, below: block in _all_below(anchor, below),
    "carried": lambda block, anchor, below: anchor in _all_below(block, below),
}


class DependencyMaker(StaticMaker):
    """RD: exactly one of four blocks has the relation; contacts are found in the geometry."""

    subtask: Subtask = "RD"
    drafts_a_view = 16

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One block to ask about and four to choose from, drawn again and again."""
        below = support_graph(scene.blocks)
        for _ in range(12):
            shown = recolored(scene, rng)
            picture = goal_picture(shown, view)
            named = plain_names(picture)
            if len(named) < 5:
                continue
            anchor = pick(rng, list(named))
            for rule in shuffled(rng, list(_RELATIONS))[:2]:
                rest = [order for order in named if order != anchor]
                right = [order for order in rest if _RELATIONS[rule](order, anchor, below)]
                wrong = shuffled(rng, [order for order in rest if order not in right])[:3]
                if right and len(wrong) == 3:
                    chosen = [pick(rng, right), *wrong]
                    options, slots = [f"the {named[o]}" for o in chosen], {"block": named[anchor]}
                    contacts = {str(o): sorted(below[o]) for o in (anchor, *chosen)}
                    about = (f"rd-{rule}", options, [picture], slots)
                    yield draft(shown, rng, *about, kind=rule, rests_on=contacts)

    def answer(self, question: Question, picture: QuestionPicture, slots: Slots) -> tuple[int, ...]:
        """By the contacts of the blocks that the text and the options name."""
        anchor = resolve_one(slots["block"], picture)
        named = [resolve_one(option, picture) for option in question.options]
        require_seen(picture, orders_of([anchor, *named]), NAMED)
        rule = base.stem_of(question.wording).removeprefix("rd-")
        if rule not in _RELATIONS or anchor in named:
            raise UnfairError("asks about no dependency, or a block about itself")
        below = support_graph(picture.blocks)
        return base.only_index([_RELATIONS[rule](b.order, anchor.order, below) for b in named])


def _all_below(order: int, below: Below) -> set[int]:
    found: set[int] = set()
    waiting = [order]
    while waiting:
        new = below[waiting.pop()] - {GROUND} - found
        found |= new
        waiting += new
    return found


# RR

_STEP_DEG = 15
AXIS_TURNS: tuple[str, ...] = tuple(WORDS["turns_about_axes"])
"""Turns of a block that lies along the ground; the side does not matter."""
_SAME = 1e-4
_FREE_M, _STEP_M, _NEAR_M = 0.02, 0.01, 0.002
_PAIRS, _LOOSE = 6, 4
_PLACES = 6
"""So many are tried for a loose block; with one, turns that are hard to see would be rare."""


def _about(axis: int, angle_deg: float) -> Floats:
    """Rotation matrix (3, 3) about an axis of the world."""
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    one, two = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[one, one] = matrix[two, two] = cosine
    matrix[two, one], matrix[one, two] = sine, -sine
    return matrix


@functools.lru_cache(maxsize=4096)
def _is_alike(block_type: BlockType, one_deg: Euler, other_deg: Euler) -> bool:
    """True if no one can tell two orientations of a type apart."""
    one, other = (orientation_class(block_type, deg) for deg in (one_deg, other_deg))
    return bool(np.abs(np.array(one) - np.array(other)).max() < _SAME)


def axis_turns(block: Block, other: Block) -> tuple[str, ...]:
    """Return those of `AXIS_TURNS` that take `other` to how `block` is oriented, up to symmetry.

    None when they are of different types; UnfairError where `other` has no length that lies
    along the ground.
    """
    if block.type != other.type or not SHAPES[block.type].is_long:
        return ()
    images = _images(other.euler_deg, base.length_axis(other))
    fitting = (name for name, deg in images if _is_alike(block.type, block.euler_deg, deg))
    return tuple(dict.fromkeys(fitting))


def tipped_over(block: Block) -> tuple[Block, ...]:
    """Return the block after each of `AXIS_TURNS`, to either side; UnfairError as `axis_turns`."""
    angles = dict.fromkeys(angle for _, angle in _images(block.euler_deg, base.length_axis(block)))
    return tuple(replace(block, euler_deg=angle) for angle in angles)


@functools.lru_cache(maxsize=4096)
def _images(euler_deg: Euler, along: int) -> Sequence[tuple[str, Euler]]:
    """Each turn, to either side, with the orientation that it gives."""
    rotation = euler_deg_to_matrix(euler_deg)
    images = [(AXIS_TURNS[0], euler_deg)]
    for name, axis in zip(AXIS_TURNS[1:], (2, along, 1 - along), strict=True):
        images += [(name, angles_deg(_about(axis, side) @ rotation)) for side in (90.0, -90.0)]
    return images


def vertical_turns_deg(block: Block, other: Block) -> tuple[int, ...]:
    """Turns about the vertical, -165 to 180 degrees, that take `other` to how `block` is oriented.

    In steps of 15 degrees, the least first, counterclockwise seen from above when positive; none
    when the two are of different types, or one has to be tipped over as well. Up to the blocks'
    own symmetry: orientations count as equal when no one can tell them apart.
    """
    if block.type != other.type:
        return ()
    turns = sorted(range(-180 + _STEP_DEG, 181, _STEP_DEG), key=lambda turn: (abs(turn), -turn))
    fits = functools.partial(_is_alike, block.type, block.euler_deg)
    return tuple(turn for turn in turns if fits(_yawed(other.euler_deg, turn)))


def turned_about_vertical(block: Block, angle_deg: float) -> Block:
    """Return the block turned about the vertical line through the middle of its bounding box."""
    about = center_m(block)
    place = about + _about(2, angle_deg) @ (np.array(block.position_m) - about)
    x, y, z = (round(part, 6) for part in place.tolist())
    return replace(block, position_m=(x, y, z), euler_deg=_yawed(block.euler_deg, angle_deg))


def _yawed(euler_deg: Euler, turn_deg: float) -> Euler:
    roll, pitch, yaw = euler_deg
    return roll, pitch, round((yaw + turn_deg) % 360, 6)


def put_beside(block: Block, blocks: Sequence[Block], rng: np.random.Generator) -> Block:
    """Put the block, as it is oriented, on the ground in a direction drawn from the blocks' middle.

    It gets an order that none of them has, and stands as near to them as leaves 2 cm free.
    """
    middle = whole_bounds_m(blocks).mean(axis=0)
    angle = float(rng.uniform(0, 2 * math.pi))
    direction = np.array([math.cos(angle), math.sin(angle)])
    loose = replace(block, order=max(b.order for b in blocks) + 1, depend=(), layer=1)
    box = bounds_m(loose)
    distance = 0.0
    while True:
        place_m = middle[:2] + distance * direction
        step = np.array([*(place_m - box.mean(axis=0)[:2]), -box[0, 2]])
        x, y, z = (round(float(part), 4) for part in np.array(loose.position_m) + step)
        placed = replace(loose, position_m=(x, y, z))
        if not any(boxes_near(bounds_m(placed), bounds_m(other), _FREE_M) for other in blocks):
            return placed
        distance += _STEP_M


class _Rule(NamedTuple):
    """One way to tell the turn of a block, compared with another of its type."""

    stem: str
    kind: str
    options: tuple[str, ...]
    phrases: Callable[[Block, Block], Sequence[str]]


def _vertical(stem: str, own: tuple[int, ...], turns: Sequence[int], is_signed: bool) -> _Rule:
    """The rule for blocks that the turns `own` about the vertical map to themselves."""

    def text(turn: int) -> str:
        side = "" if turn in (0, 180) else " counterclockwise" if turn > 0 else " clockwise"
        return f"{abs(turn)} degrees{side if is_signed else ''}"

    def phrases(block: Block, other: Block) -> Sequence[str]:
        if vertical_turns_deg(block, block) != own:
            return ()
        return [text(turn) for turn in vertical_turns_deg(block, other)]

    return _Rule(stem, "vertical", tuple(map(text, turns)), phrases)


_ON_THE_SPOT = (
    _vertical("rr-angle", (0, 180), (0, 30, 60, 90), is_signed=False),
    _vertical("rr-turn", (0,), (0, 90, -90, 180), is_signed=True),
)
_AXIS = _Rule("rr-axis", "axis", AXIS_TURNS, axis_turns)
"""Of one with a length, which may roll over or stand on end as well."""
_RULES = {rule.stem: rule for rule in (*_ON_THE_SPOT, _AXIS)}


class RotationMaker(StaticMaker):
    """RR: two blocks of a type, with colors of their own.

    Either one that carries nothing is turned on the spot about the vertical, or a loose one
    beside the structure lies as another block of it would after a turn about some axis.
    """

    subtask: Subtask = "RR"

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Pairs of a type, one of them oriented so that a phrase drawn comes out."""
        picture = goal_picture(scene, view)
        long = [block for block in seen_blocks(picture, STUDIED) if SHAPES[block.type].is_long]
        for other in shuffled(rng, long)[:_LOOSE]:
            yield from _about_some_axis(view, scene, other, rng)
        carrying = {order for block in scene.blocks for order in block.depend}
        pairs = [
            (one, other)
            for one, other in itertools.permutations(seen_blocks(picture, NAMED), 2)
            if one.type == other.type and one.order not in carrying
        ]
        for pair in shuffled(rng, pairs)[:_PAIRS]:
            for rule in _ON_THE_SPOT:
                yield from _turned_on_the_spot(view, scene, pair, rule, rng)

    def answer(self, question: Question, picture: QuestionPicture, slots: Slots) -> tuple[int, ...]:
        """By the orientations in the picture, up to the symmetry of the type."""
        pair = [resolve_one(slots[name], picture) for name in ("block", "other")]
        require_seen(picture, orders_of(pair), STUDIED)
        rule = _RULES.get(base.stem_of(question.wording))
        true = rule.phrases(*pair) if rule else ()
        if not true:
            raise UnfairError("are not of one type, or not turned as the wording asks")
        return base.only_index([option in true for option in question.options])


def _about_some_axis(
    view: View, scene: Scene, other: Block, rng: np.random.Generator
) -> Iterator[Draft]:
    """A loose block beside the structure that lies as `other` would after a turn drawn."""
    try:
        images = [(one, axis_turns(one, other)) for one in tipped_over(other)]
    except UnfairError:
        return
    if any(all(true != (phrase,) for _, true in images) for phrase in AXIS_TURNS):
        return
    phrase = pick(rng, AXIS_TURNS)
    turned = [one for one, true in images if true == (phrase,)]
    for _ in range(_PLACES):
        loose = put_beside(pick(rng, turned), scene.blocks, rng)
        every = replace(scene, blocks=(*scene.blocks, loose))
        every = base.with_own_colors(every, [other.order, loose.order], rng)
        picture, both = goal_picture(every, view), (loose.order, other.order)
        if are_seen(picture, both, STUDIED) and holds(every.blocks, loose.order):
            colored = replace(every, blocks=every.blocks[:-1])
            pair = (every.blocks[-1], next(b for b in colored.blocks if b.order == other.order))
            yield from _drafted(colored, picture, pair, _AXIS, phrase, rng)
            return


def _turned_on_the_spot(
    view: View, scene: Scene, pair: tuple[Block, Block], rule: _Rule, rng: np.random.Generator
) -> Iterator[Draft]:
    """The first of two is turned about the vertical so that a phrase drawn is true."""
    phrase = pick(rng, rule.options)
    colored = base.with_own_colors(scene, orders_of(pair), rng)
    mine, its = (next(b for b in colored.blocks if b.order == x.order) for x in pair)
    for turn in shuffled(rng, range(0, 360, _STEP_DEG)):
        moved = turned_about_vertical(mine, turn) if turn else mine
        if phrase in rule.phrases(moved, its)[:1]:
            blocks = tuple(moved if b.order == mine.order else b for b in colored.blocks)
            picture = goal_picture(replace(colored, blocks=blocks), view)
            if _fits(picture, moved, mine) and are_seen(picture, orders_of([moved, its]), STUDIED):
                yield from _drafted(colored, picture, (mine, its), rule, phrase, rng)
                return


def _drafted(
    scene: Scene,
    picture: QuestionPicture,
    pair: tuple[Block, Block],
    rule: _Rule,
    phrase: str,
    rng: np.random.Generator,
) -> Iterator[Draft]:
    """The draft, where color and shape are names that fit both blocks as they are seen."""
    one, other = (f"{block.color} {shape_word(block.type)}" for block in pair)
    try:
        resolve_one(one, picture)
        resolve_one(other, picture)
    except UnfairError:
        return
    slots, options = {"block": one, "other": other}, right_first(phrase, rule.options)
    yield draft(scene, rng, rule.stem, options, [picture], slots, kind=rule.kind, turned=phrase)


def _fits(picture: QuestionPicture, moved: Block, before: Block) -> bool:
    """True if the moved block overlaps nothing and rests on what it rested on."""
    boxes = [bounds_m(block) for block in (moved, before)]
    near = [
        block
        for block in picture.blocks
        if block is not moved and any(boxes_near(bounds_m(block), box, _NEAR_M) for box in boxes)
    ]
    if drop_height_m(moved, near) > FIT_TOLERANCE_M:
        return False
    if any(moved.order in (o.first, o.second) for o in find_overlaps([*near, moved])):
        return False
    now, then = (support_graph([*near, block])[moved.order] for block in (moved, before))
    return now == then
