"""Steps and blocks as the rigid bodies that are scored."""

from __future__ import annotations

import functools

from phyblock.domain import BlockType, Candidate, PoseStep
from phyblock.scoring.pose import Laid, Piece
from phyblock.sim.geometry import collision_pieces, origin_m

__all__ = ["laid", "pieces_of"]


@functools.cache
def pieces_of(block_type: BlockType) -> tuple[Piece, ...]:
    """The convex pieces of a block in its body frame."""
    return tuple(Piece(p.vertices_m, p.face_normals) for p in collision_pieces(block_type))


def laid(step: PoseStep, candidate: Candidate) -> Laid:
    """A step as a rigid body; without a rotation of its own it has that of its candidate."""
    euler = candidate.euler_deg if step.euler_deg is None else step.euler_deg
    place = origin_m(candidate.type, euler, step.center_cm)
    return Laid(step.candidate, place, euler)
