"""A block lowered onto a structure: where it first touches, and whether it surely stays there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from phyblock.domain.scene import Block
from phyblock.making.questions.margins import group_of
from phyblock.sim.balance import is_balanced, surely_falls, surely_stands
from phyblock.sim.outcomes import holds
from phyblock.sim.support import bounds_m, drop_height_m

__all__ = ["lowered", "lowered_round", "stays_round", "surely_stays", "verdict"]

_LIFT_M = 0.6
_DIRECTIONS = 8


def lowered(block: Block, onto: Sequence[Block], x_m: float, y_m: float) -> Block:
    """The block let down, as it is turned, with the middle of its outline over a place (x, y) [m].

    It stops where it first touches one of the blocks, or the floor.
    """
    middle = bounds_m(block).mean(axis=0)
    x = round(block.position_m[0] + x_m - float(middle[0]), 6)
    y = round(block.position_m[1] + y_m - float(middle[1]), 6)
    lifted = replace(block, position_m=(x, y, block.position_m[2] + _LIFT_M))
    fall = drop_height_m(lifted, onto)
    return replace(lifted, position_m=(x, y, round(lifted.position_m[2] - fall, 6)))


def lowered_round(put: Block, onto: Sequence[Block], rings_m: Sequence[float]) -> Iterator[Block]:
    """The block let down anew all round where it is, in eight directions for each ring [m]."""
    x, y, _ = bounds_m(put).mean(axis=0).tolist()
    for radius_m in rings_m:
        for number in range(_DIRECTIONS):
            angle = 2 * math.pi * number / _DIRECTIONS
            at = (x + radius_m * math.cos(angle), y + radius_m * math.sin(angle))
            yield lowered(put, onto, *at)


def stays_round(put: Block, onto: Sequence[Block], rings_m: Sequence[float]) -> bool | None:
    """Whether, by statics, a block let down stays, and likewise all round; None where unsure."""
    stays = surely_stays((*onto, put), put.order)
    is_alike = stays is not None and all(
        is_balanced(group_of((*onto, moved), moved.order)) is stays
        for moved in lowered_round(put, onto, rings_m)
    )
    return stays if is_alike else None


def surely_stays(blocks: Sequence[Block], order: int) -> bool | None:
    """Whether, by statics, one of the blocks and all that touches it stay; None where unsure."""
    group = group_of(blocks, order)
    if is_balanced(group):
        return True if surely_stands(group) else None
    return False if surely_falls(group) else None


def verdict(blocks: Sequence[Block], order: int) -> bool | None:
    """Whether all stay, where statics leave no doubt and every setting of a simulation agrees."""
    stays = surely_stays(blocks, order)
    return stays if stays is not None and holds(blocks, order) is stays else None
