"""Setting C: the score of a plan with poses by geometry, as given and after the best motion.

Each step is matched to an unplaced, ready block that equals its candidate, for as many steps as
place a block in setting A. Among such matchings, the one whose steps meet the most tolerances in
total is used, and among equals the one with the smallest distances.

For the motion, every pair of steps laid on a pair of equal goal blocks is a hypothesis; weighted
least squares over matched blocks refine the best. The plan's place and direction change nothing.

Also the errors of steps, the goal blocks that are reached, and the volumes that blocks share.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import SHAPES, euler_deg_to_matrix, symmetries, turn_deg
from phyblock.domain.scene import Block, CandidateSet, Plan, Scene
from phyblock.scoring.plan import Floats, Goal, most_placed, steps_back
from phyblock.sim.contact import clip, pieces_of
from phyblock.sim.geometry import ConvexPiece, centers_m, cross
from phyblock.text import plain_sum
from phyblock.types import StepEnd


def cheapest(cost: Floats) -> list[tuple[int, int]]:
    """Pairs of row and column with the least total cost, one for each of the shorter side, by row.

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
"""Cheapest sets of placed blocks kept after a step; plans in a valid order need no search."""


@dataclass(frozen=True)
class Nearness:
    """Steps against goal blocks, (steps, blocks): distance [cm], turn [degrees], equal or not."""

    distance_cm: Floats
    turn_deg: Floats
    equal: NDArray[np.bool_]

    @functools.cached_property
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
    """The goal block of each step. Raises KeyError for a number that no candidate has.

    Unless the cheapest assignment is a valid order, search step by step over sets of placed blocks,
    each with the cheapest path to it; steps may be skipped if not all of them can be matched.
    """
    most = most_placed(goal, Plan(tuple(numbers)))
    vertices = assigned(near)
    placed = 0
    for vertex in vertices:
        if vertex is not None and goal.graph.is_ready(vertex, placed):
            placed |= 1 << vertex
    n_matched = sum(vertex is not None for vertex in vertices)
    if placed.bit_count() == n_matched == most:
        return tuple(vertices)
    cost, spare = near.cost, len(numbers) - most
    frontier: dict[int, float] = {0: 0.0}
    history: list[dict[int, int | None]] = []
    for step, number in enumerate(numbers):
        costs: dict[int, float] = {}
        taken: dict[int, int | None] = {}
        for placed, paid in frontier.items():
            if step - placed.bit_count() < spare and paid < costs.get(placed, np.inf):
                costs[placed], taken[placed] = paid, None
            for choice in goal.choices(number, placed):
                reached, more = placed | 1 << choice, paid + float(cost[step, choice])
                if more < costs.get(reached, np.inf):
                    costs[reached], taken[reached] = more, choice
        if len(costs) > _MOST_SETS:
            # A skipped step costs as much as one that misses every tolerance.
            ranked = sorted(costs, key=lambda mask: (costs[mask] - mask.bit_count(), mask))
            costs = {mask: costs[mask] for mask in ranked[:_MOST_SETS]}
        frontier = costs
        history.append(taken)
    best = min(frontier, key=lambda mask: (-mask.bit_count(), frontier[mask], mask))
    return tuple(steps_back(history, best))


_APART_CM = 1.0
"""Least distance of two steps from which a direction is computed."""
_MOST_PAIRS = 6000
_MOST_TURNED = 240
_MOST_TRIED = 12
_ROUNDS = 5
_FAR_DIGITS = 6
_PLACE_DIGITS = 3


class Motion(NamedTuple):
    """A turn about the vertical through the origin, then a shift along the floor [cm]."""

    turn_rad: float = 0.0
    shift_cm: tuple[float, float] = (0.0, 0.0)


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
                # Turns that differ by full circles are equal.
                turned = (math.cos(motion.turn_rad), math.sin(motion.turn_rad), *motion.shift_cm)
                place = (round(part, _PLACE_DIGITS) + 0.0 for part in turned)
                rank = (float(within), -round(far, _FAR_DIGITS), *place)
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
        shift_x = float(target[0]) - cosine * x + sine * y
        shift_y = float(target[1]) - sine * x - cosine * y
        return Motion(turn, (shift_x, shift_y))

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
        off = np.round(np.abs(length - wanted), _FAR_DIGITS)
        is_long = (length > _APART_CM) & (wanted > _APART_CM)
        kept = np.flatnonzero(is_long & (off <= 2 * TOLERANCES_CM[-1] + 10**-_FAR_DIGITS))
        kept = kept[np.argsort(off[kept], kind="stable")][:_MOST_PAIRS]
        first, second, way, aim = first[kept], second[kept], way[kept], aim[kept]
        turn = np.arctan2(aim[:, 1], aim[:, 0]) - np.arctan2(way[:, 1], way[:, 0])
        middle = (p[step[first]] + p[step[second]]) / 2
        target = (q[vertex[first]] + q[vertex[second]]) / 2
        if len(turn):
            return turn, target - _turned(middle, turn)
        # A single step determines no turn.
        return np.zeros(len(step)), q[vertex] - p[step]

    def _likeliest(self, turns_rad: Floats, shifts_cm: Floats) -> tuple[Floats, Floats]:
        """The hypotheses under which the most steps have an equal block nearby."""
        limits = np.array(TOLERANCES_CM)

        def ranked(distance: Floats) -> NDArray[np.int64]:
            """Places of hypotheses, best first; ties do not depend on how they are numbered."""
            nearest = distance.min(axis=2)
            within = (nearest[..., None] <= limits + 10**-_FAR_DIGITS).sum(axis=(1, 2))
            far = np.round(np.minimum(nearest, FARTHEST_CM).sum(axis=1), _FAR_DIGITS)
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


PoseFrame = Literal["absolute", "aligned"]
POSE_FRAMES: tuple[PoseFrame, ...] = get_args(PoseFrame)
"""`absolute`: the plan as given. `aligned`: after the best shift along the floor and turn about the
vertical of the whole plan, or as given if no motion scores higher."""
_CM = 100.0
_FIT_DIGITS = 4
_MOST_COUNTED = 8
_SAME_CM, _SAME_DEG = 1e-7, 1e-5


@dataclass(frozen=True)
class PoseFit:
    """Distance of a step from its goal block: total, sideways and up [cm], and angle [degrees].

    `iou` is the intersection over union of the two volumes, None where it was not computed.
    """

    vertex: int
    position_cm: float
    sideways_cm: float
    up_cm: float
    turn_deg: float
    iou: float | None


@dataclass(frozen=True)
class PoseScore:
    """One plan in one frame.

    `fits` are None for unmatched steps; `right` counts right steps at each of `TOLERANCES_CM`.
    """

    frame: PoseFrame
    fits: tuple[PoseFit | None, ...]
    right: tuple[int, ...]
    motion: Motion


class PoseScorer:
    """Scores plans with poses for one scene; build once, use for every model and seed."""

    def __init__(self, scene: Scene, candidates: CandidateSet) -> None:
        self._blocks = scene.blocks
        self.goal = Goal(scene, candidates, "A")

    def score(
        self, numbers: Sequence[int], blocks: Sequence[Block | None]
    ) -> tuple[PoseScore, ...]:
        """Return the score in each frame; `blocks` are at their poses, None without a candidate."""
        given = [(n, block) for n, block in zip(numbers, blocks, strict=True) if block is not None]
        if not given:
            fits, none = (None,) * len(numbers), (0,) * len(TOLERANCES_CM)
            return tuple(PoseScore(frame, fits, none, Motion()) for frame in POSE_FRAMES)
        kept, steps = zip(*given, strict=True)
        turns = np.array([euler_deg_to_matrix(block.euler_deg) for block in self._blocks])
        equal = np.zeros((len(steps), len(self._blocks)), dtype=bool)
        turn = np.zeros(equal.shape)
        for step, (number, block) in enumerate(given):
            equal[step, list(self.goal.equal_to[number])] = True
            same = euler_deg_to_matrix(block.euler_deg) @ symmetries(block.type)
            cosines = (np.einsum("kij,gij->gk", same, turns).max(axis=1) - 1) / 2
            turn[step] = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
        steps_cm, goal_cm = centers_m(steps) * _CM, centers_m(self._blocks) * _CM
        alignment = Alignment(steps_cm, goal_cm, turn, equal)
        absolute = self._scored("absolute", Motion(), alignment, kept, steps)
        aligned: PoseScore | None = None
        for most, motion in alignment.likely_motions()[:_MOST_COUNTED]:
            # A valid order has no more steps within a tolerance than an arbitrary one.
            if aligned is not None and sum(aligned.right) >= most:
                break
            score = self._scored("aligned", motion, alignment, kept, steps)
            if aligned is None or sum(score.right) > sum(aligned.right):
                aligned = score
        if aligned is None or sum(absolute.right) > sum(aligned.right):
            still = tuple(fit and replace(fit, iou=None) for fit in absolute.fits)
            aligned = replace(absolute, frame="aligned", fits=still)
        scores = []
        for score in (absolute, aligned):
            found = iter(score.fits)
            whole = tuple(None if block is None else next(found) for block in blocks)
            scores.append(replace(score, fits=whole))
        return tuple(scores)

    def _scored(
        self,
        frame: PoseFrame,
        motion: Motion,
        alignment: Alignment,
        numbers: Sequence[int],
        steps: Sequence[Block],
    ) -> PoseScore:
        """Return the score after a motion; volumes are only computed of the plan as given."""
        centers_cm, near = alignment.moved(motion)
        fits: list[PoseFit | None] = []
        within: list[int] = []
        for step, vertex in enumerate(matched(self.goal, numbers, near)):
            if vertex is None:
                fits.append(None)
                continue
            within.append(int(near.within[step, vertex]))
            off = centers_cm[step] - alignment.goal_cm[vertex]
            distance = float(near.distance_cm[step, vertex])
            turn = float(near.turn_deg[step, vertex])
            iou = 1.0 if frame == "absolute" else None
            if iou is not None and (distance > _SAME_CM or turn > _SAME_DEG):
                shared = overlap_volume(steps[step], self._blocks[vertex])
                share = min(1.0, shared / (2 * SHAPES[steps[step].type].volume_m3 - shared))
                iou = round(share, _FIT_DIGITS)
            values = (distance, float(np.hypot(off[0], off[1])), float(off[2]), turn)
            far, sideways, up, by = (round(value, _FIT_DIGITS) + 0.0 for value in values)
            fits.append(PoseFit(vertex, far, sideways, up, by, iou))
        n = len(TOLERANCES_CM)
        # The widest tolerance comes last; a step within one is within all wider ones.
        right = tuple(sum(count >= n - place for count in within) for place in range(n))
        return PoseScore(frame, tuple(fits), right, motion)


PoseError = Literal[
    "wrong_kind",
    "wrong_rotation",
    "too_early",
    "off_sideways",
    "off_height",
    "interpenetrating",
    "floating",
    "toppling",
]
POSE_ERRORS: tuple[PoseError, ...] = get_args(PoseError)
"""Errors of a step, of which the first that applies counts. The goal does not need a block of its
kind, or not so often (`wrong_kind`); no such goal block has its orientation (`wrong_rotation`); a
block that it rests on is missing (`too_early`); it is more than `ERROR_TOLERANCE_CM` from its goal
block, mainly sideways or mainly in height (`off_sideways`, `off_height`); it overlaps others or the
floor (`interpenetrating`); when released, it (`floating`) or others (`toppling`) do not stay."""
ERROR_TOLERANCE_CM = 1.0


_PHYSICAL: dict[StepEnd, PoseError] = {
    "no_block": "wrong_kind",
    "under_floor": "interpenetrating",
    "overlaps": "interpenetrating",
    "falls": "floating",
    "knocks_over": "toppling",
}


def pose_errors(
    goal: Goal, numbers: Sequence[int], fits: Sequence[PoseFit | None], ends: Sequence[StepEnd]
) -> tuple[PoseError | None, ...]:
    """Return the error of each step, None for one that is right and stands.

    `numbers` may be of no candidate; `fits` are of the plan as given, `ends` of its execution.
    """
    placed = 0
    found: list[PoseError | None] = []
    for number, fit, end in zip(numbers, fits, ends, strict=True):
        if fit is None:
            error = goal.error(number, placed) if number in goal.equal else None
            if error == "incorrect_orientation":
                found.append("wrong_rotation")
            elif error == "dependency_not_met" and not goal.choices(number, placed):
                found.append("too_early")
            else:
                # Of several steps for one block, all but the nearest are superfluous.
                found.append("wrong_kind")
            continue
        placed |= 1 << fit.vertex
        if fit.turn_deg > TURN_TOLERANCE_DEG:
            found.append("wrong_rotation")
        elif fit.position_cm > ERROR_TOLERANCE_CM:
            found.append("off_sideways" if fit.sideways_cm >= abs(fit.up_cm) else "off_height")
        else:
            found.append(_PHYSICAL.get(end))
    return tuple(found)


def blocks_reached(
    goal: Sequence[Block], blocks: Sequence[Block], within_cm: float, within_deg: float
) -> int:
    """Return how many goal blocks can each be matched to a near enough block of its kind."""
    if not goal or not blocks:
        return 0
    far = np.ones((len(goal), len(blocks)))
    centers = [*zip(blocks, centers_m(blocks), strict=True)]
    for row, (one, place) in enumerate(zip(goal, centers_m(goal), strict=True)):
        for column, (other, there) in enumerate(centers):
            if one.kind == other.kind and math.dist(place, there) * _CM <= within_cm:
                turns = (euler_deg_to_matrix(block.euler_deg) for block in (one, other))
                far[row, column] = turn_deg(one.type, *turns) > within_deg
    return sum(not far[pair] for pair in cheapest(far))


_AXES = np.eye(3)
_FLAT = 1e-9
"""Points closer to a plane than this share of a block's size lie on it [m]."""


def overlap_volume(one: Block, other: Block) -> float:
    """Volume that two blocks share [m3]."""
    return plain_sum(_shared(*pair) for pair in itertools.product(pieces_of(one), pieces_of(other)))


def _shared(one: ConvexPiece, other: ConvexPiece) -> float:
    """Volume that two convex pieces share [m3]: the faces of one, cut by the other's planes."""
    apart = np.maximum(
        one.vertices_m.min(axis=0) - other.vertices_m.max(axis=0),
        other.vertices_m.min(axis=0) - one.vertices_m.max(axis=0),
    )
    if apart.max() >= 0:
        return 0.0
    faces: list[Floats] = []
    for normal in (*one.face_normals, *-one.face_normals):
        heights = one.vertices_m @ normal
        face = one.vertices_m[heights > heights.max() - _FLAT]
        # A semi-cylinder has a face on only one side of a pair.
        if len(face) > 2:
            faces.append(_round(face, normal))
    for normal in (*other.face_normals, *-other.face_normals):
        faces = _cut(faces, normal, float((other.vertices_m @ normal).max()))
        if len(faces) < 4:
            return 0.0
    # Cones from a point inside to each of the faces.
    corners = np.concatenate(faces)
    middle = corners.sum(axis=0) / len(corners)
    total = 0.0
    for face in faces:
        legs = face - middle
        fans = cross(legs[1:-1] - legs[0], legs[2:] - legs[0])
        total += abs(float((fans @ legs[0]).sum())) / 6
    return total


def _round(points: Floats, normal: Floats) -> Floats:
    """Corners of a convex polygon in order around its center."""
    if len(points) == 3:
        return points
    helper = _AXES[int(np.argmin(np.abs(normal)))]
    right = cross(normal, helper)
    spread = points - points.sum(axis=0) / len(points)
    angles = np.arctan2(spread @ cross(normal, right), spread @ right)
    return points[np.argsort(angles, kind="stable")]


def _cut(faces: list[Floats], normal: Floats, limit: float) -> list[Floats]:
    """Return the part of a polytope at or below the plane `normal` · x = `limit`."""
    kept: list[Floats] = []
    rim: list[Floats] = []
    has_lid = False
    for face in faces:
        heights = face @ normal - limit
        highest = heights.max()
        if highest < -_FLAT:
            kept.append(face)
            continue
        if highest <= _FLAT:
            on_plane = heights >= -_FLAT
            has_lid = has_lid or bool(on_plane.all())
            kept.append(face)
            rim += list(face[on_plane])
            continue
        polygon = clip(face, heights, _FLAT)
        if len(polygon) > 2:
            kept.append(polygon)
        if len(polygon):
            rim += list(polygon[polygon @ normal >= limit - _FLAT])
    if len(rim) > 2 and not has_lid:
        corners: Floats = np.unique(np.round(np.array(rim), 10), axis=0)
        if len(corners) > 2:
            kept.append(_round(corners, normal))
    return kept
