"""What a push does: as far as it says, or not told at all."""

from __future__ import annotations

import pytest

from phyblock.domain import Block
from phyblock.sim.outcomes import OUTCOME_SETTINGS, Push, after

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


def test_a_block_takes_along_what_stands_on_it() -> None:
    outcome = after([cube(1, 0.0), cube(2, 0.0, layer=2)], Push(1, (1.0, 0.0)))
    assert outcome.is_clear
    assert outcome.moved == (1, 2)


def test_what_ends_otherwise_in_another_setting_is_not_told() -> None:
    """The top of a tower falls in each setting, and comes to lie elsewhere in some."""
    stack = [cube(order, 0.0, layer=order) for order in range(1, 5)]
    push = Push(4, (1.0, 0.0))
    alone = [after(stack, push, settings=[setting]) for setting in OUTCOME_SETTINGS]
    assert all(outcome.is_clear and outcome.moved == (4,) for outcome in alone)
    assert all(outcome.settled[3].position_m[2] < 2 * HALF_M for outcome in alone)
    assert not after(stack, push).is_clear


def test_a_block_that_is_held_back_is_not_told() -> None:
    """A wall in the way lets it go only a part of the distance; a heavier one, in any engine."""
    push, setting = Push(1, (1.0, 0.0)), OUTCOME_SETTINGS[3]
    row = [cube(order, 2 * HALF_M * order) for order in range(1, 4)]
    clear = []
    for height in (8, 12):
        wall = [cube(order, 2 * HALF_M * 4, layer=order - 3) for order in range(4, 4 + height)]
        assert after([*row, *wall], settings=[setting]).moved == ()
        outcome = after([*row, *wall], push, settings=[setting])
        clear.append(outcome.is_clear)
        if outcome.is_clear:
            gone_m = outcome.settled[0].position_m[0] - row[0].position_m[0]
            assert gone_m == pytest.approx(push.distance_m, abs=0.005)
    assert not clear[-1]
