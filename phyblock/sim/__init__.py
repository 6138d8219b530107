"""Geometry, contact, stability and pictures, on a physics engine and a renderer of one's choice.

`engine` and `renderer` say what is asked of the two, and `registry` lists all that there are.
PyBullet is the engine (`bullet`), loaded when a world is made, never by importing this package; the
renderer is our own (`raster`).
"""

from phyblock.sim.pictures import (
    RENDER_VERSION,
    PictureStyle,
    candidates_key,
    candidates_png,
    composite_png,
    goal_key,
    goal_png,
    goal_style,
)
from phyblock.sim.stability import Trial, check
from phyblock.sim.support import find_gaps, find_overlaps, support_graph
from phyblock.sim.world import Physics, Pose, World

__all__ = [
    "RENDER_VERSION",
    "Physics",
    "PictureStyle",
    "Pose",
    "Trial",
    "World",
    "candidates_key",
    "candidates_png",
    "check",
    "composite_png",
    "find_gaps",
    "find_overlaps",
    "goal_key",
    "goal_png",
    "goal_style",
    "support_graph",
]
