"""States at rest that could be thought to follow when a block is taken away, and do not."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.scene import Block
from phyblock.sim.outcomes import OUTCOME_SETTINGS, Outcome, Push, after
from phyblock.sim.steps import groups
from phyblock.sim.support import bounds_m, boxes_near, find_gaps, find_overlaps, support_graph
from phyblock_making.poses import POSES
from phyblock_making.questions.choices import pick, shuffled

__all__ = ["states_at_rest"]

_PUSHES = 2
_FALLS = 12
_SIDES = ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
_PUSHED_M = (0.031, 0.044, 0.069)
_REACH_M = 0.1
_PLACES_TRIED = 12
_BESIDE_M = (0.03, 0.11)
"""How far from what stands a fallen block lies [m]."""


def states_at_rest(
    blocks: Sequence[Block], order: int, outcome: Outcome, rng: np.random.Generator
) -> Iterator[tuple[Block, ...]]:
    """What could be thought to follow a removal: blocks fall that stay, or stay that fall.

    Every state is at rest and nothing hangs free: blocks lie on the floor beside what stands, with
    all that rested on them, or went where a push to one of them takes them. No answer hangs on
    them, so one setting will do.
    """
    left = tuple(block for block in blocks if block.order != order)
    if outcome.moved and not find_gaps(left):
        yield left
    near = next(g for g in groups(blocks, _REACH_M) if any(b.order == order for b in g))
    about = frozenset(block.order for block in near) - {order}
    starts = (left, outcome.settled)
    graphs = [support_graph([b for b in start if b.order in about]) for start in starts]
    for number in range(_FALLS):
        which = int(number % 3 == 0)
        yield from _fallen(starts[which], graphs[which], rng)
    for number in range(_PUSHES):
        yield from _pushed(starts[number % 2], about, rng)


def _fallen(
    start: Sequence[Block], below: Mapping[int, frozenset[int]], rng: np.random.Generator
) -> Iterator[tuple[Block, ...]]:
    """A block, and all that rests on it, lying on the floor; `below` says who rests on whom."""
    falling = {pick(rng, sorted(below))}
    for _ in below:
        falling |= {order for order, under in below.items() if under & falling}
    standing = [block for block in start if block.order not in falling]
    for block in shuffled(rng, [b for b in start if b.order in falling]) if standing else ():
        lying = _beside(block, standing, rng)
        if lying is None:
            return
        standing.append(lying)
    if standing:
        yield tuple(sorted(standing, key=lambda block: block.order))


def _beside(block: Block, standing: Sequence[Block], rng: np.random.Generator) -> Block | None:
    """The block on the floor, in some pose, not far from where it was; None where all is taken."""
    poses = list(POSES[block.type].values())
    for _ in range(_PLACES_TRIED):
        roll, pitch, _ = pick(rng, poses)
        angle = float(rng.uniform(0, 2 * math.pi))
        far_m = float(rng.uniform(*_BESIDE_M)) + block.position_m[2] / 3
        x, y = block.position_m[0], block.position_m[1]
        x, y = round(x + far_m * math.cos(angle), 4), round(y + far_m * math.sin(angle), 4)
        turned = (roll, pitch, round(float(rng.uniform(0, 360)), 2))
        low_m = bounds_m(replace(block, position_m=(x, y, 0.0), euler_deg=turned))[0, 2]
        lying = replace(block, position_m=(x, y, round(-float(low_m), 4)), euler_deg=turned)
        box = bounds_m(lying)
        close = [b for b in standing if boxes_near(box, bounds_m(b), 0.0)]
        if not any(find_overlaps([lying, other]) for other in close):
            return lying
    return None


def _pushed(
    start: Sequence[Block], about: frozenset[int], rng: np.random.Generator
) -> Iterator[tuple[Block, ...]]:
    """What a push to one of the blocks near by leads to; the rest of the scene is left alone."""
    push = Push(pick(rng, sorted(about)), pick(rng, _SIDES), pick(rng, _PUSHED_M))
    outcome = after([b for b in start if b.order in about], push, OUTCOME_SETTINGS[:1])
    if outcome.is_clear and outcome.moved:
        settled = {block.order: block for block in outcome.settled}
        yield tuple(settled.get(block.order, block) for block in start)
