"""The ways in which each block type is laid down, by name: the orientations that designs use."""

from __future__ import annotations

from phyblock.domain.blocks import BlockType, Color, Euler

__all__ = ["KIT_COLOR", "POSES"]

POSES: dict[BlockType, dict[str, Euler]] = {
    "arch": {
        "gate": (0.0, 0.0, 0.0),
        "gate-turned": (0.0, 0.0, 90.0),
        "cradle": (0.0, 180.0, 0.0),
        "cradle-turned": (0.0, 180.0, 90.0),
        "open+y": (90.0, 0.0, 0.0),
        "open-x": (90.0, 0.0, 90.0),
        "open-y": (90.0, 0.0, 180.0),
        "open+x": (90.0, 0.0, 270.0),
    },
    "cube": {"flat": (0.0, 0.0, 0.0)},
    "cuboid1": {
        "flat": (0.0, 0.0, 0.0),
        "edge-x": (90.0, 0.0, 0.0),
        "edge-y": (90.0, 0.0, 90.0),
    },
    "cuboid2": {
        "flat-x": (0.0, 0.0, 0.0),
        "flat-y": (0.0, 0.0, 90.0),
        "edge-x": (90.0, 0.0, 0.0),
        "edge-y": (90.0, 0.0, 90.0),
        "upright-x": (0.0, 90.0, 0.0),
        "upright-y": (0.0, 90.0, 90.0),
    },
    "cuboid3": {
        "flat-x": (0.0, 0.0, 0.0),
        "flat-y": (0.0, 0.0, 90.0),
        "edge-x": (90.0, 0.0, 0.0),
        "edge-y": (90.0, 0.0, 90.0),
        "upright-x": (0.0, 90.0, 0.0),
        "upright-y": (0.0, 90.0, 90.0),
    },
    "cylinder": {
        "upright": (0.0, 0.0, 0.0),
        "lying-x": (90.0, 0.0, 90.0),
        "lying-y": (90.0, 0.0, 0.0),
    },
    "semi_cylinder": {
        "dome": (0.0, 0.0, 0.0),
        "dome-turned": (0.0, 0.0, 90.0),
        "bowl": (180.0, 0.0, 0.0),
        "bowl-turned": (180.0, 0.0, 90.0),
        "round+x": (0.0, 90.0, 0.0),
        "round+y": (0.0, 90.0, 90.0),
        "round-x": (0.0, 90.0, 180.0),
        "round-y": (0.0, 90.0, 270.0),
    },
    "triangle": {
        "roof": (0.0, 0.0, 0.0),
        "roof-turned": (0.0, 0.0, 90.0),
        "ramp+y": (135.0, 0.0, 0.0),
        "ramp-x": (135.0, 0.0, 90.0),
        "ramp-y": (135.0, 0.0, 180.0),
        "ramp+x": (135.0, 0.0, 270.0),
        "wedge+x": (-135.0, 90.0, 0.0),
        "wedge+y": (-135.0, 90.0, 90.0),
        "wedge-x": (-135.0, 90.0, 180.0),
        "wedge-y": (-135.0, 90.0, 270.0),
    },
}
"""Euler angles [degrees] of each named pose; the first is the one a design means by default.

A `ramp+y` slopes down towards +y, a `round+x` shows its round side to +x, an arch that is
`open+y` stands on one end with its hole to +y. `x` and `y` name the direction of the long side,
and for `upright` slabs the one that the slab is thin in.
"""

KIT_COLOR: dict[BlockType, Color] = {
    "arch": "red",
    "cube": "red",
    "cuboid1": "blue",
    "cuboid2": "green",
    "cuboid3": "yellow",
    "cylinder": "orange",
    "semi_cylinder": "yellow",
    "triangle": "orange",
}
"""Color in which the official kit has each type; a cube comes in all five."""
