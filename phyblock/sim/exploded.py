"""Exploded views: a structure pulled apart along the vertical, so that every block can be seen."""

from __future__ import annotations

import numpy as np

from phyblock.domain.scene import Scene
from phyblock.sim.camera import Camera
from phyblock.sim.compose import to_png
from phyblock.sim.pictures import PictureStyle, camera_for, drawn
from phyblock.sim.render import DrawnBlock, picture

__all__ = ["exploded_blocks", "exploded_png"]

_RISE_M = 0.035
_SPREAD = 0.55


def exploded_png(scene: Scene, style: PictureStyle) -> bytes:
    """PNG of the structure pulled apart; raises DataError for a scene without blocks."""
    blocks = exploded_blocks(scene)
    camera: Camera = camera_for(blocks, style, scene.id)
    return to_png(picture(blocks, camera, style.background, style.size_px))


def exploded_blocks(scene: Scene) -> list[DrawnBlock]:
    """The blocks pulled apart: what stands over something else moves away from it, upward.

    A block rises by 35 mm for each height below its own at which some block begins, and moves
    out from the structure's axis by 55 % of its distance.
    """
    blocks = drawn(scene)
    bottoms = [round(float(block.vertices_m[:, 2].min()), 3) for block in blocks]
    heights = sorted(set(bottoms))
    places = np.array([block.position_m[:2] for block in blocks]).reshape(-1, 2)
    moved = []
    for block, bottom in zip(blocks, bottoms, strict=True):
        x, y, z = block.position_m
        middle_x, middle_y = (places.min(axis=0) + places.max(axis=0)) / 2
        out_x, out_y = float(x - middle_x) * _SPREAD, float(y - middle_y) * _SPREAD
        place = (x + out_x, y + out_y, z + _RISE_M * heights.index(bottom))
        moved.append(DrawnBlock(block.type, block.color, place, block.euler_deg))
    return moved
