"""RR: the quarter turn that takes one orientation to another, about upright and level axes."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

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
    length_axis,
    only_index,
    orders_of,
    pick,
    require_seen,
    right_first,
    seen_blocks,
    shuffled,
    stem_of,
    with_own_colors,
)
from phyblock.making.questions.names import resolve_one, shape_word
from phyblock.sim.contact import (
    FIT_TOLERANCE_M,
    bounds_m,
    boxes_near,
    drop_height_m,
    find_overlaps,
    support_graph,
    whole_bounds_m,
)
from phyblock.sim.outcomes import holds

_STEP_DEG = 15
AXIS_TURNS: tuple[str, ...] = tuple(WORDS["turns_about_axes"])
"""Turns of a block that lies along the ground; the side does not matter."""
_SAME = 1e-4
_CLEAR_M, _STEP_M, _NEAR_M = 0.02, 0.01, 0.002
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
    """Those of `AXIS_TURNS` that take `other` to how `block` is oriented, up to symmetry.

    None when they are of different types; UnfairError where `other` has no length that lies
    along the ground.
    """
    if block.type != other.type or not SHAPES[block.type].is_long:
        return ()
    images = _images(other.euler_deg, length_axis(other))
    fitting = (name for name, deg in images if _is_alike(block.type, block.euler_deg, deg))
    return tuple(dict.fromkeys(fitting))


def tipped_over(block: Block) -> tuple[Block, ...]:
    """The block after each of `AXIS_TURNS`, to either side; UnfairError as `axis_turns`."""
    angles = dict.fromkeys(angle for _, angle in _images(block.euler_deg, length_axis(block)))
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
    roll, pitch, yaw = other.euler_deg
    turns = sorted(range(-180 + _STEP_DEG, 181, _STEP_DEG), key=lambda turn: (abs(turn), -turn))
    return tuple(
        turn
        for turn in turns
        if _is_alike(block.type, block.euler_deg, (roll, pitch, _yaw_deg(yaw, turn)))
    )


def turned_about_vertical(block: Block, angle_deg: float) -> Block:
    """The block turned about the vertical line through the middle of its bounding box."""
    about = center_m(block)
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    x, y, z = (about + turn @ (np.array(block.position_m) - about)).tolist()
    roll, pitch, yaw = block.euler_deg
    euler_deg = (roll, pitch, _yaw_deg(yaw, angle_deg))
    return replace(block, position_m=(round(x, 6), round(y, 6), round(z, 6)), euler_deg=euler_deg)


def _yaw_deg(yaw_deg: float, turn_deg: float) -> float:
    return round((yaw_deg + turn_deg) % 360, 6)


def put_beside(block: Block, blocks: Sequence[Block], rng: np.random.Generator) -> Block:
    """The block, as it is oriented, on the ground in a direction drawn from the blocks' middle.

    It gets an order that none of them has, and stands as near to them as leaves 2 cm free.
    """
    low, high = whole_bounds_m(blocks)
    middle = (low + high) / 2
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
        if not any(boxes_near(bounds_m(placed), bounds_m(other), _CLEAR_M) for other in blocks):
            return placed
        distance += _STEP_M


@dataclass(frozen=True)
class _Rule:
    """One way to tell the turn of a block, compared with another of its type.

    `phrases` are those of the options that are true of the two.
    """

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
        stem = stem_of(question.wording)
        rule = next((rule for rule in (*_ON_THE_SPOT, _AXIS) if rule.stem == stem), None)
        true = rule.phrases(*pair) if rule else ()
        if not true:
            raise UnfairError("are not of one type, or not turned as the wording asks")
        return only_index([option in true for option in question.options])


def _about_some_axis(
    view: View, scene: Scene, other: Block, rng: np.random.Generator
) -> Iterator[Draft]:
    """A loose block beside the structure that lies as `other` would after a turn drawn.

    None where some turn cannot be told from another, which would tell what is asked.
    """
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
        every = with_own_colors(every, [other.order, loose.order], rng)
        picture, both = goal_picture(every, view), (loose.order, other.order)
        if are_seen(picture, both, STUDIED) and holds(every.blocks, loose.order):
            colored = replace(every, blocks=every.blocks[:-1])
            its = next(block for block in colored.blocks if block.order == other.order)
            yield from _drafted(colored, picture, (every.blocks[-1], its), _AXIS, phrase, rng)
            return


def _turned_on_the_spot(
    view: View, scene: Scene, pair: tuple[Block, Block], rule: _Rule, rng: np.random.Generator
) -> Iterator[Draft]:
    """The first of two is turned about the vertical so that a phrase drawn is true."""
    phrase = pick(rng, rule.options)
    colored = with_own_colors(scene, orders_of(pair), rng)
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
