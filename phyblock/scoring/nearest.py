"""How near a plan is to a valid order of its goal: the fewest steps to leave out and put in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from heapq import heappop, heappush

from phyblock.domain import Plan
from phyblock.scoring.goal import Goal

__all__ = ["steps_kept"]


def steps_kept(goal: Goal, plan: Plan, at_least: int = 0) -> int:
    """The most steps of a plan that stand, in its order, in one valid order of the goal.

    Then that order is made of the plan by leaving out the other steps and putting in the other
    blocks, and no valid order with fewer such edits. Steps that stand for blocks of an order may
    do so as long as none comes after one that rests on it. `at_least` so many are known to.
    Raises KeyError for a step that is no candidate.
    """
    steps = [goal.equal[index] for index in plan.steps]
    ahead = _steps_ahead(steps)
    # The most steps that may still be kept, the most that were seen to first: the first way that
    # comes to the end is a best one. Blocks that a kept one rests on, and itself, are closed.
    open_ways = [(-_most(ahead[0], 0, 0), 0, 0, 0)]
    seen = {(0, 0)}
    while True:
        bound, before, kept, closed = heappop(open_ways)
        at, most = -before, -bound
        if at == len(steps) or most == kept.bit_count() or most <= at_least:
            return max(most, at_least)
        for now, closed_now in _next(goal, steps[at], kept, closed):
            if (at + 1, now) not in seen:
                seen.add((at + 1, now))
                most = _most(ahead[at + 1], now, closed_now)
                heappush(open_ways, (-most, -at - 1, now, closed_now))


def _next(goal: Goal, equal: int, kept: int, closed: int) -> Iterator[tuple[int, int]]:
    """What is kept and closed after a step, which stands for one of `equal` or is left out."""
    yield kept, closed
    alike = set()
    free = equal & ~closed
    while free:
        bit = free & -free
        free ^= bit
        vertex = bit.bit_length() - 1
        role = (goal.above[vertex] ^ bit, goal.below[vertex] ^ bit)
        if role not in alike:
            alike.add(role)
            yield kept | bit, closed | goal.below[vertex]


def _most(ahead: Mapping[int, int], kept: int, closed: int) -> int:
    """No fewer steps than can be kept in all, `ahead` being those to come by what they equal."""
    most = kept.bit_count()
    for equal, times in ahead.items():
        most += min(times, (equal & ~closed).bit_count())
    return most


def _steps_ahead(steps: list[int]) -> list[dict[int, int]]:
    """For each place in a plan how many steps from there on equal each set of blocks, at most as
    many as there are such blocks.
    """
    ahead: list[dict[int, int]] = [{}]
    for equal in reversed(steps):
        known = ahead[-1].get(equal, 0)
        is_more = known < equal.bit_count()
        ahead.append({**ahead[-1], equal: known + 1} if is_more else ahead[-1])
    return ahead[::-1]
