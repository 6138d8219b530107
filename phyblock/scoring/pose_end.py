"""How many of a goal's blocks stand where they should, whoever put them there."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from phyblock.domain import Block, euler_deg_to_matrix, turn_deg
from phyblock.domain.blocks import SHAPES
from phyblock.scoring.assignment import cheapest

__all__ = ["blocks_reached"]

_CM = 100.0


def blocks_reached(
    goal: Sequence[Block], blocks: Sequence[Block], within_cm: float, within_deg: float
) -> int:
    """The most goal blocks that can each be given a block of its kind that lies near enough."""
    near = np.array(
        [[_is_near(one, other, within_cm, within_deg) for other in blocks] for one in goal]
    )
    if not near.size:
        return 0
    return sum(bool(near[pair]) for pair in cheapest((~near).astype(np.float64)))


def _is_near(one: Block, other: Block, within_cm: float, within_deg: float) -> bool:
    if one.kind != other.kind:
        return False
    rotations = [euler_deg_to_matrix(block.euler_deg) for block in (one, other)]
    middle = np.array(SHAPES[one.type].center_of_mass_m)
    places = [
        np.array(block.position_m) + rotation @ middle
        for block, rotation in zip((one, other), rotations, strict=True)
    ]
    if math.dist(*places) * _CM > within_cm:
        return False
    return turn_deg(one.type, *rotations) <= within_deg
