"""The physics seam: geometry, contact, stability and pictures; the only layer with PyBullet.

PyBullet itself is loaded when a world or a picture is made, never by importing this package.
"""

from phyblock.sim.pictures import (
    RENDER_VERSION,
    PictureStyle,
    candidates_key,
    candidates_png,
    composite_png,
    goal_key,
    goal_png,
)

__all__ = [
    "RENDER_VERSION",
    "PictureStyle",
    "candidates_key",
    "candidates_png",
    "composite_png",
    "goal_key",
    "goal_png",
]
