"""Lengths, places and angles of blocks as they stand."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import SHAPES, BlockType, Euler, orientation_class
from phyblock.domain.scene import Block
from phyblock.making.questions.picture_view import View, center_m, picture_axes
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


def offset_m(block: Block, other: Block, view: View) -> NDArray[np.float64]:
    """From `other` to `block`: to the right of the picture, away from the viewer, up [m], (3,)."""
    right, away = picture_axes(view)
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
    return _turns_deg(block.type, block.euler_deg, other.euler_deg)


@functools.lru_cache(maxsize=4096)
def _turns_deg(block_type: BlockType, euler_deg: Euler, other_deg: Euler) -> tuple[int, ...]:
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
