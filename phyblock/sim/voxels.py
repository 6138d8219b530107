"""How much of two structures is in the same place: blocks as voxels."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import BlockType, Euler
from phyblock.domain.scene import Block
from phyblock.sim.support import bounds_m, pieces_of

__all__ = ["VOXEL_M", "filled_voxels", "voxel_iou"]

VOXEL_M = 0.005
_SIDE = 4
"""Points along each side of a voxel: their middles alone would take a block that lies 1 mm lower
for one that lies where it was, or lower by a whole layer.
"""
_POINTS = _SIDE**3
_POINT_M = VOXEL_M / _SIDE
_SHIFT_M = _POINT_M / 2
"""Faces of built structures lie on multiples of 1.25 mm, and no point near one."""
_SKIN_M = 0.0003
"""A point so near to a block counts as in it: slopes run through some, and what rests has shifted
by a tenth of a millimeter.
"""
_SPAN = 1 << 20
_KEPT = 256

Voxels = tuple[NDArray[np.int64], NDArray[np.uint8]]
"""Names of voxels (n,), and the points of each that lie in a block, a bit for each (n, 8)."""


def voxel_iou(one: Sequence[Block], other: Sequence[Block]) -> float:
    """Intersection over union of two structures; 1 for two without a block."""
    first, second = filled_voxels(one), filled_voxels(other)
    sizes = (_count(first[1]), _count(second[1]))
    _, a, b = np.intersect1d(first[0], second[0], assume_unique=True, return_indices=True)
    shared = _count(first[1][a] & second[1][b])
    whole = sum(sizes) - shared
    return shared / whole if whole else 1.0


def filled_voxels(blocks: Sequence[Block]) -> Voxels:
    """The voxels of `VOXEL_M` that some block reaches into, names ascending, and the points of each
    that lie in a block, of 64 that are 1.25 mm apart, a bit for each.
    """
    found = [_of(block.type, block.position_m, block.euler_deg) for block in blocks]
    if not found:
        return np.zeros(0, dtype=np.int64), np.zeros((0, _POINTS // 8), dtype=np.uint8)
    names, places = np.unique(np.concatenate([name for name, _ in found]), return_inverse=True)
    points = np.zeros((len(names), _POINTS // 8), dtype=np.uint8)
    np.bitwise_or.at(points, places, np.concatenate([bits for _, bits in found]))
    return names, points


def _count(points: NDArray[np.uint8]) -> int:
    return int(np.unpackbits(points).sum())


@functools.lru_cache(maxsize=_KEPT)
def _of(block_type: BlockType, position_m: tuple[float, float, float], euler_deg: Euler) -> Voxels:
    block = Block(1, block_type, "red", position_m, euler_deg, (), 1)
    low, high = (bounds_m(block) / VOXEL_M).round(9)
    first = np.floor(low).astype(np.int64) - 1
    count = np.ceil(high).astype(np.int64) + 1 - first
    x, y, z = (
        (np.arange(n * _SIDE) + k * _SIDE) * _POINT_M + _SHIFT_M
        for k, n in zip(first.tolist(), count.tolist(), strict=True)
    )
    inside = np.zeros((len(x), len(y), len(z)), dtype=bool)
    for piece in pieces_of(block):
        within = np.ones_like(inside)
        spans = piece.vertices_m @ piece.face_normals.T
        lows, highs = spans.min(axis=0) - _SKIN_M, spans.max(axis=0) + _SKIN_M
        for (a, b, c), lowest, highest in zip(piece.face_normals, lows, highs, strict=True):
            heights = (a * x)[:, None, None] + (b * y)[:, None] + c * z
            within &= (heights >= lowest) & (heights <= highest)
        inside |= within
    parts = inside.reshape(count[0], _SIDE, count[1], _SIDE, count[2], _SIDE)
    bits = np.packbits(parts.transpose(0, 2, 4, 1, 3, 5).reshape(-1, _POINTS), axis=1)
    filled = np.flatnonzero(bits.any(axis=1))
    places = np.stack(np.unravel_index(filled, tuple(count)), axis=-1) + first
    names = (places[:, 0] * _SPAN + places[:, 1]) * _SPAN + places[:, 2]
    return names, bits[filled]
