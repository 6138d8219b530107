"""Equality of structures up to turning, mirroring and shifting them.

The mirror image of a block is again a block: every type has its own mirror plane, so that the image
of a pose is the mirrored frame times the block's own mirror, a proper rotation.
"""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import (
    SHAPES,
    BlockType,
    Euler,
    euler_deg_to_matrix,
    orientation_class,
)
from phyblock.domain.scene import Block

Matrix = NDArray[np.float64]
_MIRROR = np.diag([-1.0, 1.0, 1.0])
"""Every block type is its own mirror image across the plane x = 0 of its body frame."""
_STEP_M = 0.001
_PHASE = 0.37
"""Keeps multiples of a quarter of a millimeter, which designs use, off the borders of cells."""


@dataclass(frozen=True)
class Symmetry:
    """A mirroring across the plane x = 0, if `mirrored`, and then `turns` quarter turns about z."""

    turns: int = 0
    mirrored: bool = False

    @functools.cached_property
    def matrix(self) -> Matrix:
        """World map, shape (3, 3); its determinant is -1 when mirrored."""
        cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[self.turns % 4]
        turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]], dtype=np.float64)
        return turn @ _MIRROR if self.mirrored else turn


SYMMETRIES = tuple(Symmetry(turns, mirrored) for mirrored in (False, True) for turns in range(4))
"""The eight symmetries of a structure on a floor with a square grid."""


def canonical_form(blocks: Sequence[Block]) -> tuple[tuple[object, ...], ...]:
    """A name of the structure that does not change when it is turned, mirrored or shifted.

    The least, over the eight symmetries, of the sorted (type, color, pose class, place) of all
    blocks, with places in millimeters from the low corner of the block origins.
    """
    return min(_form(blocks, symmetry) for symmetry in SYMMETRIES)


def turned_form(blocks: Sequence[Block]) -> tuple[tuple[object, ...], ...]:
    """A name of the structure that changes when it is mirrored, but not when turned or shifted."""
    return min(_form(blocks, Symmetry(turns)) for turns in range(4))


def fingerprint(blocks: Sequence[Block]) -> bytes:
    """16 bytes that are equal for equal canonical forms, and in practice for no others."""
    return hashlib.sha256(repr(canonical_form(blocks)).encode()).digest()[:16]


def image_m(position_m: tuple[float, float, float], symmetry: Symmetry) -> Euler:
    """The image of a place [m]."""
    x, y, z = (symmetry.matrix @ np.array(position_m)).tolist()
    return (round(x, 6) + 0.0, round(y, 6) + 0.0, z)


@functools.cache
def image_deg(euler_deg: Euler, symmetry: Symmetry) -> Euler:
    """Angles [degrees] of the image of a pose."""
    body = _MIRROR if symmetry.mirrored else np.eye(3)
    return angles_deg(symmetry.matrix @ euler_deg_to_matrix(euler_deg) @ body)


@functools.cache
def pose_class(block_type: BlockType, euler_deg: Euler) -> tuple[float, ...]:
    """The orientation class; for an upright round block, whose facets hardly show, its axis."""
    rotation = euler_deg_to_matrix(euler_deg)
    if SHAPES[block_type].is_round and abs(rotation[2, 2]) > 1 - 1e-6:
        return (0.0, 0.0, 1.0)
    return orientation_class(block_type, euler_deg)


def angles_deg(rotation: Matrix) -> Euler:
    """Extrinsic x-y-z angles [degrees] of a rotation matrix: R = Rz Ry Rx."""
    sine = -float(rotation[2, 0])
    if abs(sine) > 1 - 1e-9:
        roll, yaw = math.atan2(-rotation[1, 2], rotation[1, 1]), 0.0
        pitch = math.copysign(math.pi / 2, sine)
    else:
        roll = math.atan2(rotation[2, 1], rotation[2, 2])
        pitch = math.asin(sine)
        yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    return (_neat(roll), _neat(pitch), _neat(yaw))


def _form(blocks: Sequence[Block], symmetry: Symmetry) -> tuple[tuple[object, ...], ...]:
    places = np.array([image_m(block.position_m, symmetry) for block in blocks])
    places[:, :2] -= places[:, :2].min(axis=0)
    steps = np.floor(places / _STEP_M + _PHASE).astype(int)
    return tuple(
        sorted(
            (
                block.type,
                block.color,
                pose_class(block.type, image_deg(block.euler_deg, symmetry)),
                *place,
            )
            for block, place in zip(blocks, steps.tolist(), strict=True)
        )
    )


def _neat(angle_rad: float) -> float:
    return round(math.degrees(angle_rad), 6) + 0.0
