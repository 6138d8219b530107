"""How much of two structures is in the same place: blocks as voxels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.scene import Block
from phyblock.sim.support import bounds_m, pieces_of

__all__ = ["VOXEL_M", "voxel_iou", "voxels"]

VOXEL_M = 0.005
_SHIFT_M = 0.000625
"""Faces of built structures lie on multiples of 1.25 mm, and no middle of a voxel near one."""
_SKIN_M = 0.0003
"""A middle so near to a block counts as in it: slopes run through some, and what rests has shifted
by a tenth of a millimeter.
"""
_SPAN = 1 << 20


def voxel_iou(one: Sequence[Block], other: Sequence[Block]) -> float:
    """Intersection over union of two structures; 1 for two without a block."""
    first, second = voxels(one), voxels(other)
    shared = len(np.intersect1d(first, second, assume_unique=True))
    whole = len(first) + len(second) - shared
    return shared / whole if whole else 1.0


def voxels(blocks: Sequence[Block]) -> NDArray[np.int64]:
    """Names of the voxels of `VOXEL_M` whose middle lies in a block, ascending."""
    found = [_of(block) for block in blocks]
    return np.unique(np.concatenate(found)) if found else np.zeros(0, dtype=np.int64)


def _of(block: Block) -> NDArray[np.int64]:
    low, high = ((bounds_m(block) - _SHIFT_M) / VOXEL_M).round(9)
    ranges = [np.arange(np.floor(a), np.ceil(b) + 1) for a, b in zip(low, high, strict=True)]
    places = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 3)
    points = places * VOXEL_M + _SHIFT_M
    inside = np.zeros(len(points), dtype=bool)
    for piece in pieces_of(block):
        heights, spans = points @ piece.face_normals.T, piece.vertices_m @ piece.face_normals.T
        low_side, high_side = spans.min(axis=0) - _SKIN_M, spans.max(axis=0) + _SKIN_M
        inside |= ((heights >= low_side) & (heights <= high_side)).all(axis=1)
    x, y, z = places[inside].astype(np.int64).T
    names: NDArray[np.int64] = (x * _SPAN + y) * _SPAN + z
    return names
