"""Counts of steps, and the score of a plan by a scene's AOV graph: matchers, criteria, errors.

Settings A and B define which blocks are equal; the `paper` and `optimal` matchers define which goal
block a step places. Sets of goal vertices are bit masks throughout.
"""

from __future__ import annotations

import functools
import math
import operator
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.question import Subtask
from phyblock.domain.scene import CandidateSet, Plan, Scene
from phyblock.types import Level1Criterion, Matcher, Setting

Floats = NDArray[np.float64]
Metric = Callable[[Floats], Floats]
"""A function from summed counts (..., counts) to values (...), NaN where undefined."""


@dataclass(frozen=True)
class Counts:
    """True positives, false positives and false negatives, of one plan or summed over many.

    `fn` falls below zero under the `membership` criterion when a plan repeats a right step.
    """

    tp: int = 0
    fp: int = 0
    fn: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(self.tp + other.tp, self.fp + other.fp, self.fn + other.fn)

    @property
    def f1(self) -> float | None:
        """2 TP / (2 TP + FP + FN), or None if nothing was counted."""
        whole = 2 * self.tp + self.fp + self.fn
        return 2 * self.tp / whole if whole else None


def ratio_of(sums: Floats) -> Floats:
    """Part / whole of counts (..., [part, whole]), such as right answers / answers.

    NaN where the whole is 0, or less than the part: `membership` counts repeated steps again.
    """
    part, whole = sums[..., 0], sums[..., 1]
    out = np.full(part.shape, np.nan)
    np.divide(part, whole, out=out, where=(whole > 0) & (part <= whole))
    return out


def mean_of(sums: Floats) -> Floats:
    """Sum / number of counts (..., [sum, number]), in the unit of the sum; NaN for none."""
    total, number = sums[..., 0], sums[..., 1]
    out = np.full(total.shape, np.nan)
    np.divide(total, number, out=out, where=number > 0)
    return out


def chance(subtask: Subtask, n_options: int = 4) -> float:
    """Expected accuracy of a uniform guess: 1 / n, or 1 / n! for an order of n pictures."""
    return 1 / (math.factorial(n_options) if subtask == "OR" else n_options)


ErrorType = Literal["shape_not_in_gt", "overflow", "incorrect_orientation", "dependency_not_met"]
ERROR_TYPES: tuple[ErrorType, ...] = get_args(ErrorType)
"""The four types of wrong steps (paper appendix B.3), exhaustive and exclusive: the first that
holds. No goal block has this type and color; every such block is placed; an unplaced one exists,
but none that equals the candidate (setting A only); an unplaced equal one is not ready."""

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
"""Outcomes of a goal block. `left_out`: the plan has no step left for it. `wrong_kind`: it has one,
which names a kind that is not needed, or not so often. `wrong_orientation`: its kind is named, but
in another pose (setting A only). `order`: another order of the plan's steps would place it. Else it
is named as it is, but no order of the steps makes it ready, because blocks that it rests on,
directly or not, are never named (`support_not_named`), named in another pose (`support_turned`), or
some the one and some the other (`support_both`)."""


class Goal:
    """A scene and its candidate set prepared for matching under one setting.

    `equal_to[i]` holds the goal vertices, in file order, that equal candidate i (1-based). The
    others are bit masks of vertices: `equal[i]` the same, `of_kind[i]` those of its type and color,
    `kinds` all blocks by type and color, `kind_of_look` the kind of each group of blocks that are
    equal under the setting. `ways[i]` holds, for each vertex of `equal_to[i]`, the vertex, its
    mask, and the mask of it and what it directly depends on.
    """

    def __init__(self, scene: Scene, candidates: CandidateSet, setting: Setting) -> None:
        attribute = "look" if setting == "A" else "kind"
        self.graph = graph = scene.graph
        looks: dict[Hashable, tuple[int, ...]] = {}
        kinds: dict[Hashable, tuple[int, ...]] = {}
        for vertex, block in enumerate(scene.blocks):
            for groups, value in ((looks, getattr(block, attribute)), (kinds, block.kind)):
                groups[value] = (*groups.get(value, ()), vertex)
        self.equal_to: dict[int, tuple[int, ...]] = {}
        self.equal: dict[int, int] = {}
        self.of_kind: dict[int, int] = {}
        self.ways: dict[int, list[tuple[int, int, int]]] = {}
        for index, candidate in enumerate(candidates.candidates, 1):
            equal_to = looks.get(getattr(candidate, attribute), ())
            self.equal_to[index], self.equal[index] = equal_to, _mask(equal_to)
            self.of_kind[index] = _mask(kinds.get(candidate.kind, ()))
            self.ways[index] = [(v, 1 << v, graph.needed_masks[v] | 1 << v) for v in equal_to]
        self.kinds = tuple(map(_mask, kinds.values()))
        self.kind_of_look = {
            _mask(vertices): _mask(kinds[scene.blocks[vertices[0]].kind])
            for vertices in looks.values()
        }

    def choices(self, index: int, placed: int) -> list[int]:
        """Ready goal vertices, in file order, that candidate `index` could be placed as."""
        free = ~placed
        return [v for v, itself, needed in self.ways[index] if needed & free == itself]

    def error(self, index: int, placed: int) -> ErrorType:
        """The type of a wrong step that names candidate `index` when `placed` are placed."""
        if not self.of_kind[index]:
            return "shape_not_in_gt"
        if not self.of_kind[index] & ~placed:
            return "overflow"
        if not self.equal[index] & ~placed:
            return "incorrect_orientation"
        return "dependency_not_met"


def _mask(vertices: Iterable[int]) -> int:
    return sum(1 << vertex for vertex in vertices)


class Match(NamedTuple):
    """The effect of each step of a plan.

    For each step, `vertices` has the goal vertex that it placed, or None, and `errors` its error
    type, or None for a true positive; `n_blocks` is the size of the goal.
    """

    vertices: tuple[int | None, ...]
    errors: tuple[ErrorType | None, ...]
    n_blocks: int

    @property
    def counts(self) -> Counts:
        """TP: steps that placed a block; FP: the other steps; FN: blocks that were not placed."""
        tp = sum(vertex is not None for vertex in self.vertices)
        return Counts(tp, len(self.vertices) - tp, self.n_blocks - tp)


def match_plan(goal: Goal, plan: Plan, matcher: Matcher) -> Match:
    """Match `plan` step by step. Raises KeyError for a step that names no candidate.

    `paper` is Algorithm 1 of the paper: each step takes the first ready equal block in file order.
    `optimal` chooses among interchangeable ready blocks so that the whole plan has the most true
    positives, so every valid order scores 1; then the fewest `overflow` steps, then the fewest
    `incorrect_orientation`, so that the file order of blocks changes no count.
    """
    vertices: list[int | None] = []
    if matcher == "optimal":
        vertices = _best_choices(goal, plan)
    errors: list[ErrorType | None] = []
    placed = 0
    for step, index in enumerate(plan.steps):
        if matcher == "paper":
            vertices.append(next(iter(goal.choices(index, placed)), None))
        vertex = vertices[step]
        errors.append(goal.error(index, placed) if vertex is None else None)
        placed |= 0 if vertex is None else 1 << vertex
    return Match(tuple(vertices), tuple(errors), len(goal.graph))


def _best_choices(goal: Goal, plan: Plan) -> list[int | None]:
    """Search the frontier of sets of placed vertices that some choice can reach.

    Skipping a step with a ready match never helps, and a set's size is its number of true
    positives, so the cheapest path to each distinct set is enough.
    """
    cost_of: dict[ErrorType, int] = {
        "shape_not_in_gt": 0,
        "overflow": len(plan) + 1,
        "incorrect_orientation": 1,
        "dependency_not_met": 0,
    }
    frontier = {0: 0}
    history: list[dict[int, int | None]] = []
    for index in plan.steps:
        costs: dict[int, int] = {}
        taken: dict[int, int | None] = {}
        for placed, cost in frontier.items():
            choices = goal.choices(index, placed)
            if len(choices) > 1:
                # Ready vertices that unlock the same blocks are interchangeable.
                choices = list({goal.graph.unlocks[v]: v for v in reversed(choices)}.values())
            if not choices:
                more = cost + cost_of[goal.error(index, placed)]
                if more < costs.get(placed, more + 1):
                    costs[placed], taken[placed] = more, None
            for vertex in choices:
                reached = placed | 1 << vertex
                if cost < costs.get(reached, cost + 1):
                    costs[reached], taken[reached] = cost, vertex
        frontier = costs
        history.append(taken)
    best = min(frontier, key=lambda mask: (-mask.bit_count(), frontier[mask]))
    return steps_back(history, best)


def steps_back(history: Sequence[Mapping[int, int | None]], reached: int) -> list[int | None]:
    """Return the vertex of each step on the search's path to the set `reached`, backtracking."""
    vertices: list[int | None] = []
    for taken in reversed(history):
        chosen = taken[reached]
        vertices.append(chosen)
        reached &= ~(1 << chosen) if chosen is not None else ~0
    return vertices[::-1]


def most_placed(goal: Goal, plan: Plan) -> int:
    """Return the true positives of `match_plan` with `optimal`, but faster; raises as it does."""
    frontier = {0}
    for ways in map(goal.ways.__getitem__, plan.steps):
        if len(ways) == 1:
            ((_, itself, needed),) = ways
            frontier = {p | itself if needed & ~p == itself else p for p in frontier}
        elif ways:
            reached: set[int] = set()
            for placed in frontier:
                free = ~placed
                ready = [(v, itself) for v, itself, needed in ways if needed & free == itself]
                if len(ready) > 1:
                    by_role = {goal.graph.unlocks[way[0]]: way for way in reversed(ready)}
                    ready = list(by_role.values())
                reached.update([placed | itself for _, itself in ready] or [placed])
            frontier = reached
    return max(mask.bit_count() for mask in frontier)


def level1_counts(goal: Goal, plan: Plan, criterion: Level1Criterion) -> Counts:
    """Counts of `plan` without order, under the goal's setting.

    `membership` is the paper's: a step counts when any goal block equals it, even if repeated.
    `selection` is one-to-one. Raises KeyError for a step that names no candidate.
    """
    if criterion == "membership":
        tp = sum(bool(goal.equal_to[index]) for index in plan.steps)
    else:
        chosen = Counter(goal.equal_to[index] for index in plan.steps)
        tp = sum(min(times, len(vertices)) for vertices, times in chosen.items())
    return Counts(tp, len(plan) - tp, len(goal.graph) - tp)


def block_outcomes(
    goal: Goal, plan: Plan, placed: Sequence[int]
) -> tuple[dict[BlockOutcome, int], ...]:
    """Number of goal blocks of each outcome, for each number of blocks in `placed`.

    Each matcher places a different number. Raises KeyError for a step that names no candidate.
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
        # If either one explains it, with several equal blocks to choose from, the pose counts.
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
    """The most correctly named blocks that can stand together, each on what it depends on.

    `exact` is how many blocks of a look (a bit mask of vertices) are named as they are, `spare` how
    many others of a kind may support them, uncounted; `at_least` is a known lower bound. If too few
    blocks of a kind are named, some are removed with all that rests on them, in every way that may
    be best. Only topmost ones are tried, since removing a lower one removes those above as well.
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
        # For each kind, the blocks of which too few are named, and how many must be removed.
        surplus: dict[int, int] = {}
        blocks: dict[int, int] = {}
        for look, kind in goal.kind_of_look.items():
            excess = (look & standing).bit_count() - exact.get(look, 0)
            if excess > 0:
                surplus[kind] = surplus.get(kind, -spare.get(kind, 0)) + excess
                blocks[kind] = blocks.get(kind, 0) | look & standing
        needed = [kind for kind in blocks if surplus[kind] > 0]
        if not needed:
            best = value
            return
        # A kind of which all must be removed comes first.
        whole = [kind for kind in needed if surplus[kind] == blocks[kind].bit_count()]
        some = blocks[whole[0] if whole else needed[-1]]
        above = [goal.graph.above[v] & standing for v in range(len(goal.graph)) if some >> v & 1]
        if whole:
            search(standing & ~functools.reduce(operator.or_, above))
            return
        for gone in sorted(above, key=int.bit_count):
            if (gone & some).bit_count() == 1:
                search(standing & ~gone)

    search((1 << len(goal.graph)) - 1)
    return best


def steps_kept(goal: Goal, plan: Plan, at_least: int = 0) -> int:
    """Return the most steps of a plan that occur, in its order, in one valid order of the goal.

    That order is the plan with other steps removed and other blocks inserted, and no valid order
    needs fewer edits. Steps may stand for any equal blocks, none after one that rests on it.
    `at_least` is a known lower bound. Raises KeyError for a step that names no candidate.
    """
    steps = [goal.equal[index] for index in plan.steps]
    # For each place in the plan, the number of steps from there on that equal each set of blocks,
    # capped at the number of such blocks.
    ahead: list[dict[int, int]] = [{}]
    for equal in reversed(steps):
        known = ahead[-1].get(equal, 0)
        is_more = known < equal.bit_count()
        ahead.append({**ahead[-1], equal: known + 1} if is_more else ahead[-1])
    ahead.reverse()

    def bound(at: int, kept: int, closed: int) -> int:
        """Upper bound of the number of steps that can be kept in all."""
        most = kept.bit_count()
        for equal, times in ahead[at].items():
            most += min(times, (equal & ~closed).bit_count())
        return most

    # Best first: the path with the highest bound is continued, so the first to reach the end is
    # optimal. A kept block and those that it rests on are closed.
    open_ways = [(-bound(0, 0, 0), 0, 0, 0)]
    seen = {(0, 0)}
    while True:
        least, before, kept, closed = heappop(open_ways)
        at, most = -before, -least
        if at == len(steps) or most == kept.bit_count() or most <= at_least:
            return max(most, at_least)
        ways = [(kept, closed)]  # The step is dropped, or is one of its equal blocks.
        roles = set()
        free = steps[at] & ~closed
        while free:
            bit = free & -free
            free ^= bit
            vertex = bit.bit_length() - 1
            role = (goal.graph.above[vertex] ^ bit, goal.graph.below[vertex] ^ bit)
            if role not in roles:
                roles.add(role)
                ways.append((kept | bit, closed | goal.graph.below[vertex]))
        for now, closed_now in ways:
            if (at + 1, now) not in seen:
                seen.add((at + 1, now))
                heappush(open_ways, (-bound(at + 1, now, closed_now), -at - 1, now, closed_now))


_PLANS_KEPT = 16
_ONLY_AOV = dict.fromkeys(("matcher", "errors", "placed", "why", "blocks", "kept"))
"""Fields of scores that Level-1 criteria do not have."""


class AssemblyScorer:
    """Scores plans for one scene; build once, use for every model and seed."""

    def __init__(self, scene: Scene, candidates: CandidateSet, settings: Sequence[Setting]) -> None:
        self._scene = scene
        self._goals = {setting: Goal(scene, candidates, setting) for setting in settings}
        # Models and seeds often give the same plan.
        self._known = functools.lru_cache(_PLANS_KEPT)(self._score)

    def score(
        self, plan: Plan, matchers: Sequence[Matcher], level1: Level1Criterion | None
    ) -> list[dict[str, Any]]:
        """Return the fields of a record's scores, by setting, then matcher.

        Raises KeyError for an unknown candidate.
        """
        return self._known(plan, tuple(matchers), level1)

    def _score(
        self, plan: Plan, matchers: tuple[Matcher, ...], level1: Level1Criterion | None
    ) -> list[dict[str, Any]]:
        scores: list[dict[str, Any]] = []
        for setting, goal in self._goals.items():
            matches = [match_plan(goal, plan, matcher) for matcher in matchers]
            placed = [match.counts.tp for match in matches]
            kept = steps_kept(goal, plan, max(placed))
            outcomes = block_outcomes(goal, plan, placed)
            for matcher, match, blocks in zip(matchers, matches, outcomes, strict=True):
                way = {"criterion": "aov", "setting": setting, "matcher": matcher}
                errors = {name: match.errors.count(name) for name in ERROR_TYPES}
                steps = {"errors": errors, "placed": match.vertices, "why": match.errors}
                found = {**vars(match.counts), **steps, "blocks": blocks, "kept": kept}
                scores.append({**way, **found})
            if level1 is not None and 1 in self._scene.levels:
                counts = vars(level1_counts(goal, plan, level1))
                scores.append({"criterion": level1, "setting": setting, **counts, **_ONLY_AOV})
        return scores
