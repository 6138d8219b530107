"""What became of every goal block under a plan: placed, or lost, and to what.

Each block has one outcome. The numbers are differences along a chain of ever kinder readings of
the plan, so they sum to the goal's blocks, none is negative, and no choice among equal blocks
enters them: as many blocks as the plan has steps; as it names in the right kind; in the right
pose, too; as could be placed in the best order of its steps; as were placed.
"""

from __future__ import annotations

import functools
import operator
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Literal, get_args

from phyblock.domain import Plan
from phyblock.scoring.goal import Goal

__all__ = ["BLOCK_OUTCOMES", "BlockOutcome", "block_outcomes"]

BlockOutcome = Literal[
    "placed",
    "left_out",
    "wrong_kind",
    "wrong_orientation",
    "support_not_named",
    "support_turned",
    "support_both",
    "order",
]
BLOCK_OUTCOMES: tuple[BlockOutcome, ...] = get_args(BlockOutcome)
"""`left_out`: the plan has no step left for it. `wrong_kind`: it has, and the step names a kind
that is not needed, or not so often. `wrong_orientation`: its kind is named, in another pose
(setting A only). Named as it is, but in no order of the plan's steps ready, as what it rests on,
directly or not, was never named (`support_not_named`), named in another pose (`support_turned`), or
partly the one and partly the other (`support_both`). `order`: another order would place it.
"""


def block_outcomes(
    goal: Goal, plan: Plan, placed: Sequence[int]
) -> tuple[dict[BlockOutcome, int], ...]:
    """Number of goal blocks of each outcome, for each number of blocks that the plan `placed`.

    That is what one matcher or another finds. Raises KeyError for a step that is no candidate.
    """
    n = len(goal.graph)
    kinds = Counter(mask for index in plan.steps if (mask := goal.of_kind[index]))
    looks = Counter(mask for index in plan.steps if (mask := goal.equal[index]))
    exact = {look: min(times, look.bit_count()) for look, times in looks.items()}
    of_kind = {kind: min(times, kind.bit_count()) for kind, times in kinds.items()}
    right_kind, right_pose = sum(of_kind.values()), sum(exact.values())
    stand = _most_standing(goal, exact, {}, max(placed))
    both = right_pose - stand
    by_turned = by_absent = 0
    if both:
        turned = {
            kind: named - sum(times for look, times in exact.items() if look & kind)
            for kind, named in of_kind.items()
        }
        absent = {kind: kind.bit_count() - of_kind.get(kind, 0) for kind in goal.kinds}
        by_turned = _most_standing(goal, exact, turned, stand) - stand
        by_absent = _most_standing(goal, exact, absent, stand) - stand
        # Where either alone would do, one of several equal blocks being meant, it is the pose.
        by_absent = min(by_absent, both - by_turned)
    shared: dict[BlockOutcome, int] = {
        "left_out": max(0, n - len(plan)),
        "wrong_kind": min(n, len(plan)) - right_kind,
        "wrong_orientation": right_kind - right_pose,
        "support_not_named": by_absent,
        "support_turned": by_turned,
        "support_both": both - by_turned - by_absent,
    }
    return tuple({"placed": tp, **shared, "order": stand - tp} for tp in placed)


def _most_standing(
    goal: Goal, exact: Mapping[int, int], spare: Mapping[int, int], at_least: int
) -> int:
    """The most blocks named as they are that can stand together, each on what it depends on.

    `exact` says how many blocks of a look (a bit mask of vertices) are named as they are, `spare`
    how many others of a kind may support them, uncounted; `at_least` so many are known to stand.
    Where there are too many blocks of a kind, some are taken away with all that rests on them, in
    every way that may be best: of the topmost, as what a lower one takes along includes those.
    """
    best = at_least
    seen: set[int] = set()

    def search(standing: int) -> None:
        nonlocal best
        if standing in seen:
            return
        seen.add(standing)
        value = sum(min((look & standing).bit_count(), n) for look, n in exact.items())
        if value <= best:
            return
        some, surplus = _too_many(goal, standing, exact, spare)
        if not some:
            best = value
            return
        above = [goal.above[v] & standing for v in range(len(goal.graph)) if some >> v & 1]
        if surplus == len(above):
            search(standing & ~functools.reduce(operator.or_, above))
            return
        for gone in sorted(above, key=int.bit_count):
            if (gone & some).bit_count() == 1:
                search(standing & ~gone)

    search((1 << len(goal.graph)) - 1)
    return best


def _too_many(
    goal: Goal, standing: int, exact: Mapping[int, int], spare: Mapping[int, int]
) -> tuple[int, int]:
    """Blocks of a kind of which too few are named for all to stand, and how many must go; 0, 0
    where all can stand. A kind of which all must go is told first.
    """
    surplus: dict[int, int] = {}
    blocks: dict[int, int] = {}
    for look, kind in goal.kind_of_look.items():
        excess = (look & standing).bit_count() - exact.get(look, 0)
        if excess > 0:
            surplus[kind] = surplus.get(kind, -spare.get(kind, 0)) + excess
            blocks[kind] = blocks.get(kind, 0) | look & standing
    needed = (0, 0)
    for kind, some in blocks.items():
        if surplus[kind] == some.bit_count():
            return some, surplus[kind]
        if surplus[kind] > 0:
            needed = some, surplus[kind]
    return needed
