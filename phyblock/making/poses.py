"""The ways in which each block type is laid down, by name: the orientations that designs use."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import replace

from phyblock.domain.blocks import BlockType, Euler
from phyblock.domain.scene import Block, Scene
from phyblock.domain.symmetry import Symmetry, fingerprint, image_deg, image_m, pose_class


def _turns(*names: str, roll: float = 0.0, pitch: float = 0.0) -> dict[str, Euler]:
    """One pose and its quarter turns about the vertical, as many as there are names."""
    return {name: (roll, pitch, 90.0 * turn) for turn, name in enumerate(names)}


_SLAB = {
    **_turns("flat-x", "flat-y"),
    **_turns("edge-x", "edge-y", roll=90.0),
    **_turns("upright-x", "upright-y", pitch=90.0),
}
POSES: dict[BlockType, dict[str, Euler]] = {
    "arch": {
        **_turns("gate", "gate-turned"),
        **_turns("cradle", "cradle-turned", pitch=180.0),
        **_turns("open+y", "open-x", "open-y", "open+x", roll=90.0),
    },
    "cube": _turns("flat"),
    "cuboid1": {**_turns("flat"), **_turns("edge-x", "edge-y", roll=90.0)},
    "cuboid2": _SLAB,
    "cuboid3": _SLAB,
    "cylinder": {
        **_turns("upright"),
        "lying-x": (90.0, 0.0, 90.0),
        "lying-y": (90.0, 0.0, 0.0),
    },
    "semi_cylinder": {
        **_turns("dome", "dome-turned"),
        **_turns("bowl", "bowl-turned", roll=180.0),
        **_turns("round+x", "round+y", "round-x", "round-y", pitch=90.0),
    },
    "triangle": {
        **_turns("roof", "roof-turned"),
        **_turns("ramp+y", "ramp-x", "ramp-y", "ramp+x", roll=135.0),
        **_turns("wedge+x", "wedge+y", "wedge-x", "wedge-y", roll=-135.0, pitch=90.0),
    },
}
"""Euler angles [degrees] of each named pose; the first is the one a design means by default.

A `ramp+y` slopes down towards +y, a `round+x` shows its round side to +x, an arch that is
`open+y` stands on one end with its hole to +y. `x` and `y` name the direction of the long side,
and for `upright` slabs the one that the slab is thin in.
"""


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
