"""What a push does: as far as it says, or not told at all."""

from __future__ import annotations

import pytest

from phyblock.domain import Block
from phyblock.sim.outcomes import Push, after

HALF_M = 0.025


def cube(order: int, x_m: float, layer: int = 1) -> Block:
    position = (x_m, 0.0, HALF_M + 2 * HALF_M * (layer - 1))
    below = (order - 1,) if layer > 1 else ()
    return Block(order, "cube", "red", position, (0.0, 0.0, 0.0), below, layer)


@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, -1.0)])
def test_a_block_that_slides_goes_as_far_as_it_is_pushed(direction: tuple[float, float]) -> None:
    push = Push(1, direction)
    outcome = after([cube(1, 0.0)], push)
    assert outcome.is_clear
    assert outcome.moved == (1,)
    (settled,) = outcome.settled
    gone_m = sum(p * d for p, d in zip(settled.position_m, direction, strict=False))
    assert gone_m == pytest.approx(push.distance_m, abs=0.005)


def test_a_block_off_the_top_comes_down_where_all_settings_agree() -> None:
    outcome = after([cube(1, 0.0), cube(2, 0.0, layer=2)], Push(2, (1.0, 0.0)))
    if outcome.is_clear:
        (top,) = (block for block in outcome.settled if block.order == 2)
        assert top.position_m[2] < 2 * HALF_M + 0.02


def test_a_block_that_is_held_back_is_not_told() -> None:
    row = [cube(order, 2 * HALF_M * order) for order in range(1, 4)]
    wall = [cube(order, 2 * HALF_M * 4, layer=order - 3) for order in range(4, 12)]
    outcome = after([*row, *wall], Push(1, (1.0, 0.0)))
    assert not outcome.is_clear or len(outcome.moved) > 1
