"""Turning and mirroring whole structures, with the angles that designs use."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import replace

from phyblock.domain.blocks import BlockType, Euler
from phyblock.domain.scene import Block, Scene
from phyblock.domain.symmetry import Symmetry, fingerprint, image_deg, image_m, pose_class
from phyblock.making.poses import POSES

__all__ = ["find_twins", "transformed"]


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
