"""How much of each block a picture shows, counted in the renderer's map of what shows where."""

from __future__ import annotations

import numpy as np

from phyblock.domain.scene import Scene
from phyblock.sim.pictures import PictureStyle, drawn, goal_camera
from phyblock.sim.render import segments

__all__ = ["LEAST_SHARE", "LEAST_SHOWN", "hidden_blocks", "visible_shares"]

LEAST_SHARE = 12 / 256**2
"""The least share of a goal picture that must show of a block: 48 pixels of 512 by 512.

What cannot be seen cannot be planned.
"""
LEAST_SHOWN = 0.03
"""The least share of a block's own outline that must show in the goal picture of a scene."""
_SIZE_PX = 256


def visible_shares(scene: Scene, style: PictureStyle) -> dict[int, float]:
    """For each block's order, the share of its pixels that no other block hides, 0..1.

    Its pixels are those that it covers when it is drawn alone by the same camera. Raises
    DataError for a scene without blocks.
    """
    camera, blocks = goal_camera(scene, style), drawn(scene)
    together = segments(blocks, camera, style.size_px)
    shares = {}
    for vertex, (block, one) in enumerate(zip(scene.blocks, blocks, strict=True)):
        alone = segments([one], camera, style.size_px) == 0
        shares[block.order] = float((together[alone] == vertex).sum() / max(alone.sum(), 1))
    return shares


def hidden_blocks(scene: Scene) -> tuple[int, ...]:
    """Orders of the blocks that show less than `LEAST_SHARE` in the default goal picture."""
    seen = segments(drawn(scene), goal_camera(scene, PictureStyle()), _SIZE_PX)
    counts = np.bincount(seen[seen >= 0], minlength=len(scene))
    least = LEAST_SHARE * _SIZE_PX**2
    return tuple(b.order for b, n in zip(scene.blocks, counts, strict=True) if n < least)
