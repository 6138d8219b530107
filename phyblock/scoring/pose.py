"""Setting C: what a plan with poses is worth by geometry alone, as it stands and once it was moved
as a whole.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from phyblock.domain import (
    BlockType,
    CandidateSet,
    Euler,
    Scene,
    euler_deg_to_matrix,
    symmetries,
)
from phyblock.domain.blocks import SHAPES
from phyblock.scoring.goal import Goal
from phyblock.scoring.pose_align import Motion, Poses, likely_motions, nearness
from phyblock.scoring.pose_match import TOLERANCES_CM, Nearness, matched
from phyblock.scoring.ratios import Floats
from phyblock.scoring.solids import Piece, overlap_volume, placed
from phyblock.types import Setting

__all__ = ["POSE_FRAMES", "Laid", "PoseFit", "PoseFrame", "PoseScore", "PoseScorer"]

PoseFrame = Literal["absolute", "aligned"]
POSE_FRAMES: tuple[PoseFrame, ...] = get_args(PoseFrame)
"""`absolute`: where the plan says. `aligned`: after the best shift over the floor and turn about
the vertical of the whole plan, which is none where none counts more.
"""
_CM = 100.0
_DIGITS = 4
_MOST_COUNTED = 8
_SAME_CM, _SAME_DEG = 1e-7, 1e-5


@dataclass(frozen=True)
class Laid:
    """A step as a rigid body: the candidate's number, the origin of its body frame [m], its
    angles.
    """

    candidate: int
    position_m: tuple[float, float, float]
    euler_deg: Euler


@dataclass(frozen=True)
class PoseFit:
    """How a step lies to the goal block that it stands for: in all, sideways and up [cm], turned
    [degrees], and what share of both volumes they have in common.
    """

    vertex: int
    position_cm: float
    sideways_cm: float
    up_cm: float
    turn_deg: float
    iou: float | None


@dataclass(frozen=True)
class PoseScore:
    """One plan in one frame: the fit of each step that stands for a block, None for the others, and
    how many are right at each of `TOLERANCES_CM`.
    """

    frame: PoseFrame
    fits: tuple[PoseFit | None, ...]
    right: tuple[int, ...]
    n_blocks: int
    motion: Motion


class PoseScorer:
    """Scores plans with poses for one scene; build once, use for every model and seed.

    With setting A candidates keep their orientation; with B steps bring one of their own, which
    counts within its tolerance. `pieces_of` gives the convex pieces of a block in its body frame.
    """

    def __init__(
        self,
        scene: Scene,
        candidates: CandidateSet,
        setting: Setting,
        pieces_of: Callable[[BlockType], Sequence[Piece]],
    ) -> None:
        self._types = {n: one.type for n, one in enumerate(candidates.candidates, 1)}
        self._blocks = scene.blocks
        self.goal = Goal(scene, candidates, setting)
        self._turns = setting == "B"
        self._pieces_of = pieces_of
        self._poses = _poses([(b.type, b.position_m, b.euler_deg) for b in scene.blocks])

    def score(self, steps: Sequence[Laid]) -> tuple[PoseScore, ...]:
        """The score in each of `POSE_FRAMES`; raises KeyError for a step that is no candidate."""
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
        alike = tuple(symmetries(block_type) for block_type in types)
        numbers = [step.candidate for step in steps]
        absolute = self._scored("absolute", numbers, types, poses, equal, alike, Motion())
        aligned: PoseScore | None = None
        motions = likely_motions(poses, self._poses, equal, alike, turns=self._turns)
        for most, motion in motions[:_MOST_COUNTED]:
            # In a valid order no more is within a tolerance than in any.
            if aligned is not None and sum(aligned.right) >= most:
                break
            moved = poses.moved(motion, turns=self._turns)
            score = self._scored("aligned", numbers, types, moved, equal, alike, motion)
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
        poses: Poses,
        equal: NDArray[np.bool_],
        alike: tuple[Floats, ...],
        motion: Motion,
    ) -> PoseScore:
        near = nearness(poses, self._poses, equal, alike)
        vertices = matched(self.goal, numbers, near)
        fits = tuple(
            None
            if vertex is None
            else self._fit(near, poses, step, vertex, types[step] if frame == "absolute" else None)
            for step, vertex in enumerate(vertices)
        )
        within = [int(near.within[s, v]) for s, v in enumerate(vertices) if v is not None]
        n = len(TOLERANCES_CM)
        # The widest tolerance comes last, and who is within one is within all wider ones.
        right = tuple(sum(count >= n - place for count in within) for place in range(n))
        return PoseScore(frame, fits, right, len(self._blocks), motion)

    def _fit(
        self, near: Nearness, poses: Poses, step: int, vertex: int, block_type: BlockType | None
    ) -> PoseFit:
        """The fit of a step; of a type, its volume too."""
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
