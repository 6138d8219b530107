"""Candidate sets: the needed blocks among distractors that differ from them by one attribute.

Orientation comes first, since it is what models confuse: other poses of the needed kinds fill
most of the set, other colors of the needed types a few places, other types only what is left.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

from phyblock.domain.blocks import BLOCK_TYPES, COLORS, KIT_PALETTE, Euler
from phyblock.domain.candidates import MAX_CANDIDATES, Candidate, CandidateSet
from phyblock.domain.scene import Kind, Look, Scene
from phyblock.errors import DataError, Problem
from phyblock_making.poses import POSES

__all__ = ["make_candidates"]

_COLOR_PLACES = 2


def make_candidates(
    scene: Scene,
    seed: int = 0,
    size: int = MAX_CANDIDATES,
    palette: tuple[Kind, ...] = KIT_PALETTE,
) -> CandidateSet:
    """Up to `size` candidates that look different, all that the scene needs among them.

    Distractors of another color or type come from `palette`. They stand grouped by type and
    color, so that a place tells nothing about being needed. The same scene id and seed give the
    same set everywhere. Raises DataError when the scene needs more than `size` looks.
    """
    needed = _distinct(Candidate(b.type, b.color, b.euler_deg) for b in scene.blocks)
    if len(needed) > size:
        message = "needs more different blocks than a candidate set holds"
        raise DataError(Problem(scene.id, message, "blocks", str(len(needed)), f"at most {size}"))
    salt = f"{seed}/{scene.id}"
    poses = _shuffled(_other_poses(needed), salt)
    colors = _shuffled(_other_colors(needed, palette), salt)
    types = _shuffled(_other_types(needed, palette), salt)
    reserved = min(_COLOR_PLACES, len(_distinct([*needed, *colors])) - len(needed))
    first = _distinct([*needed, *poses])[: max(len(needed), size - reserved)]
    chosen = _distinct([*first, *colors[:_COLOR_PLACES], *poses, *colors, *types])[:size]
    return CandidateSet(tuple(sorted(chosen, key=_place)))


def _other_poses(needed: Iterable[Candidate]) -> list[Candidate]:
    return [
        Candidate(block_type, color, euler)
        for block_type, color in dict.fromkeys(candidate.kind for candidate in needed)
        for euler in POSES[block_type].values()
    ]


def _other_colors(needed: Iterable[Candidate], palette: tuple[Kind, ...]) -> list[Candidate]:
    kinds = {candidate.kind for candidate in needed}
    return [
        Candidate(candidate.type, color, candidate.euler_deg)
        for candidate in needed
        for block_type, color in palette
        if block_type == candidate.type and (block_type, color) not in kinds
    ]


def _other_types(needed: Iterable[Candidate], palette: tuple[Kind, ...]) -> list[Candidate]:
    types = {candidate.type for candidate in needed}
    colors = {candidate.color for candidate in needed}
    return [
        Candidate(block_type, color, next(iter(POSES[block_type].values())))
        for block_type, color in palette
        if block_type not in types and color in colors
    ]


def _distinct(candidates: Iterable[Candidate]) -> list[Candidate]:
    """The first of each look, in the order given."""
    first: dict[Look, Candidate] = {}
    for candidate in candidates:
        first.setdefault(candidate.look, candidate)
    return list(first.values())


def _shuffled(candidates: Iterable[Candidate], salt: str) -> list[Candidate]:
    """In an order drawn by a hash: the same on every platform and Python."""

    def rank(candidate: Candidate) -> bytes:
        return hashlib.sha256(f"{salt}/{candidate}".encode()).digest()

    return sorted(candidates, key=rank)


def _place(candidate: Candidate) -> tuple[int, int, int, Euler]:
    """Where a candidate stands: by type, color, pose in the order of `POSES`, then angles."""
    known = list(POSES[candidate.type].values())
    euler = candidate.euler_deg
    pose = known.index(euler) if euler in known else len(known)
    return BLOCK_TYPES.index(candidate.type), COLORS.index(candidate.color), pose, euler
