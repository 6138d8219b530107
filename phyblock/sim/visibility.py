"""How much of each block a picture shows, counted in the renderer's map of what shows where.

What cannot be seen cannot be planned: a goal shows of every block `LEAST_SHARE` of the picture, and
`LEAST_OUTLINE_SHARE` of its outline's area.
"""

from __future__ import annotations

import numpy as np

from phyblock.domain.scene import Scene
from phyblock.sim.pictures import PictureStyle, drawn, goal_camera
from phyblock.sim.render import segments

__all__ = ["LEAST_OUTLINE_SHARE", "LEAST_SHARE", "hidden_blocks", "visible_shares"]

LEAST_SHARE = 12 / 256**2
"""The least share of a goal picture that must show of a block: 48 pixels of 512 by 512."""
LEAST_OUTLINE_SHARE = 0.03
"""The least share that must show of the area that a block covers when nothing hides it."""
_SIZE_PX = 256


def visible_shares(scene: Scene, style: PictureStyle) -> dict[int, float]:
    """For each block's order, the share of its outline's area that no other block hides, 0..1.

    Its outline is what it covers when it is drawn alone by the same camera. Raises DataError for a
    scene without blocks.
    """
    return {order: seen / max(alone, 1) for order, (seen, alone) in _areas(scene, style).items()}


def hidden_blocks(scene: Scene) -> tuple[int, ...]:
    """Orders of the blocks of which the default goal picture shows too little (see above)."""
    style = PictureStyle(_SIZE_PX)
    least = LEAST_SHARE * _SIZE_PX**2
    return tuple(
        order
        for order, (seen, alone) in _areas(scene, style).items()
        if seen < max(least, LEAST_OUTLINE_SHARE * alone)
    )


def _areas(scene: Scene, style: PictureStyle) -> dict[int, tuple[int, int]]:
    """For each block's order, the pixels that show it, and those that it covers alone."""
    camera, blocks = goal_camera(scene, style), drawn(scene)
    together = np.bincount(
        (shown := segments(blocks, camera, style.size_px))[shown >= 0], minlength=len(blocks)
    )
    alone = [int((segments([one], camera, style.size_px) == 0).sum()) for one in blocks]
    return {
        block.order: (int(seen), area)
        for block, seen, area in zip(scene.blocks, together, alone, strict=True)
    }
