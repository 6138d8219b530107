"""Quarter turns about upright and level axes: which one takes one orientation to another."""

from __future__ import annotations

import functools
import math
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import (
    SHAPES,
    BlockType,
    Euler,
    euler_deg_to_matrix,
    orientation_class,
)
from phyblock.domain.scene import Block
from phyblock.domain.symmetry import angles_deg
from phyblock.making.questions.lengths import length_axis

__all__ = ["AXIS_TURNS", "axis_turns", "tipped_over"]

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
