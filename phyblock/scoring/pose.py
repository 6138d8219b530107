"""Setting C: the score of a plan with poses by geometry, as given and after the best motion.

Also the error type of each step, the goal blocks that a finished structure reaches, and exact
volumes of intersections of convex pieces.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from phyblock.domain.blocks import SHAPES, euler_deg_to_matrix, symmetries, turn_deg
from phyblock.domain.scene import Block, CandidateSet, Scene
from phyblock.scoring.plan import Floats, Goal
from phyblock.scoring.pose_matching import (
    TOLERANCES_CM,
    TURN_TOLERANCE_DEG,
    Alignment,
    Motion,
    Nearness,
    cheapest,
    matched,
)
from phyblock.sim.contact import clip, pieces_of
from phyblock.sim.geometry import ConvexPiece, centers_m, cross
from phyblock.text import plain_sum
from phyblock.types import StepEnd

PoseFrame = Literal["absolute", "aligned"]
POSE_FRAMES: tuple[PoseFrame, ...] = get_args(PoseFrame)
"""`absolute`: the plan as given. `aligned`: after the best shift along the floor and turn about the
vertical of the whole plan, or as given if no motion scores higher.
"""
_CM = 100.0
_DIGITS = 4
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

    `fits` has the fit of each step, None for an unmatched one; `right` the number of right steps at
    each of `TOLERANCES_CM`.
    """

    frame: PoseFrame
    fits: tuple[PoseFit | None, ...]
    right: tuple[int, ...]
    n_blocks: int
    motion: Motion


class PoseScorer:
    """Scores plans with poses for one scene; build once, use for every model and seed.

    Steps have the orientation of their candidates.
    """

    def __init__(self, scene: Scene, candidates: CandidateSet) -> None:
        self._blocks = scene.blocks
        self.goal = Goal(scene, candidates, "A")

    def score(
        self, numbers: Sequence[int], blocks: Sequence[Block | None]
    ) -> tuple[PoseScore, ...]:
        """Return the score in each frame of a plan: the number of each step's candidate, and its
        block at its pose, None if no candidate has the number.
        """
        given = [(n, block) for n, block in zip(numbers, blocks, strict=True) if block is not None]
        if not given:
            fits, none = (None,) * len(numbers), (0,) * len(TOLERANCES_CM)
            return tuple(PoseScore(f, fits, none, len(self._blocks), Motion()) for f in POSE_FRAMES)
        kept, laid = zip(*given, strict=True)
        plan = _Plan(self.goal, kept, laid, self._blocks)
        absolute = plan.scored("absolute", Motion())
        aligned: PoseScore | None = None
        for most, motion in plan.alignment.likely_motions()[:_MOST_COUNTED]:
            # A valid order has no more steps within a tolerance than an arbitrary one.
            if aligned is not None and sum(aligned.right) >= most:
                break
            score = plan.scored("aligned", motion)
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


class _Plan:
    """The steps of a plan that name a candidate, against the goal."""

    def __init__(
        self, goal: Goal, numbers: Sequence[int], steps: Sequence[Block], blocks: Sequence[Block]
    ) -> None:
        self._goal, self._numbers, self._steps, self._blocks = goal, numbers, steps, blocks
        turns = np.array([euler_deg_to_matrix(block.euler_deg) for block in blocks])
        equal = np.zeros((len(steps), len(blocks)), dtype=bool)
        turn = np.zeros(equal.shape)
        for step, (number, block) in enumerate(zip(numbers, steps, strict=True)):
            equal[step, list(goal.equal_to[number])] = True
            same = euler_deg_to_matrix(block.euler_deg) @ symmetries(block.type)
            cosines = (np.einsum("kij,gij->gk", same, turns).max(axis=1) - 1) / 2
            turn[step] = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
        self.alignment = Alignment(centers_m(steps) * _CM, centers_m(blocks) * _CM, turn, equal)

    def scored(self, frame: PoseFrame, motion: Motion) -> PoseScore:
        """Return the score after a motion; volumes are only computed of the plan as given."""
        centers_cm, near = self.alignment.moved(motion)
        vertices = matched(self._goal, self._numbers, near)
        has_iou = frame == "absolute"
        fits = tuple(
            None if vertex is None else self._fit(near, centers_cm, step, vertex, has_iou=has_iou)
            for step, vertex in enumerate(vertices)
        )
        within = [int(near.within[s, v]) for s, v in enumerate(vertices) if v is not None]
        n = len(TOLERANCES_CM)
        # The widest tolerance comes last; a step within one is within all wider ones.
        right = tuple(sum(count >= n - place for count in within) for place in range(n))
        return PoseScore(frame, fits, right, len(self._blocks), motion)

    def _fit(
        self, near: Nearness, centers_cm: Floats, step: int, vertex: int, *, has_iou: bool
    ) -> PoseFit:
        off = centers_cm[step] - self.alignment.goal_cm[vertex]
        distance, turn = float(near.distance_cm[step, vertex]), float(near.turn_deg[step, vertex])
        iou = 1.0 if has_iou else None
        if has_iou and (distance > _SAME_CM or turn > _SAME_DEG):
            one, other = self._steps[step], self._blocks[vertex]
            shared = overlap_volume(one, other)
            share = min(1.0, shared / (2 * SHAPES[one.type].volume_m3 - shared))
            iou = round(share, _DIGITS)
        values = (distance, float(np.hypot(off[0], off[1])), float(off[2]), turn)
        far, sideways, up, by = (round(value, _DIGITS) + 0.0 for value in values)
        return PoseFit(vertex, far, sideways, up, by, iou)


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
block that it rests on is missing (`too_early`); its place is farther than `ERROR_TOLERANCE_CM` from
that of its goal block, mainly sideways or mainly in height (`off_sideways`, `off_height`); it
overlaps others or the floor (`interpenetrating`); when released, it does not stay (`floating`), or
others do not (`toppling`).
"""
ERROR_TOLERANCE_CM = 1.0


_PHYSICAL: dict[StepEnd, PoseError] = {
    "no_block": "wrong_kind",
    "under_floor": "interpenetrating",
    "overlaps": "interpenetrating",
    "falls": "floating",
    "knocks_over": "toppling",
}


def pose_errors(
    goal: Goal,
    numbers: Sequence[int],
    fits: Sequence[PoseFit | None],
    ends: Sequence[StepEnd],
) -> tuple[PoseError | None, ...]:
    """Return the error of each step, None for one that is right and stands.

    `numbers` are those of all steps, including numbers that no candidate has; `fits` are those of
    the plan as given, `ends` those of its execution.
    """
    placed = 0
    found: list[PoseError | None] = []
    for number, fit, end in zip(numbers, fits, ends, strict=True):
        if fit is None:
            found.append(_unmatched(goal, number, placed))
            continue
        placed |= 1 << fit.vertex
        if fit.turn_deg > TURN_TOLERANCE_DEG:
            found.append("wrong_rotation")
        elif fit.position_cm > ERROR_TOLERANCE_CM:
            found.append("off_sideways" if fit.sideways_cm >= abs(fit.up_cm) else "off_height")
        else:
            found.append(_PHYSICAL.get(end))
    return tuple(found)


def _unmatched(goal: Goal, number: int, placed: int) -> PoseError:
    """The error of a step that is matched to no goal block."""
    if number not in goal.equal:
        return "wrong_kind"
    error = goal.error(number, placed)
    if error == "incorrect_orientation":
        return "wrong_rotation"
    # Of several steps for one block, all but the nearest are superfluous.
    is_ready = bool(goal.choices(number, placed))
    return "too_early" if error == "dependency_not_met" and not is_ready else "wrong_kind"


def blocks_reached(
    goal: Sequence[Block], blocks: Sequence[Block], within_cm: float, within_deg: float
) -> int:
    """Return how many goal blocks can each be matched to a near enough block of its kind."""
    if not goal or not blocks:
        return 0
    wanted, found = (
        [
            (block, center, euler_deg_to_matrix(block.euler_deg))
            for block, center in zip(some, centers_m(some), strict=True)
        ]
        for some in (goal, blocks)
    )
    near = np.array(
        [
            [
                one.kind == other.kind
                and math.dist(place, there) * _CM <= within_cm
                and turn_deg(one.type, turn, turned) <= within_deg
                for other, there, turned in found
            ]
            for one, place, turn in wanted
        ]
    )
    return sum(bool(near[pair]) for pair in cheapest((~near).astype(np.float64)))


_AXES = np.eye(3)
_FLAT = 1e-9
"""Points closer to a plane than this share of a block's size lie on it [m]."""


def overlap_volume(one: Block, other: Block) -> float:
    """Volume that two blocks share [m3]."""
    return plain_sum(_shared(*pair) for pair in itertools.product(pieces_of(one), pieces_of(other)))


def _shared(one: ConvexPiece, other: ConvexPiece) -> float:
    apart = np.maximum(
        one.vertices_m.min(axis=0) - other.vertices_m.max(axis=0),
        other.vertices_m.min(axis=0) - one.vertices_m.max(axis=0),
    )
    if apart.max() >= 0:
        return 0.0
    faces = _faces(one)
    for normal in (*other.face_normals, *-other.face_normals):
        faces = _cut(faces, normal, float((other.vertices_m @ normal).max()))
        if len(faces) < 4:
            return 0.0
    return _volume(faces)


def _faces(piece: ConvexPiece) -> list[Floats]:
    """The faces of a polytope, each a polygon (n, 3) in order around it."""
    faces = []
    for normal in (*piece.face_normals, *-piece.face_normals):
        heights = piece.vertices_m @ normal
        face = piece.vertices_m[heights > heights.max() - _FLAT]
        # A semi-cylinder has a face on only one side of a pair.
        if len(face) > 2:
            faces.append(_round(face, normal))
    return faces


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


def _volume(faces: list[Floats]) -> float:
    """Volume of a convex polytope: cones from a point inside to each of its faces."""
    if len(faces) < 4:
        return 0.0
    corners = np.concatenate(faces)
    middle = corners.sum(axis=0) / len(corners)
    total = 0.0
    for face in faces:
        legs = face - middle
        fans = cross(legs[1:-1] - legs[0], legs[2:] - legs[0])
        total += abs(float((fans @ legs[0]).sum())) / 6
    return total
