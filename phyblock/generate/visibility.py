"""Whether a goal picture shows every block: what cannot be seen cannot be planned."""

from __future__ import annotations

import numpy as np

from phyblock.domain.scene import Scene
from phyblock.sim.pictures import PictureStyle, drawn, goal_camera
from phyblock.sim.render import shoot

__all__ = ["LEAST_SHARE", "hidden_blocks"]

LEAST_SHARE = 12 / 256**2
"""The least share of the goal picture that shows of every block: 48 pixels of 512 by 512."""
_SIZE_PX = 256


def hidden_blocks(scene: Scene) -> tuple[int, ...]:
    """Orders of the blocks that show less than `LEAST_SHARE` in the default goal picture."""
    seen = shoot(drawn(scene), goal_camera(scene, PictureStyle()), _SIZE_PX).block
    counts = np.bincount(seen[seen >= 0], minlength=len(scene))
    least = LEAST_SHARE * _SIZE_PX**2
    return tuple(b.order for b, n in zip(scene.blocks, counts, strict=True) if n < least)
