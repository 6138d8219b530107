"""Quarter turns about upright and level axes: which one takes one orientation to another."""

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
from phyblock.making.questions.measures import (
    length_axis,
    put_beside,
    turned_about_vertical,
    vertical_turns_deg,
)
from phyblock.making.questions.picture_view import (
    NAMED,
    STUDIED,
    View,
    are_seen,
    goal_picture,
    require_seen,
    shown_picture,
)
from phyblock.making.questions.pictured_drafts import only_index
from phyblock.making.questions.properties import with_own_colors
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.referring import resolve_one, shape_word
from phyblock.making.questions.selection import pick, shuffled
from phyblock.making.questions.static_drafts import StaticMaker, draft, seen_blocks
from phyblock.making.questions.wording import slots_of, stem_of
from phyblock.sim.contact import (
    FIT_TOLERANCE_M,
    bounds_m,
    drop_height_m,
    find_overlaps,
    support_graph,
)
from phyblock.sim.outcomes import holds

AXIS_TURNS: tuple[str, ...] = (
    "no turn at all",
    "a quarter turn about an upright axis",
    "a quarter turn about a level axis along its length",
    "a quarter turn about a level axis across its length",
)
"""What a block that lies along the ground can be told to do; to which side does not matter."""
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


@dataclass(frozen=True)
class _Rule:
    """One way of telling how a block is turned, compared with another of its type.

    `phrases` are those of the options that are true of the two.
    """

    stem: str
    kind: str
    options: tuple[str, ...]
    phrases: Callable[[Block, Block], Sequence[str]]


def _angle(turn_deg: int) -> str:
    return f"{abs(turn_deg)} degrees"


def _turn(turn_deg: int) -> str:
    direction = "" if turn_deg in (0, 180) else f" {_direction(turn_deg)}"
    return f"{abs(turn_deg)} degrees{direction}"


def _direction(turn_deg: int) -> str:
    return "counterclockwise" if turn_deg > 0 else "clockwise"


def _angles(block: Block, other: Block) -> Sequence[str]:
    if vertical_turns_deg(block, block) != (0, 180):
        return ()
    return [_angle(turn) for turn in vertical_turns_deg(block, other)]


def _turns_rotations(block: Block, other: Block) -> Sequence[str]:
    if vertical_turns_deg(block, block) != (0,):
        return ()
    return [_turn(turn) for turn in vertical_turns_deg(block, other)]


_RULES: tuple[_Rule, ...] = (
    # A block that a half turn about the vertical maps to itself,
    _Rule("angle", "vertical", tuple(map(_angle, (0, 30, 60, 90))), _angles),
    # one without such a symmetry,
    _Rule("turn", "vertical", tuple(map(_turn, (0, 90, -90, 180))), _turns_rotations),
    # and one with a length, which may roll over or stand on end as well.
    _Rule("axis", "axis", AXIS_TURNS, axis_turns),
)
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
        for one, other in shuffled(rng, pairs)[:_PAIRS]:
            for rule in _RULES[:2]:
                yield from _on_the_spot(view, scene, (one, other), rule, rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """From the orientations in the picture, up to the symmetry of the type."""
        picture, slots = shown_picture(question), slots_of(question)
        one, other = (resolve_one(slots[name], picture) for name in ("block", "other"))
        require_seen(picture, [one.order, other.order], STUDIED)
        rule = next((r for r in _RULES if stem_of(question.wording) == f"rr-{r.stem}"), None)
        true = rule.phrases(one, other) if rule else ()
        if not true:
            raise UnfairError("are not of one type, or not turned as the wording asks")
        return only_index([option in true for option in question.options])


def _about_some_axis(
    view: View, scene: Scene, other: Block, rng: np.random.Generator
) -> Iterator[Draft]:
    """A loose block beside the structure that lies as `other` would after a turn drawn.

    None where some turn cannot be told from another, which would tell what is asked.
    """
    rule = _RULES[2]
    try:
        images = [(one, rule.phrases(one, other)) for one in tipped_over(other)]
    except UnfairError:
        return
    if any(all(true != (phrase,) for _, true in images) for phrase in rule.options):
        return
    phrase = pick(rng, rule.options)
    turned = [one for one, true in images if true == (phrase,)]
    for _ in range(_PLACES):
        loose = put_beside(pick(rng, turned), scene.blocks, rng)
        every = replace(scene, blocks=(*scene.blocks, loose))
        every = with_own_colors(every, [other.order, loose.order], rng)
        picture, both = goal_picture(every, view), (loose.order, other.order)
        if are_seen(picture, both, STUDIED) and holds(every.blocks, loose.order):
            colored = replace(every, blocks=every.blocks[:-1])
            its = next(block for block in colored.blocks if block.order == other.order)
            yield from _drafted(colored, picture, (every.blocks[-1], its), rule, phrase, rng)
            return


def _on_the_spot(
    view: View, scene: Scene, pair: tuple[Block, Block], rule: _Rule, rng: np.random.Generator
) -> Iterator[Draft]:
    """The first of two is turned about the vertical so that a phrase drawn is true."""
    phrase = pick(rng, rule.options)
    colored = with_own_colors(scene, [block.order for block in pair], rng)
    mine, its = (next(b for b in colored.blocks if b.order == x.order) for x in pair)
    for turn in shuffled(rng, range(0, 360, 15)):
        moved = turned_about_vertical(mine, turn) if turn else mine
        if phrase in rule.phrases(moved, its)[:1]:
            blocks = tuple(moved if b.order == mine.order else b for b in colored.blocks)
            picture = goal_picture(replace(colored, blocks=blocks), view)
            if _is_sound(picture, moved, mine, its):
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
    options = [phrase, *(option for option in rule.options if option != phrase)]
    noun = shape_word(pair[0].type)
    slots = {"block": f"{pair[0].color} {noun}", "other": f"{pair[1].color} {noun}"}
    try:
        for name in slots.values():
            resolve_one(name, picture)
    except UnfairError:
        return
    stem = f"rr-{rule.stem}"
    yield draft(scene, picture, rng, stem, slots, options, phrase, rule.kind, turned=phrase)


def _is_sound(picture: QuestionPicture, moved: Block, before: Block, other: Block) -> bool:
    """Whether the moved block fits, rests on what it rested on, and both show enough."""
    near = [b for b in picture.blocks if b is not moved and _is_near(b, moved, before)]
    if drop_height_m(moved, near) > FIT_TOLERANCE_M:
        return False
    if any(moved.order in (o.first, o.second) for o in find_overlaps([*near, moved])):
        return False
    rests_on = [support_graph([*near, block])[moved.order] for block in (moved, before)]
    if rests_on[0] != rests_on[1]:
        return False
    return are_seen(picture, (moved.order, other.order), STUDIED)


def _is_near(block: Block, *others: Block) -> bool:
    """Whether the box round a block comes close to that round one of the others."""
    low, high = bounds_m(block)
    for other in others:
        its_low, its_high = bounds_m(other)
        if bool(np.all(low <= its_high + _NEAR_M) and np.all(its_low <= high + _NEAR_M)):
            return True
    return False
