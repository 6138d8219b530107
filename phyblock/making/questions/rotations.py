"""RR: the quarter turn that takes one orientation to another, about upright and level axes."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
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
from phyblock.making.questions.draft import (
    Draft,
    UnfairError,
    draft,
    only_index,
    pick,
    right_first,
    shuffled,
    stem_of,
)
from phyblock.making.questions.referring import resolve_one, shape_word
from phyblock.making.questions.view import (
    NAMED,
    STUDIED,
    StaticMaker,
    View,
    are_seen,
    center_m,
    goal_picture,
    length_axis,
    orders_of,
    require_seen,
    seen_blocks,
    with_own_colors,
)
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
AXIS_TURNS: tuple[str, ...] = (
    "no turn at all",
    "a quarter turn about an upright axis",
    "a quarter turn about a level axis along its length",
    "a quarter turn about a level axis across its length",
)
"""Turns of a block that lies along the ground; the side does not matter."""
_SAME = 1e-4


def axis_turns(block: Block, other: Block) -> tuple[str, ...]:
    """Those of `AXIS_TURNS` that take `other` to how `block` is oriented, up to symmetry.

    None when they are of different types; UnfairError where `other` has no length that lies
    along the ground.
    """
    if block.type != other.type or not SHAPES[block.type].is_long:
        return ()
    along = length_axis(other)
    return _turns(block.type, block.euler_deg, other.euler_deg, along)


def tipped_over(block: Block) -> tuple[Block, ...]:
    """The block after each of `AXIS_TURNS`, to either side; UnfairError as `axis_turns`."""
    angles = dict.fromkeys(angle for _, angle in _images(block.euler_deg, length_axis(block)))
    return tuple(replace(block, euler_deg=angle) for angle in angles)


@functools.lru_cache(maxsize=4096)
def _turns(
    block_type: BlockType, euler_deg: Euler, other_deg: Euler, along: int
) -> tuple[str, ...]:
    wanted = np.array(orientation_class(block_type, euler_deg))
    found = []
    for name, image_deg in _images(other_deg, along):
        image = np.array(orientation_class(block_type, image_deg))
        if np.abs(wanted - image).max() < _SAME and name not in found:
            found.append(name)
    return tuple(found)


def _images(euler_deg: Euler, along: int) -> list[tuple[str, Euler]]:
    """Each turn, to either side, with the orientation that it gives."""
    rotation = euler_deg_to_matrix(euler_deg)
    images = [(AXIS_TURNS[0], euler_deg)]
    for name, axis in zip(AXIS_TURNS[1:], (2, along, 1 - along), strict=True):
        images += [(name, angles_deg(_about(axis, side) @ rotation)) for side in (90.0, -90.0)]
    return images


def _about(axis: int, angle_deg: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Rotation matrix (3, 3) about an axis of the world."""
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    one, two = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[one, one] = matrix[two, two] = cosine
    matrix[two, one], matrix[one, two] = sine, -sine
    return matrix


def vertical_turns_deg(block: Block, other: Block) -> tuple[int, ...]:
    """Turns about the vertical, -165 to 180 degrees, that take `other` to how `block` is oriented.

    In steps of 15 degrees, the least first, counterclockwise seen from above when positive; none
    when the two are of different types, or one has to be tipped over as well. Up to the blocks'
    own symmetry: orientations count as equal when no one can tell them apart.
    """
    if block.type != other.type:
        return ()
    return _vertical(block.type, block.euler_deg, other.euler_deg)


@functools.lru_cache(maxsize=4096)
def _vertical(block_type: BlockType, euler_deg: Euler, other_deg: Euler) -> tuple[int, ...]:
    wanted = np.array(orientation_class(block_type, euler_deg))
    roll, pitch, yaw = other_deg
    turns = sorted(range(-180 + _STEP_DEG, 181, _STEP_DEG), key=lambda turn: (abs(turn), -turn))
    distinct = []
    for turn in turns:
        turned = orientation_class(block_type, (roll, pitch, _yaw_deg(yaw, turn)))
        if np.abs(wanted - np.array(turned)).max() < _SAME:
            distinct.append(turn)
    return tuple(distinct)


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


_CLEAR_M = 0.02
_STEP_M = 0.01


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
        near = (boxes_near(bounds_m(placed), bounds_m(other), _CLEAR_M) for other in blocks)
        if not any(near):
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


def _angle(turn_deg: int) -> str:
    return f"{abs(turn_deg)} degrees"


def _turn(turn_deg: int) -> str:
    if turn_deg in (0, 180):
        return _angle(turn_deg)
    return f"{_angle(turn_deg)} {'counterclockwise' if turn_deg > 0 else 'clockwise'}"


def _vertical_phrases(
    block: Block, other: Block, own: tuple[int, ...], text_of: Callable[[int], str]
) -> Sequence[str]:
    """The turns between two blocks that the turns `own` about the vertical map to themselves."""
    if vertical_turns_deg(block, block) != own:
        return ()
    return [text_of(turn) for turn in vertical_turns_deg(block, other)]


_ANGLE = _Rule(
    *("angle", "vertical", tuple(map(_angle, (0, 30, 60, 90)))),
    lambda block, other: _vertical_phrases(block, other, (0, 180), _angle),
)
"""Of a block that a half turn about the vertical maps to itself."""
_TURN = _Rule(
    *("turn", "vertical", tuple(map(_turn, (0, 90, -90, 180)))),
    lambda block, other: _vertical_phrases(block, other, (0,), _turn),
)
"""Of one without such a symmetry."""
_AXIS = _Rule("axis", "axis", AXIS_TURNS, axis_turns)
"""Of one with a length, which may roll over or stand on end as well."""
_PAIRS = 6
_LOOSE = 4
_PLACES = 6
"""So many are tried for a loose block; with one, turns that are hard to see would be rare."""
_NEAR_M = 0.002


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
            for rule in (_ANGLE, _TURN):
                yield from _on_the_spot(view, scene, pair, rule, rng)

    def answer(
        self, question: Question, picture: QuestionPicture, slots: Mapping[str, str]
    ) -> tuple[int, ...]:
        """By the orientations in the picture, up to the symmetry of the type."""
        pair = [resolve_one(slots[name], picture) for name in ("block", "other")]
        require_seen(picture, orders_of(pair), STUDIED)
        stem = stem_of(question.wording)
        rule = next((r for r in (_ANGLE, _TURN, _AXIS) if stem == f"rr-{r.stem}"), None)
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


def _on_the_spot(
    view: View, scene: Scene, pair: tuple[Block, Block], rule: _Rule, rng: np.random.Generator
) -> Iterator[Draft]:
    """The first of two is turned about the vertical so that a phrase drawn is true."""
    phrase = pick(rng, rule.options)
    colored = with_own_colors(scene, orders_of(pair), rng)
    mine, its = (next(b for b in colored.blocks if b.order == x.order) for x in pair)
    for turn in shuffled(rng, range(0, 360, 15)):
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
    stem, kind = f"rr-{rule.stem}", rule.kind
    yield draft(scene, rng, stem, options, [picture], phrase, slots, kind, turned=phrase)


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
