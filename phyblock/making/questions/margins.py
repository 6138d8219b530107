"""What a reader of the support graph alone would say, and whether statics leave no doubt."""

from __future__ import annotations

import functools
from collections.abc import Collection, Mapping, Sequence

from phyblock.domain.scene import Block
from phyblock.sim.balance import surely_falls, surely_stands
from phyblock.sim.outcomes import Outcome, after_removal
from phyblock.sim.steps import groups
from phyblock.sim.support import support_graph

__all__ = ["group_of", "is_sure", "resting_on", "sure_removal"]


def resting_on(blocks: Sequence[Block], order: int, *, only: bool = False) -> frozenset[int]:
    """Orders of the blocks that rest on one, directly or not; not its own.

    With `only` they rest on nothing but it and others that do. The naive rule says that these, or
    those, fall when it is taken away, and nothing else.
    """
    below = _below(tuple(blocks))
    found: frozenset[int] = frozenset({order})
    for _ in blocks:
        found |= {
            one for one, under in below.items() if under & found and (not only or under <= found)
        }
    return found - {order}


@functools.lru_cache(maxsize=64)
def _below(blocks: tuple[Block, ...]) -> Mapping[int, frozenset[int]]:
    """The support graph, which is asked again for every block of a structure."""
    return support_graph(blocks)


def group_of(blocks: Sequence[Block], order: int) -> tuple[Block, ...]:
    """The blocks in reach of one, itself among them."""
    return next(group for group in groups(blocks) if any(b.order == order for b in group))


def is_sure(left: Sequence[Block], moved: Collection[int]) -> bool:
    """Whether blocks just left to themselves surely do what a simulation says.

    Those that stay stand without those that go, and each lot of those that go cannot be borne
    by those that stay: with every weight 5 mm off to any side, other masses, and friction to spare.
    """
    still = [block for block in left if block.order not in moved]
    falling = groups([block for block in left if block.order in moved])
    return all(surely_stands(group) for group in groups(still)) and all(
        surely_falls([*still, *lot]) for lot in falling
    )


def sure_removal(blocks: Sequence[Block], order: int) -> Outcome | None:
    """What surely follows a removal; None where settings or statics leave a doubt."""
    group = group_of(blocks, order)
    if not surely_stands(group):
        return None
    outcome = after_removal(blocks, order)
    near = [block for block in group if block.order != order]
    is_near = set(outcome.moved) <= {block.order for block in near}
    return outcome if outcome.is_clear and is_near and is_sure(near, outcome.moved) else None
