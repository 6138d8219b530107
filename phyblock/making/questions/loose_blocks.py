"""A loose block on the ground beside a structure, for questions that the structure alone lacks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.scene import Block
from phyblock.sim.support import bounds_m, boxes_near, whole_bounds_m

__all__ = ["put_beside"]

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
    distance = 0.0
    while True:
        placed = _at(loose, middle[:2] + distance * direction)
        near = (boxes_near(bounds_m(placed), bounds_m(other), _CLEAR_M) for other in blocks)
        if not any(near):
            return placed
        distance += _STEP_M


def _at(block: Block, place_m: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Block:
    """The block with the middle of its box over a place (2,) [m] of the ground, on the ground."""
    box = bounds_m(block)
    step = np.array([*(place_m - box.mean(axis=0)[:2]), -box[0, 2]])
    x, y, z = (round(float(part), 4) for part in np.array(block.position_m) + step)
    return replace(block, position_m=(x, y, z))
