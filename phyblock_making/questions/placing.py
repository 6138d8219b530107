"""A block lowered onto a structure: where it first touches, and whether it surely stays there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from phyblock.domain.scene import Block
from phyblock.sim.balance import is_balanced, surely_falls, surely_stands
from phyblock.sim.outcomes import holds
from phyblock.sim.support import bounds_m, drop_height_m
from phyblock_making.questions.margins import group_of

__all__ = ["lowered", "surely_stays", "verdict"]

_LIFT_M = 0.6


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
