"""Lengths, places and angles of blocks as they stand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import SHAPES, orientation_class
from phyblock.domain.scene import Block
from phyblock.generate.questions.seeing import center_m, picture_axes
from phyblock.sim.support import bounds_m

__all__ = [
    "height_m",
    "length_m",
    "offset_m",
    "top_m",
    "turned_about_vertical",
    "vertical_turns_deg",
    "volume_m3",
]

_STEP_DEG = 15
_SAME = 1e-4


def height_m(block: Block) -> float:
    """From a block's lowest to its highest point [m]."""
    low, high = bounds_m(block)[:, 2]
    return float(high - low)


def top_m(block: Block) -> float:
    """Height of a block's highest point above the ground [m]."""
    return float(bounds_m(block)[1, 2])


def length_m(block: Block) -> float:
    """Length of the longest side of the box that a block fits in, however it lies [m]."""
    shape = SHAPES[block.type]
    return max(high - low for low, high in zip(shape.low_m, shape.high_m, strict=True))


def volume_m3(block: Block) -> float:
    """Volume of the solid [m3]."""
    return SHAPES[block.type].volume_m3


def offset_m(block: Block, other: Block) -> NDArray[np.float64]:
    """From `other` to `block`: to the right of the picture, away from the viewer, up [m], (3,)."""
    right, away = picture_axes()
    step = center_m(block) - center_m(other)
    return np.array([step @ right, step @ away, step[2]])


def vertical_turns_deg(block: Block, other: Block) -> tuple[int, ...]:
    """Turns about the vertical, -165 to 180 degrees, that take `other` to how `block` is oriented.

    In steps of 15 degrees, the least first, counterclockwise seen from above when positive; none
    when the two are of different types, or one has to be tipped over as well. Up to the blocks'
    own symmetry: orientations count as equal when no one can tell them apart.
    """
    if block.type != other.type:
        return ()
    turns = sorted(range(-180 + _STEP_DEG, 181, _STEP_DEG), key=lambda turn: (abs(turn), -turn))
    return tuple(t for t in turns if _look_alike(block, turned_about_vertical(other, t)))


def turned_about_vertical(block: Block, angle_deg: float) -> Block:
    """The block turned about the vertical line through the middle of its bounding box."""
    about = center_m(block)
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    x, y, z = (about + turn @ (np.array(block.position_m) - about)).tolist()
    roll, pitch, yaw = block.euler_deg
    euler_deg = (roll, pitch, round((yaw + angle_deg) % 360, 6))
    return replace(block, position_m=(round(x, 6), round(y, 6), round(z, 6)), euler_deg=euler_deg)


def _look_alike(block: Block, other: Block) -> bool:
    """Whether the two are oriented alike up to the symmetry of the type."""
    one, two = (np.array(_class(each)) for each in (block, other))
    return bool(np.abs(one - two).max() < _SAME)


def _class(block: Block) -> tuple[float, ...]:
    return orientation_class(block.type, block.euler_deg)
