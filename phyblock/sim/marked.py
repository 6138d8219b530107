"""Pictures that point at blocks: those in question in full color, the rest faded."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from PIL import Image

from phyblock.domain.scene import Scene
from phyblock.sim.compose import to_png
from phyblock.sim.pictures import PictureStyle, drawn, goal_camera
from phyblock.sim.render import SUPERSAMPLE, picture, shoot
from phyblock.sim.textures import floor

__all__ = ["marked_png"]

_FADE = 0.68


def marked_png(scene: Scene, orders: Collection[int], style: PictureStyle) -> bytes:
    """The goal picture with every block faded into the floor but those named in `orders`.

    With none to name nothing is faded. Raises DataError for a scene without blocks.
    """
    camera, blocks = goal_camera(scene, style), drawn(scene)
    image = picture(blocks, camera, style.background, style.size_px)
    named = np.array([block.order in orders for block in scene.blocks])
    if not named.any():
        return to_png(image)
    large_px = style.size_px * SUPERSAMPLE
    seen = shoot(blocks, camera, large_px).block
    faded = (seen >= 0) & ~named[seen]
    share = faded.reshape(style.size_px, SUPERSAMPLE, style.size_px, SUPERSAMPLE).mean(axis=(1, 3))
    below = floor(style.background, camera, style.size_px)
    pixels = np.asarray(image, dtype=np.float32)
    pixels = pixels + (below - pixels) * (_FADE * share[..., None])
    return to_png(Image.fromarray(np.rint(pixels).astype(np.uint8)))
