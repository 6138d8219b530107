"""The ways in which each block type is laid down, by name: the orientations that designs use."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from phyblock.domain.blocks import SHAPES, BlockType, Euler
from phyblock.domain.scene import Block, Scene
from phyblock.domain.symmetry import Symmetry, fingerprint, image_deg, image_m, pose_class

POSES: Mapping[BlockType, Mapping[str, Euler]] = {
    block_type: shape.poses for block_type, shape in SHAPES.items()
}
"""Euler angles [degrees] of each named pose; the first is the one a design means by default."""


def transformed(blocks: Sequence[Block], symmetry: Symmetry) -> tuple[Block, ...]:
    """The blocks turned or mirrored about the origin; their graph stays what it was."""
    return tuple(
        replace(
            block,
            position_m=image_m(block.position_m, symmetry),
            euler_deg=_turned(block.type, block.euler_deg, symmetry),
        )
        for block in blocks
    )


def find_twins(scenes: Iterable[Scene]) -> dict[str, str]:
    """Scenes, by id, that equal an earlier one but for turning, mirroring and shifting: its id."""
    first: dict[bytes, str] = {}
    earlier = {scene.id: first.setdefault(fingerprint(scene.blocks), scene.id) for scene in scenes}
    return {name: twin for name, twin in earlier.items() if twin != name}


@functools.cache
def _turned(block_type: BlockType, euler_deg: Euler, symmetry: Symmetry) -> Euler:
    """Angles of the image of a pose, as `POSES` names them where it does."""
    angles = image_deg(euler_deg, symmetry)
    wanted = pose_class(block_type, angles)
    for known in POSES[block_type].values():
        if pose_class(block_type, known) == wanted:
            return known
    return angles
