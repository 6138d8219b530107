"""Between what plans say of a block's place, the middle of its box [cm], and its body frame."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from phyblock.domain import Block, BlockType, Candidate, CandidateSet, Euler, PoseStep
from phyblock.sim.geometry import corners_m

__all__ = ["box_height_cm", "center_cm", "origin_m", "put", "upright"]

_CM = 100.0
UPRIGHT: Euler = (0.0, 0.0, 0.0)


def center_cm(block: Block) -> tuple[float, float, float]:
    """The middle of the box round a block where it is [cm]."""
    x, y, z = (np.array(block.position_m) + _box_middle_m(block.type, block.euler_deg)) * _CM
    return float(x), float(y), float(z)


def box_height_cm(block: Block) -> float:
    """The height of the box round a block as it is turned [cm]."""
    heights = corners_m(block.type, (0.0, 0.0, 0.0), block.euler_deg)[:, 2]
    return float(np.ptp(heights)) * _CM


def origin_m(
    block_type: BlockType, euler_deg: Euler, center_cm: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Where the body frame of a block is [m] whose box has its middle at a place [cm]."""
    x, y, z = np.array(center_cm) / _CM - _box_middle_m(block_type, euler_deg)
    return float(x), float(y), float(z)


def put(step: PoseStep, candidates: CandidateSet) -> Block | None:
    """The block that a step puts, None for a number that no candidate has.

    Without a rotation of its own it has that of its candidate.
    """
    if not 1 <= step.candidate <= len(candidates):
        return None
    candidate = candidates[step.candidate]
    euler = candidate.euler_deg if step.euler_deg is None else step.euler_deg
    place = origin_m(candidate.type, euler, step.center_cm)
    return Block(1, candidate.type, candidate.color, place, euler, (), 1)


def upright(candidates: CandidateSet) -> tuple[CandidateSet, tuple[int, ...]]:
    """Each kind once, upright, and the number of its first candidate."""
    first: dict[tuple[str, str], int] = {}
    for number, one in enumerate(candidates.candidates, 1):
        first.setdefault(one.kind, number)
    kinds = [candidates[number].kind for number in first.values()]
    kit = CandidateSet(tuple(Candidate(kind, color, UPRIGHT) for kind, color in kinds))
    return kit, tuple(first.values())


@functools.lru_cache(maxsize=4096)
def _box_middle_m(block_type: BlockType, euler_deg: Euler) -> NDArray[np.float64]:
    """The middle of the box round a block whose body frame is at the origin, shape (3,) [m]."""
    corners = corners_m(block_type, (0.0, 0.0, 0.0), euler_deg)
    middle: NDArray[np.float64] = (corners.min(axis=0) + corners.max(axis=0)) / 2
    middle.setflags(write=False)
    return middle
