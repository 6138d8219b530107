"""RR: how a block is turned, compared with another of its type.

A loose block beside the structure lies as a block of the structure would after a turn: about the
vertical, or about some axis.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import (
    SHAPES,
    BlockType,
    Euler,
    euler_deg_to_matrix,
    orientation_class,
)
from phyblock.domain.question import Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.domain.symmetry import angles_deg
from phyblock.making.questions import base, sight
from phyblock.making.questions.base import Asked, Floats, StaticMaker, UnfairError, View, pick
from phyblock.making.questions.names import resolve_one, shape_word
from phyblock.making.questions.relations import length_axis
from phyblock.sim.balance import surely_stands
from phyblock.sim.contact import (
    bounds_m,
    boxes_near,
    whole_bounds_m,
)

_STEP_DEG = 15
AXIS_TURNS: tuple[str, ...] = tuple(base.WORDS["turns_about_axes"])
"""Turns of a block that lies along the ground; the side does not matter."""
_OFFERED: Mapping[str, Sequence[str]] = {
    "rr-angle": ("0 degrees", "30 degrees", "60 degrees", "90 degrees"),
    "rr-turn": (
        *("0 degrees", "90 degrees counterclockwise", "90 degrees clockwise", "180 degrees"),
    ),
    "rr-axis": AXIS_TURNS,
}
_OWN = {"rr-angle": (0, 180), "rr-turn": (0,)}
"""Turns about the vertical that map the blocks to themselves of which a question is asked."""
_KINDS = {"rr-angle": "vertical", "rr-turn": "vertical", "rr-axis": "axis"}
_SAME, _FREE_M, _STEP_M = 1e-4, 0.02, 0.01
_BLOCKS, _PLACES = 6, 3


def _about(axis: int, angle_deg: float) -> Floats:
    """Return the rotation matrix (3, 3) about an axis of the world."""
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
    images = _images(other.euler_deg, length_axis(other))
    fitting = (name for name, deg in images if _is_alike(block.type, block.euler_deg, deg))
    return tuple(dict.fromkeys(fitting))


def tipped_over(block: Block) -> tuple[Block, ...]:
    """Return the block after each of `AXIS_TURNS`, to either side; UnfairError as `axis_turns`."""
    angles = dict.fromkeys(angle for _, angle in _images(block.euler_deg, length_axis(block)))
    return tuple(replace(block, euler_deg=angle) for angle in angles)


def _turned(stem: str, block: Block) -> tuple[Block, ...]:
    """Return the block in orientations that questions of a stem may be about."""
    if stem == "rr-axis":
        return tipped_over(block)
    turns = range(0, 360, _STEP_DEG)
    return tuple(replace(block, euler_deg=_yawed(block.euler_deg, turn)) for turn in turns)


@functools.lru_cache(maxsize=4096)
def _images(euler_deg: Euler, along: int) -> Sequence[tuple[str, Euler]]:
    """Return each turn, to either side, with the orientation that it gives."""
    rotation = euler_deg_to_matrix(euler_deg)
    images = [(AXIS_TURNS[0], euler_deg)]
    for name, axis in zip(AXIS_TURNS[1:], (2, along, 1 - along), strict=True):
        images += [(name, angles_deg(_about(axis, side) @ rotation)) for side in (90.0, -90.0)]
    return images


def vertical_turns_deg(block: Block, other: Block) -> tuple[int, ...]:
    """Return turns about the vertical, -165 to 180 degrees, that take `other` to how `block` lies.

    In steps of 15 degrees, the least first, counterclockwise seen from above when positive; none
    when the two are of different types, or one has to be tipped over as well.
    """
    if block.type != other.type:
        return ()
    turns = sorted(range(-180 + _STEP_DEG, 181, _STEP_DEG), key=lambda turn: (abs(turn), -turn))
    fits = functools.partial(_is_alike, block.type, block.euler_deg)
    return tuple(turn for turn in turns if fits(_yawed(other.euler_deg, turn)))


def _yawed(euler_deg: Euler, turn_deg: float) -> Euler:
    roll, pitch, yaw = euler_deg
    return roll, pitch, round((yaw + turn_deg) % 360, 6)


def phrases(stem: str, block: Block, other: Block) -> tuple[str, ...]:
    """Return what can be said truly of how a block is turned, the least turn first."""
    if stem == "rr-axis":
        return axis_turns(block, other)
    if vertical_turns_deg(block, block) != _OWN.get(stem):
        return ()
    sides = {turn: "" if turn in (0, 180) else " clockwise" for turn in range(-180, 181)}
    sides.update(dict.fromkeys(range(1, 180), " counterclockwise"))
    turns = vertical_turns_deg(block, other)
    return tuple(f"{abs(t)} degrees{sides[t] if stem == 'rr-turn' else ''}" for t in turns)


class RotationMaker(StaticMaker):
    """RR: a block of the structure, and a loose one of its type beside it that lies otherwise."""

    subtask: Subtask = "RR"

    def ask(self, scene: Scene, view: View, rng: np.random.Generator) -> Iterator[Asked]:
        """Ask about blocks, with another put beside the structure so that a phrase comes out."""
        studied = sight.seen_blocks(sight.goal_picture(scene, view), sight.STUDIED)
        for other, stem in itertools.product(base.shuffled(rng, studied)[:_BLOCKS], _OFFERED):
            try:
                turned = _turned(stem, other)
                said = {one: set(phrases(stem, one, other)) & set(_OFFERED[stem]) for one in turned}
            except UnfairError:
                continue
            phrase = pick(rng, _OFFERED[stem])
            fitting = [one for one, words in said.items() if words == {phrase}]
            # Where some phrase cannot come out, others would be right too often.
            if set().union(*said.values()) != set(_OFFERED[stem]) or not fitting:
                continue
            for _ in range(_PLACES):
                loose = put_beside(pick(rng, fitting), scene.blocks, rng)
                if surely_stands((loose,)):
                    yield _asked(stem, scene, view, loose, other, rng)

    def right(self, asked: Asked) -> str:
        """Compare the orientations in the picture, up to the symmetry of the type."""
        pair = [resolve_one(asked.slots[name], asked.picture) for name in ("block", "other")]
        sight.require_seen(asked.picture, sight.STUDIED, pair)
        true = {phrase for phrase in phrases(asked.stem, *pair) if phrase in asked.options}
        if len(true) != 1:
            raise UnfairError("are not of one type, or not turned as the wording asks")
        return true.pop()


def _asked(
    stem: str, scene: Scene, view: View, loose: Block, other: Block, rng: np.random.Generator
) -> Asked:
    """Ask about a loose block and another, each in a color of its own."""
    every = replace(scene, blocks=(*scene.blocks, loose))
    shown = sight.with_own_colors(every, [loose.order, other.order], rng)
    color = {block.order: block.color for block in shown.blocks}
    names = {one: f"{color[one.order]} {shape_word(one.type)}" for one in (loose, other)}
    slots = {"block": names[loose], "other": names[other]}
    colored, picture = replace(scene, blocks=shown.blocks[:-1]), sight.goal_picture(shown, view)
    return Asked(stem, colored, picture, slots, _OFFERED[stem], _KINDS[stem])


def put_beside(block: Block, blocks: Sequence[Block], rng: np.random.Generator) -> Block:
    """Put the block, as it is oriented, on the ground in a direction drawn from the blocks' middle.

    It gets an order that none of them has, and stands as near to them as leaves 2 cm free.
    """
    middle = whole_bounds_m(blocks).mean(axis=0)
    angle = float(rng.uniform(0, 2 * math.pi))
    direction = np.array([math.cos(angle), math.sin(angle)])
    loose = replace(block, order=max(b.order for b in blocks) + 1, depend=(), layer=1)
    box = bounds_m(loose)
    for steps in itertools.count():
        place_m = middle[:2] + _STEP_M * steps * direction
        step = np.array([*(place_m - box.mean(axis=0)[:2]), -box[0, 2]])
        x, y, z = (round(float(part), 4) for part in np.array(loose.position_m) + step)
        placed = replace(loose, position_m=(x, y, z))
        if not any(boxes_near(bounds_m(placed), bounds_m(other), _FREE_M) for other in blocks):
            return placed
    raise AssertionError
