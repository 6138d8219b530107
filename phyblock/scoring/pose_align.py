"""The shift over the floor and the turn about the vertical that bring a whole plan nearest to a
goal.

Every pair of steps laid upon a pair of equal goal blocks is a hypothesis, and where steps bring a
rotation, so is every step laid upon one; the best are drawn nearer by weighted least squares over
the blocks that they match. Nothing in it depends on where the plan was or how it was turned, so its
result does not either.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.scoring.pose_match import (
    FARTHEST_CM,
    TOLERANCES_CM,
    TURN_TOLERANCE_DEG,
    Nearness,
    assigned,
)
from phyblock.scoring.ratios import Floats
from phyblock.stable import plain_sum

__all__ = ["Motion", "Poses", "likely_motions", "nearness"]

_WIDEST_CM = TOLERANCES_CM[-1]
_APART_CM = 1.0
"""Two steps that are nearer to one another give no direction."""
_MOST_PAIRS = 6000
_MOST_TURNED = 240
_MOST_TRIED = 12
_ROUNDS = 5
_DIGITS = 6
_TRACE_SLACK = 1e-4


@dataclass(frozen=True, eq=False)
class Poses:
    """Steps or goal blocks: centers of mass (n, 3) [cm] and rotations (n, 3, 3)."""

    centers_cm: Floats
    rotations: Floats

    def moved(self, motion: Motion, *, turns: bool) -> Poses:
        """All of them turned and then shifted together; with `turns` each turns along."""
        matrix = _about_z(np.array([motion.turn_rad]))[0]
        centers = self.centers_cm @ matrix.T
        centers[:, :2] += motion.shift_cm
        return Poses(centers, matrix @ self.rotations if turns else self.rotations)


@dataclass(frozen=True)
class Motion:
    """A turn about the vertical through the origin, then a shift over the floor [cm]."""

    turn_rad: float = 0.0
    shift_cm: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class _Hypotheses:
    turns_rad: Floats
    shifts_cm: Floats

    def some(self, chosen: NDArray[np.int64]) -> _Hypotheses:
        return _Hypotheses(self.turns_rad[chosen], self.shifts_cm[chosen])


def nearness(
    steps: Poses, goal: Poses, equal: NDArray[np.bool_], alike: tuple[Floats, ...]
) -> Nearness:
    """How steps lie to goal blocks; `alike` are the symmetries (k, 3, 3) of each step's block."""
    apart = steps.centers_cm[:, None] - goal.centers_cm[None]
    distance = np.sqrt((apart**2).sum(axis=-1))
    turn = np.zeros(equal.shape)
    for step, rotations in enumerate(alike):
        same = steps.rotations[step] @ rotations
        traces = np.einsum("kij,gij->gk", same, goal.rotations)
        turn[step] = _angle_deg(traces.max(axis=1))
    return Nearness(distance, turn, equal)


def likely_motions(
    steps: Poses,
    goal: Poses,
    equal: NDArray[np.bool_],
    alike: tuple[Floats, ...],
    *,
    turns: bool,
) -> list[tuple[int, Motion]]:
    """Motions of all steps, each with how many tolerances its steps are within in whatever order
    they are placed; those with most first, then those that bring steps nearest.

    With `turns` the rotation of each step turns along; without, candidates keep the orientation
    in which they were shown.
    """
    if not equal.any():
        return [(0, Motion())]
    found = _hypotheses(steps, goal, equal, alike, turns=turns)
    found = _likeliest(found, steps, goal, equal, alike, turns=turns)
    ranked: dict[tuple[float, float], Motion] = {}
    for turn, shift in zip(found.turns_rad, found.shifts_cm, strict=True):
        motion = Motion(float(turn), (float(shift[0]), float(shift[1])))
        for _ in range(_ROUNDS):
            near = nearness(steps.moved(motion, turns=turns), goal, equal, alike)
            pairs = [(s, v) for s, v in enumerate(assigned(near)) if v is not None]
            rank = _rank(near, pairs)
            if rank in ranked:
                break
            ranked[rank] = motion
            close = [pair for pair in pairs if near.within[pair]]
            if len(close) < 2:
                break
            motion = _fitted(steps.centers_cm, goal.centers_cm, close, near, motion)
    best = sorted(ranked.items(), key=lambda item: item[0], reverse=True)
    return [(int(within), motion) for (within, _), motion in best]


def _rank(near: Nearness, pairs: list[tuple[int, int]]) -> tuple[float, float]:
    within = sum(int(near.within[pair]) for pair in pairs)
    far = plain_sum(min(float(near.distance_cm[pair]), FARTHEST_CM) for pair in pairs)
    return float(within), -round(far, _DIGITS)


def _fitted(
    steps_cm: Floats,
    goal_cm: Floats,
    pairs: list[tuple[int, int]],
    near: Nearness,
    before: Motion,
) -> Motion:
    """The motion of weighted least squares over pairs, in the plane of the floor (Kabsch).

    Weights are those under which its fixed points are the peaks of a smooth count of tolerances, a
    bell for each: pairs that are far off give way to those that can be brought within one more.
    """
    one = steps_cm[[s for s, _ in pairs], :2]
    other = goal_cm[[v for _, v in pairs], :2]
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
    return _laid(turn, middle, target)


def _laid(turn_rad: float, point_cm: Floats, target_cm: Floats) -> Motion:
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    x, y = (float(part) for part in point_cm)
    return Motion(
        turn_rad,
        (
            float(target_cm[0]) - cosine * x + sine * y,
            float(target_cm[1]) - sine * x - cosine * y,
        ),
    )


def _hypotheses(
    steps: Poses,
    goal: Poses,
    equal: NDArray[np.bool_],
    alike: tuple[Floats, ...],
    *,
    turns: bool,
) -> _Hypotheses:
    p, q = steps.centers_cm[:, :2], goal.centers_cm[:, :2]
    step, vertex = np.nonzero(equal)
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
    by_pairs = _Hypotheses(turn, target - _turned(middle, turn))
    if len(turn) and not turns:
        # One step alone tells no turn.
        return by_pairs
    alone, rad = _single_turns(steps, goal, step, vertex, alike, turns=turns)
    shifts = q[vertex[alone]] - _turned(p[step[alone]], rad)
    return _Hypotheses(np.concatenate([turn, rad]), np.concatenate([by_pairs.shifts_cm, shifts]))


def _single_turns(
    steps: Poses,
    goal: Poses,
    step: NDArray[np.int64],
    vertex: NDArray[np.int64],
    alike: tuple[Floats, ...],
    *,
    turns: bool,
) -> tuple[NDArray[np.int64], Floats]:
    """The turns that bring the rotation of a step nearest to that of a goal block, each with the
    place of its pair; as many of a pair as the symmetry of its block lets be best.
    """
    if not turns:
        return np.arange(len(step)), np.zeros(len(step))
    places, found = [], []
    for place, (s, v) in enumerate(zip(step, vertex, strict=True)):
        cosine, sine, rest = _trace_parts(steps.rotations[s] @ alike[s], goal.rotations[v])
        reached = np.hypot(cosine, sine) + rest
        best = reached > reached.max() - _TRACE_SLACK
        for turn in sorted(set(np.round(np.arctan2(sine[best], cosine[best]), _DIGITS).tolist())):
            places.append(place)
            found.append(turn)
    return np.array(places), np.array(found)


def _trace_parts(rotations: Floats, target: Floats) -> tuple[Floats, Floats, Floats]:
    """Numbers a, b, c: after a turn by t the trace of target⁻¹ · rotation is a cos t + b sin t + c.

    `rotations` (..., 3, 3), `target` (3, 3).
    """
    both = rotations @ target.T
    return (
        both[..., 0, 0] + both[..., 1, 1],
        both[..., 0, 1] - both[..., 1, 0],
        both[..., 2, 2],
    )


def _likeliest(
    found: _Hypotheses,
    steps: Poses,
    goal: Poses,
    equal: NDArray[np.bool_],
    alike: tuple[Floats, ...],
    *,
    turns: bool,
) -> _Hypotheses:
    """The hypotheses under which most steps have an equal block near, each by itself."""
    limits = np.array(TOLERANCES_CM)
    p, q = steps.centers_cm, goal.centers_cm
    rise = (p[:, None, 2] - q[None, :, 2]) ** 2
    xy = _turned_all(p[:, :2], found.turns_rad) + found.shifts_cm[:, None]
    apart = ((xy[:, :, None] - q[None, None, :, :2]) ** 2).sum(axis=-1) + rise
    distance = np.where(equal, np.sqrt(apart), np.inf)
    chosen = _ranked(distance, limits)[:_MOST_TURNED]
    found, distance = found.some(chosen), distance[chosen]
    if turns:
        for step, rotations in enumerate(alike):
            for vertex in np.flatnonzero(equal[step]):
                a, b, c = _trace_parts(steps.rotations[step] @ rotations, goal.rotations[vertex])
                t = found.turns_rad[:, None]
                trace = (np.cos(t) * a + np.sin(t) * b + c).max(axis=1)
                far = _angle_deg(trace) > TURN_TOLERANCE_DEG
                distance[far, step, vertex] = np.inf
    return found.some(_ranked(distance, limits)[:_MOST_TRIED])


def _ranked(distance: Floats, limits: Floats) -> NDArray[np.int64]:
    """Places of hypotheses, the best first."""
    nearest = distance.min(axis=2)
    within = (nearest[..., None] <= limits + 10**-_DIGITS).sum(axis=(1, 2))
    far = np.round(np.minimum(nearest, FARTHEST_CM).sum(axis=1), _DIGITS)
    return np.lexsort((far, -within))


def _turned(points: Floats, turns_rad: Floats) -> Floats:
    """Each of the points (n, 2) turned by its own angle (n,)."""
    cosine, sine = np.cos(turns_rad), np.sin(turns_rad)
    x, y = points.T
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


def _turned_all(points: Floats, turns_rad: Floats) -> Floats:
    """All points (n, 2) turned by each angle (h,), shape (h, n, 2)."""
    cosine, sine = np.cos(turns_rad)[:, None], np.sin(turns_rad)[:, None]
    x, y = points.T
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)


def _about_z(angles_rad: Floats) -> Floats:
    zero, one = np.zeros_like(angles_rad), np.ones_like(angles_rad)
    cosine, sine = np.cos(angles_rad), np.sin(angles_rad)
    rows = [[cosine, -sine, zero], [sine, cosine, zero], [zero, zero, one]]
    return np.moveaxis(np.array(rows), -1, 0)


def _angle_deg(traces: Floats) -> Floats:
    angles: Floats = np.degrees(np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0)))
    return angles
