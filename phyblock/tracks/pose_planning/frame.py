"""Between what plans say of a block's place, the middle of its box [cm], and its body frame."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from phyblock.domain import Block, BlockType, Candidate, CandidateSet, Euler, PoseStep
from phyblock.scoring import Laid
from phyblock.scoring.solids import Piece
from phyblock.sim.geometry import collision_pieces, corners_m

__all__ = ["box_height_cm", "center_cm", "laid", "pieces_of", "put", "upright"]

_CM = 100.0
UPRIGHT: Euler = (0.0, 0.0, 0.0)


@functools.cache
def pieces_of(block_type: BlockType) -> tuple[Piece, ...]:
    """The convex pieces of a block in its body frame."""
    return tuple(Piece(p.vertices_m, p.face_normals) for p in collision_pieces(block_type))


def center_cm(block: Block) -> tuple[float, float, float]:
    """The middle of the box round a block where it is [cm]."""
    x, y, z = (np.array(block.position_m) + _middle_m(block.type, block.euler_deg)) * _CM
    return float(x), float(y), float(z)


def box_height_cm(block: Block) -> float:
    """The height of the box round a block as it is turned [cm]."""
    heights = corners_m(block.type, (0.0, 0.0, 0.0), block.euler_deg)[:, 2]
    return float(np.ptp(heights)) * _CM


def laid(step: PoseStep, candidate: Candidate) -> Laid:
    """A step as a rigid body; without a rotation of its own it has that of its candidate."""
    euler = candidate.euler_deg if step.euler_deg is None else step.euler_deg
    x, y, z = np.array(step.center_cm) / _CM - _middle_m(candidate.type, euler)
    return Laid(step.candidate, (float(x), float(y), float(z)), euler)


def put(step: PoseStep, candidates: CandidateSet) -> Block | None:
    """The block that a step puts, None for a number that no candidate has."""
    if not 1 <= step.candidate <= len(candidates):
        return None
    candidate = candidates[step.candidate]
    body = laid(step, candidate)
    return Block(1, candidate.type, candidate.color, body.position_m, body.euler_deg, (), 1)


def upright(candidates: CandidateSet) -> tuple[CandidateSet, tuple[int, ...]]:
    """Each kind once, upright, and the number of its first candidate."""
    first: dict[tuple[str, str], int] = {}
    for number, one in enumerate(candidates.candidates, 1):
        first.setdefault(one.kind, number)
    kinds = [candidates[number].kind for number in first.values()]
    kit = CandidateSet(tuple(Candidate(kind, color, UPRIGHT) for kind, color in kinds))
    return kit, tuple(first.values())


@functools.lru_cache(maxsize=4096)
def _middle_m(block_type: BlockType, euler_deg: Euler) -> NDArray[np.float64]:
    """The middle of the box round a block whose body frame is at the origin, shape (3,) [m]."""
    corners = corners_m(block_type, (0.0, 0.0, 0.0), euler_deg)
    middle: NDArray[np.float64] = (corners.min(axis=0) + corners.max(axis=0)) / 2
    middle.setflags(write=False)
    return middle
