"""Matching the steps of a plan with poses to goal blocks, and moving the whole plan to fit best.

Each step is matched to an unplaced, ready block that equals its candidate, for as many steps as
place a block in setting A. Among such matchings, the one whose steps meet the most tolerances in
total is used, and among equals the one with the smallest distances.

For the motion, every pair of steps laid on a pair of equal goal blocks is a hypothesis; the best
are refined by weighted least squares over the blocks that they match. The result does not depend on
the position and direction of the plan.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.scene import Plan
from phyblock.scoring.plan import Floats, Goal, most_placed, steps_back
from phyblock.text import plain_sum


def cheapest(cost: Floats) -> list[tuple[int, int]]:
    """Pairs of row and column with the least total cost, one for each row or column of the shorter
    side, by row.

    Shortest augmenting paths with potentials (Jonker and Volgenant, *A shortest augmenting path
    algorithm*, Computing 38, 1987). Among equal totals it takes the same one on every machine.
    """
    rows, columns = cost.shape
    if rows > columns:
        return sorted((row, column) for column, row in cheapest(cost.T))
    # Column 0 stands for none, so that all others are numbered from 1.
    owner = np.zeros(columns + 1, dtype=np.intp)
    of_row, of_column = np.zeros(rows + 1), np.zeros(columns + 1)
    for row in range(1, rows + 1):
        owner[0] = row
        least = np.full(columns + 1, np.inf)
        before = np.zeros(columns + 1, dtype=np.intp)
        is_used = np.zeros(columns + 1, dtype=bool)
        at = 0
        while owner[at]:
            is_used[at] = True
            reduced = cost[owner[at] - 1] - of_row[owner[at]] - of_column[1:]
            is_nearer = ~is_used[1:] & (reduced < least[1:])
            least[1:][is_nearer] = reduced[is_nearer]
            before[1:][is_nearer] = at
            after = int(np.where(is_used, np.inf, least)[1:].argmin()) + 1
            step = least[after]
            of_row[owner[is_used]] += step
            of_column[is_used] -= step
            least[~is_used] -= step
            at = after
        while at:
            owner[at] = owner[before[at]]
            at = int(before[at])
    return sorted((int(row) - 1, column) for column, row in enumerate(owner[1:]) if row)


TOLERANCES_CM = (0.5, 1.0, 2.0, 4.0)
"""The distances within which a step is right [cm]; the headline is the mean over them."""
TURN_TOLERANCE_DEG = 15.0
"""The angle within which a step is right, up to the symmetry of the block [degrees]."""
FARTHEST_CM = 20.0
"""Cap of the distance in costs, so that one step far away does not affect the others [cm]."""
_SLACK = 1e-6
_DISTANCE_COST = 1e-3
_IMPOSSIBLE = 1e3
_MOST_SETS = 4000
"""Sets of placed blocks that are kept after a step, the cheapest ones; plans in a valid order need
no search at all.
"""


@dataclass(frozen=True)
class Nearness:
    """Steps against goal blocks, arrays of shape (steps, blocks): distance [cm], turn [degrees].

    `equal` is true where the step's candidate equals the block.
    """

    distance_cm: Floats
    turn_deg: Floats
    equal: NDArray[np.bool_]

    @property
    def within(self) -> NDArray[np.int64]:
        """The number of tolerances each pair is within."""
        limits = np.array(TOLERANCES_CM) + _SLACK
        near = (self.distance_cm[..., None] <= limits).sum(axis=-1)
        turned = self.turn_deg <= TURN_TOLERANCE_DEG + _SLACK
        within: NDArray[np.int64] = np.where(turned & self.equal, near, 0)
        return within

    @property
    def cost(self) -> Floats:
        """Cost of each pair: the share of tolerances that it misses, plus a little for distance."""
        missed = 1 - self.within / len(TOLERANCES_CM)
        far = np.round(np.minimum(self.distance_cm / FARTHEST_CM, 1.0), 9)
        return np.where(self.equal, missed + _DISTANCE_COST * far, _IMPOSSIBLE)


def assigned(near: Nearness) -> list[int | None]:
    """The goal block of each step at the least total cost, in any order of placing."""
    vertices: list[int | None] = [None] * len(near.equal)
    for step, vertex in cheapest(near.cost):
        if near.equal[step, vertex]:
            vertices[step] = vertex
    return vertices


def matched(goal: Goal, numbers: Sequence[int], near: Nearness) -> tuple[int | None, ...]:
    """The goal block of each step. Raises KeyError for a number that no candidate has."""
    most = most_placed(goal, Plan(tuple(numbers)))
    vertices = assigned(near)
    placed = 0
    for vertex in vertices:
        if vertex is not None and goal.graph.is_ready(vertex, placed):
            placed |= 1 << vertex
    is_valid = placed.bit_count() == sum(vertex is not None for vertex in vertices)
    if is_valid and placed.bit_count() == most:
        return tuple(vertices)
    return tuple(_searched(goal, numbers, near.cost, most))


def _searched(goal: Goal, numbers: Sequence[int], cost: Floats, most: int) -> list[int | None]:
    """Search step by step over sets of placed blocks, each with the cheapest path to it.

    As many steps as cannot be matched at all may be skipped if a later one fits better.
    """
    spare = len(numbers) - most
    frontier: dict[int, float] = {0: 0.0}
    history: list[dict[int, int | None]] = []
    for step, number in enumerate(numbers):
        costs: dict[int, float] = {}
        taken: dict[int, int | None] = {}
        for placed, paid in frontier.items():
            if step - placed.bit_count() < spare and paid < costs.get(placed, np.inf):
                costs[placed], taken[placed] = paid, None
            for vertex in goal.choices(number, placed):
                reached, more = placed | 1 << vertex, paid + float(cost[step, vertex])
                if more < costs.get(reached, np.inf):
                    costs[reached], taken[reached] = more, vertex
        if len(costs) > _MOST_SETS:
            # A skipped step costs as much as one that misses every tolerance.
            ranked = sorted(costs, key=lambda mask: (costs[mask] - mask.bit_count(), mask))
            costs = {mask: costs[mask] for mask in ranked[:_MOST_SETS]}
        frontier = costs
        history.append(taken)
    best = min(frontier, key=lambda mask: (-mask.bit_count(), frontier[mask], mask))
    return steps_back(history, best)


_WIDEST_CM = TOLERANCES_CM[-1]
_APART_CM = 1.0
"""Least distance of two steps from which a direction is computed."""
_MOST_PAIRS = 6000
_MOST_TURNED = 240
_MOST_TRIED = 12
_ROUNDS = 5
_DIGITS = 6
_PLACE_DIGITS = 3


@dataclass(frozen=True)
class Motion:
    """A turn about the vertical through the origin, then a shift along the floor [cm]."""

    turn_rad: float = 0.0
    shift_cm: tuple[float, float] = (0.0, 0.0)

    def place(self) -> tuple[float, ...]:
        """Return numbers that identify a motion, equal for turns that differ by full circles."""
        parts = (math.cos(self.turn_rad), math.sin(self.turn_rad), *self.shift_cm)
        return tuple(round(part, _PLACE_DIGITS) + 0.0 for part in parts)


@dataclass(frozen=True, eq=False)
class Alignment:
    """The steps of a plan against a goal, and the motions of the whole plan between them.

    `steps_cm` and `goal_cm` (n, 3) are centers of mass [cm]; `turn_deg` (steps, blocks) the least
    turn of each step from each block [degrees], which no motion changes; `equal` is true where a
    step's candidate equals a block. Candidates keep the orientation in which they were shown.
    """

    steps_cm: Floats
    goal_cm: Floats
    turn_deg: Floats
    equal: NDArray[np.bool_]

    def moved(self, motion: Motion) -> tuple[Floats, Nearness]:
        """The centers of steps after `motion` [cm], and their nearness to the goal blocks."""
        centers = self.steps_cm
        if motion != Motion():
            cosine, sine = np.cos(motion.turn_rad), np.sin(motion.turn_rad)
            centers = centers @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0, 0, 1]])
            centers[:, :2] += motion.shift_cm
        apart = centers[:, None] - self.goal_cm[None]
        distance = np.sqrt((apart**2).sum(axis=-1))
        return centers, Nearness(distance, self.turn_deg, self.equal)

    def likely_motions(self) -> list[tuple[int, Motion]]:
        """Return motions, each with the number of tolerances its steps meet in any order.

        The highest numbers come first, then the smallest distances. A goal that looks the same
        after a turn has motions of equal rank, of which the order of steps may allow only one.
        """
        if not self.equal.any():
            return [(0, Motion())]
        ranked: dict[tuple[float, ...], Motion] = {}
        for turn, shift in zip(*self._likeliest(*self._hypotheses()), strict=True):
            motion = Motion(float(turn), (float(shift[0]), float(shift[1])))
            for _ in range(_ROUNDS):
                _, near = self.moved(motion)
                pairs = [(s, v) for s, v in enumerate(assigned(near)) if v is not None]
                within = sum(int(near.within[pair]) for pair in pairs)
                far = plain_sum(min(float(near.distance_cm[pair]), FARTHEST_CM) for pair in pairs)
                rank = (float(within), -round(far, _DIGITS), *motion.place())
                if rank in ranked:
                    break
                ranked[rank] = motion
                close = [pair for pair in pairs if near.within[pair]]
                if len(close) < 2:
                    break
                motion = self._fitted(close, near, motion)
        best = sorted(ranked.items(), key=lambda item: item[0], reverse=True)
        return [(int(rank[0]), motion) for rank, motion in best]

    def _fitted(self, pairs: list[tuple[int, int]], near: Nearness, before: Motion) -> Motion:
        """The motion of weighted least squares over pairs, in the plane of the floor (Kabsch).

        With these weights, its fixed points are the peaks of a smooth count of tolerances, with a
        bell curve for each: distant pairs give way to those that can come within one more.
        """
        one = self.steps_cm[[s for s, _ in pairs], :2]
        other = self.goal_cm[[v for _, v in pairs], :2]
        distance = np.array([near.distance_cm[pair] for pair in pairs])
        limits = np.array(TOLERANCES_CM)
        weight = (np.exp(-((distance[:, None] / limits) ** 2)) / limits**2).sum(axis=1)[:, None]
        weight /= weight.sum()
        middle, target = (weight * one).sum(axis=0), (weight * other).sum(axis=0)
        a, b = one - middle, other - target
        along = float((weight * a * b).sum())
        across = float((weight[:, 0] * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])).sum())
        is_one_place = float(np.abs(a).max()) < _APART_CM or float(np.abs(b).max()) < _APART_CM
        turn = before.turn_rad if is_one_place else math.atan2(across, along)
        cosine, sine = math.cos(turn), math.sin(turn)
        x, y = (float(part) for part in middle)
        return Motion(
            turn,
            (float(target[0]) - cosine * x + sine * y, float(target[1]) - sine * x - cosine * y),
        )

    def _hypotheses(self) -> tuple[Floats, Floats]:
        """Turns (h,) [rad] and shifts (h, 2) [cm] that lay steps on equal blocks."""
        p, q = self.steps_cm[:, :2], self.goal_cm[:, :2]
        step, vertex = np.nonzero(self.equal)
        # Pairs of pairs, each once.
        first, second = np.triu_indices(len(step), 1)
        apart = (step[first] != step[second]) & (vertex[first] != vertex[second])
        first, second = first[apart], second[apart]
        way, aim = p[step[second]] - p[step[first]], q[vertex[second]] - q[vertex[first]]
        length, wanted = np.hypot(*way.T), np.hypot(*aim.T)
        off = np.round(np.abs(length - wanted), _DIGITS)
        kept = np.flatnonzero(
            (length > _APART_CM) & (wanted > _APART_CM) & (off <= 2 * _WIDEST_CM + 10**-_DIGITS)
        )
        kept = kept[np.argsort(off[kept], kind="stable")][:_MOST_PAIRS]
        first, second, way, aim = first[kept], second[kept], way[kept], aim[kept]
        turn = np.arctan2(aim[:, 1], aim[:, 0]) - np.arctan2(way[:, 1], way[:, 0])
        middle = (p[step[first]] + p[step[second]]) / 2
        target = (q[vertex[first]] + q[vertex[second]]) / 2
        shift = target - _turned(middle, turn)
        if len(turn):
            return turn, shift
        # A single step determines no turn.
        return np.zeros(len(step)), q[vertex] - p[step]

    def _likeliest(self, turns_rad: Floats, shifts_cm: Floats) -> tuple[Floats, Floats]:
        """The hypotheses under which the most steps have an equal block nearby."""
        limits = np.array(TOLERANCES_CM)

        def ranked(distance: Floats) -> NDArray[np.int64]:
            """Places of hypotheses, best first; ties do not depend on how they are numbered."""
            nearest = distance.min(axis=2)
            within = (nearest[..., None] <= limits + 10**-_DIGITS).sum(axis=(1, 2))
            far = np.round(np.minimum(nearest, FARTHEST_CM).sum(axis=1), _DIGITS)
            turned = (np.cos(turns_rad), np.sin(turns_rad), *shifts_cm.T)
            return np.lexsort((*np.round(turned, _PLACE_DIGITS), far, -within))

        p, q = self.steps_cm, self.goal_cm
        rise = (p[:, None, 2] - q[None, :, 2]) ** 2
        xy = _turned(p[:, :2], turns_rad[:, None]) + shifts_cm[:, None]
        apart = ((xy[:, :, None] - q[None, None, :, :2]) ** 2).sum(axis=-1) + rise
        distance = np.where(self.equal, np.sqrt(apart), np.inf)
        chosen = ranked(distance)[:_MOST_TURNED]
        turns_rad, shifts_cm, distance = turns_rad[chosen], shifts_cm[chosen], distance[chosen]
        chosen = ranked(distance)[:_MOST_TRIED]
        return turns_rad[chosen], shifts_cm[chosen]


def _turned(points: Floats, turns_rad: Floats) -> Floats:
    """The points (n, 2), turned by one angle each (n,), or all by several angles (h, 1)."""
    cosine, sine = np.cos(turns_rad), np.sin(turns_rad)
    x, y = points.T
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)
