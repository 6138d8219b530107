"""Setting C: the score of a plan with poses by geometry, as given and after the best motion.

Also the error type of each step, the goal blocks that a finished structure reaches, and exact
volumes of intersections of convex pieces.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

import numpy as np

from phyblock.domain.blocks import (
    SHAPES,
    BlockType,
    Euler,
    euler_deg_to_matrix,
    symmetries,
    turn_deg,
)
from phyblock.domain.scene import Block, CandidateSet, Scene
from phyblock.scoring.plan import Floats, Goal
from phyblock.scoring.pose_matching import (
    TOLERANCES_CM,
    TURN_TOLERANCE_DEG,
    Alignment,
    Motion,
    Nearness,
    Poses,
    cheapest,
    matched,
)
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
class Laid:
    """A step as a rigid body: candidate number, origin of its body frame [m], Euler angles."""

    candidate: int
    position_m: tuple[float, float, float]
    euler_deg: Euler


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

    Steps have the orientation of their candidates. `pieces_of` returns the convex pieces of a block
    in its body frame.
    """

    def __init__(
        self,
        scene: Scene,
        candidates: CandidateSet,
        pieces_of: Callable[[BlockType], Sequence[Piece]],
    ) -> None:
        self._types = {n: one.type for n, one in enumerate(candidates.candidates, 1)}
        self._blocks = scene.blocks
        self.goal = Goal(scene, candidates, "A")
        self._pieces_of = pieces_of
        self._poses = _poses([(b.type, b.position_m, b.euler_deg) for b in scene.blocks])

    def score(self, steps: Sequence[Laid]) -> tuple[PoseScore, ...]:
        """Return the score in each frame. Raises KeyError for a step that names no candidate."""
        types = [self._types[step.candidate] for step in steps]
        if not steps:
            none = (0,) * len(TOLERANCES_CM)
            return tuple(PoseScore(f, (), none, len(self._blocks), Motion()) for f in POSE_FRAMES)
        poses = _poses(
            [(t, step.position_m, step.euler_deg) for t, step in zip(types, steps, strict=True)]
        )
        equal = np.zeros((len(steps), len(self._blocks)), dtype=bool)
        for place, step in enumerate(steps):
            equal[place, list(self.goal.equal_to[step.candidate])] = True
        turns = tuple(symmetries(block_type) for block_type in types)
        alignment = Alignment(poses, self._poses, equal, turns)
        numbers = [step.candidate for step in steps]
        absolute = self._scored("absolute", numbers, types, alignment, Motion())
        aligned: PoseScore | None = None
        for most, motion in alignment.likely_motions()[:_MOST_COUNTED]:
            # A valid order has no more steps within a tolerance than an arbitrary one.
            if aligned is not None and sum(aligned.right) >= most:
                break
            score = self._scored("aligned", numbers, types, alignment, motion)
            if aligned is None or sum(score.right) > sum(aligned.right):
                aligned = score
        if aligned is None or sum(absolute.right) > sum(aligned.right):
            still = tuple(fit and replace(fit, iou=None) for fit in absolute.fits)
            aligned = replace(absolute, frame="aligned", fits=still)
        return absolute, aligned

    def _scored(
        self,
        frame: PoseFrame,
        numbers: Sequence[int],
        types: Sequence[BlockType],
        alignment: Alignment,
        motion: Motion,
    ) -> PoseScore:
        poses, near = alignment.moved(motion)
        vertices = matched(self.goal, numbers, near)
        fits = tuple(
            None
            if vertex is None
            else self._fit(near, poses, step, vertex, types[step] if frame == "absolute" else None)
            for step, vertex in enumerate(vertices)
        )
        within = [int(near.within[s, v]) for s, v in enumerate(vertices) if v is not None]
        n = len(TOLERANCES_CM)
        # The widest tolerance comes last; a step within one is within all wider ones.
        right = tuple(sum(count >= n - place for count in within) for place in range(n))
        return PoseScore(frame, fits, right, len(self._blocks), motion)

    def _fit(
        self, near: Nearness, poses: Poses, step: int, vertex: int, block_type: BlockType | None
    ) -> PoseFit:
        """The fit of a step, with its volume where the type is given."""
        off = poses.centers_cm[step] - self._poses.centers_cm[vertex]
        distance, turn = float(near.distance_cm[step, vertex]), float(near.turn_deg[step, vertex])
        iou = None if block_type is None else 1.0
        if block_type is not None and (distance > _SAME_CM or turn > _SAME_DEG):
            iou = round(self._iou(block_type, poses, step, vertex), _DIGITS)
        values = (distance, float(np.hypot(off[0], off[1])), float(off[2]), turn)
        far, sideways, up, by = (round(value, _DIGITS) + 0.0 for value in values)
        return PoseFit(vertex, far, sideways, up, by, iou)

    def _iou(self, block_type: BlockType, poses: Poses, step: int, vertex: int) -> float:
        """Intersection over union of a step's block and the goal's."""
        shape = SHAPES[block_type]
        solids = []
        for one, place in ((poses, step), (self._poses, vertex)):
            rotation = one.rotations[place]
            origin = one.centers_cm[place] / _CM - rotation @ np.array(shape.center_of_mass_m)
            solids.append(placed(self._pieces_of(block_type), rotation, origin))
        shared = overlap_volume(*solids)
        return min(1.0, shared / (2 * shape.volume_m3 - shared))


def _poses(bodies: Sequence[tuple[BlockType, tuple[float, float, float], Euler]]) -> Poses:
    rotations = np.array([euler_deg_to_matrix(euler) for _, _, euler in bodies])
    centers = [
        np.array(position) + rotation @ np.array(SHAPES[block_type].center_of_mass_m)
        for (block_type, position, _), rotation in zip(bodies, rotations, strict=True)
    ]
    return Poses(np.array(centers) * _CM, rotations)


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

    def is_near(one: Block, other: Block) -> bool:
        if one.kind != other.kind:
            return False
        rotations = [euler_deg_to_matrix(block.euler_deg) for block in (one, other)]
        middle = np.array(SHAPES[one.type].center_of_mass_m)
        places = [
            np.array(block.position_m) + rotation @ middle
            for block, rotation in zip((one, other), rotations, strict=True)
        ]
        if math.dist(*places) * _CM > within_cm:
            return False
        return turn_deg(one.type, *rotations) <= within_deg

    near = np.array([[is_near(one, other) for other in blocks] for one in goal])
    if not near.size:
        return 0
    return sum(bool(near[pair]) for pair in cheapest((~near).astype(np.float64)))


_AXES = np.eye(3)
_FLAT = 1e-9
"""Points closer to a plane than this share of a block's size lie on it [m]."""


class Piece(NamedTuple):
    """A convex polytope: corners (n, 3), and a unit normal (k, 3) for each pair of faces."""

    corners: Floats
    normals: Floats


def placed(pieces: Sequence[Piece], rotation: Floats, position: Floats) -> tuple[Piece, ...]:
    """Pieces turned by `rotation` (3, 3), then shifted to `position` (3,)."""
    return tuple(Piece(p.corners @ rotation.T + position, p.normals @ rotation.T) for p in pieces)


def overlap_volume(one: Sequence[Piece], other: Sequence[Piece]) -> float:
    """Volume that two solids share, each given by convex pieces that do not overlap."""
    return plain_sum(_shared(first, second) for first in one for second in other)


def _shared(one: Piece, other: Piece) -> float:
    apart = np.maximum(
        one.corners.min(axis=0) - other.corners.max(axis=0),
        other.corners.min(axis=0) - one.corners.max(axis=0),
    )
    if apart.max() >= 0:
        return 0.0
    faces = _faces(one)
    for normal in (*other.normals, *-other.normals):
        faces = _cut(faces, normal, float((other.corners @ normal).max()))
        if len(faces) < 4:
            return 0.0
    return _volume(faces)


def _faces(piece: Piece) -> list[Floats]:
    """The faces of a polytope, each a polygon (n, 3) in order around it."""
    faces = []
    for normal in (*piece.normals, *-piece.normals):
        heights = piece.corners @ normal
        face = piece.corners[heights > heights.max() - _FLAT]
        # A semi-cylinder has a face on only one side of a pair.
        if len(face) > 2:
            faces.append(_round(face, normal))
    return faces


def _round(points: Floats, normal: Floats) -> Floats:
    """Corners of a convex polygon in order around its center."""
    if len(points) == 3:
        return points
    helper = _AXES[int(np.argmin(np.abs(normal)))]
    right = _cross(normal, helper)
    spread = points - points.sum(axis=0) / len(points)
    angles = np.arctan2(spread @ _cross(normal, right), spread @ right)
    return points[np.argsort(angles, kind="stable")]


def _cross(one: Floats, other: Floats) -> Floats:
    """Vector products along the last axis; `np.cross` is several times slower on a few."""
    a, b, c = one[..., 0], one[..., 1], one[..., 2]
    x, y, z = other[..., 0], other[..., 1], other[..., 2]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


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
        polygon = _below(face, heights)
        if len(polygon) > 2:
            kept.append(polygon)
        if len(polygon):
            rim += list(polygon[polygon @ normal >= limit - _FLAT])
    if len(rim) > 2 and not has_lid:
        corners: Floats = np.unique(np.round(np.array(rim), 10), axis=0)
        if len(corners) > 2:
            kept.append(_round(corners, normal))
    return kept


def _below(face: Floats, heights: Floats) -> Floats:
    """The part of a polygon whose `heights` are not above zero."""
    points = []
    for i, height in enumerate(heights):
        after = (i + 1) % len(face)
        if height <= _FLAT:
            points.append(face[i])
        if (height < -_FLAT and heights[after] > _FLAT) or (
            height > _FLAT and heights[after] < -_FLAT
        ):
            share = height / (height - heights[after])
            points.append(face[i] + share * (face[after] - face[i]))
    return np.array(points).reshape(-1, 3)


def _volume(faces: list[Floats]) -> float:
    """Volume of a convex polytope: cones from a point inside to each of its faces."""
    if len(faces) < 4:
        return 0.0
    corners = np.concatenate(faces)
    middle = corners.sum(axis=0) / len(corners)
    total = 0.0
    for face in faces:
        legs = face - middle
        fans = _cross(legs[1:-1] - legs[0], legs[2:] - legs[0])
        total += abs(float((fans @ legs[0]).sum())) / 6
    return total
