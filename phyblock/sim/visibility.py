"""How much of each block a picture shows, counted in the renderer's segmentation."""

from __future__ import annotations

from phyblock.domain.scene import Scene
from phyblock.sim.pictures import PictureStyle, drawn, goal_camera
from phyblock.sim.render import shoot

__all__ = ["visible_shares"]


def visible_shares(scene: Scene, style: PictureStyle) -> dict[int, float]:
    """For each block's order, the share of its pixels that no other block hides, 0..1.

    Its pixels are those that it covers when it is drawn alone by the same camera. Raises
    DataError for a scene without blocks.
    """
    camera, blocks = goal_camera(scene, style), drawn(scene)
    together = shoot(blocks, camera, style.size_px).block
    shares = {}
    for vertex, (block, one) in enumerate(zip(scene.blocks, blocks, strict=True)):
        alone = shoot([one], camera, style.size_px).block == 0
        shares[block.order] = float((together[alone] == vertex).sum() / max(alone.sum(), 1))
    return shares
