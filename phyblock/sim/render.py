"""Blocks to pixels, by whichever renderer is chosen.

Renderers need no anti-aliasing: pictures are made at twice the size and scaled down. Outlines run
where one face ends in the picture, which a renderer tells by number, so there are no false ones. A
block is no more than a color and a mesh here: physics lives in `phyblock.sim.world`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from phyblock.domain.blocks import (
    BlockType,
    Color,
    Euler,
    euler_deg_to_matrix,
    euler_deg_to_quat_xyzw,
)
from phyblock.sim.camera import Camera
from phyblock.sim.exact import rounded, turned
from phyblock.sim.geometry import drawn_mesh
from phyblock.sim.outlines import draw_outlines
from phyblock.sim.pose import Pose
from phyblock.sim.registry import renderer
from phyblock.sim.renderer import Light, Prop, Raster, Renderer, Rgb
from phyblock.sim.textures import floor, shadow
from phyblock.types import Background

__all__ = [
    "COLOR_RGB",
    "SUPERSAMPLE",
    "DrawnBlock",
    "Shot",
    "empty_ground",
    "picture",
    "props_of",
    "segments",
    "shoot",
]

SUPERSAMPLE = 2

COLOR_RGB: dict[Color, Rgb] = {
    "red": (244, 54, 54),
    "yellow": (250, 218, 50),
    "blue": (56, 88, 246),
    "green": (72, 190, 42),
    "orange": (250, 124, 46),
}
"""Color of a fully lit face, 0..255."""
_AMBIENT = 0.55
_DIFFUSE = 0.55
_LIGHT_AZIMUTH_DEG = -18.0
_LIGHT_ELEVATION_DEG = 46.0


@dataclass(frozen=True)
class DrawnBlock:
    """What a picture needs to know of a block: `position_m` is its body frame's origin [m]."""

    type: BlockType
    color: Color
    position_m: tuple[float, float, float]
    euler_deg: Euler

    @property
    def vertices_m(self) -> NDArray[np.float64]:
        """World corners of what is drawn, shape (n, 3) [m]."""
        vertices: NDArray[np.float64] = _turned_m(self.type, self.euler_deg) + self.position_m
        return vertices

    @property
    def triangles_m(self) -> NDArray[np.float64]:
        """World corners of the triangles that are drawn, shape (m, 3, 3) [m]."""
        triangles: NDArray[np.float64] = self.vertices_m[drawn_mesh(self.type).triangles]
        return triangles


@functools.lru_cache(maxsize=1024)
def _turned_m(block_type: BlockType, euler_deg: Euler) -> NDArray[np.float64]:
    """World corners of what is drawn of a block at the origin, shape (n, 3) [m]; do not change."""
    matrix = rounded(euler_deg_to_matrix(euler_deg))
    return turned(drawn_mesh(block_type).vertices_m, matrix)


@dataclass(frozen=True, eq=False)
class Shot:
    """Blocks with their outlines, before floor and smoothing.

    `rgb` shape (size, size, 3), 0..255; `block` shape (size, size), the 0-based number of the
    block seen in each pixel, -1 where there is none.
    """

    rgb: NDArray[np.uint8]
    block: NDArray[np.int64]


def shoot(
    blocks: Sequence[DrawnBlock],
    camera: Camera,
    size_px: int,
    drawn_by: Renderer | None = None,
) -> Shot:
    """Draw blocks alone, with no floor, at exactly `size_px` and unsmoothed.

    The chosen renderer draws unless another is given.
    """
    raster = _raster(blocks, camera, size_px, drawn_by)
    rgb = draw_outlines(raster.rgb, raster, None)
    return Shot(rgb, raster.prop)


def segments(blocks: Sequence[DrawnBlock], camera: Camera, size_px: int) -> NDArray[np.int64]:
    """The 0-based number of the block seen in each pixel, shape (size, size), -1 for none."""
    light = Light(np.array([0.0, 0.0, 1.0]), 1.0, 0.0)
    return renderer().draw(props_of(blocks), camera, light, size_px).prop


def picture(
    blocks: Sequence[DrawnBlock],
    camera: Camera,
    background: Background,
    size_px: int,
    ground: NDArray[np.float32] | None = None,
    drawn_by: Renderer | None = None,
) -> Image.Image:
    """Blocks on their floor, anti-aliased, an RGB image of `size_px` squared.

    `ground` is the floor as `empty_ground` gives it, for those who draw it often. The chosen
    renderer draws unless another is given.
    """
    large_px = size_px * SUPERSAMPLE
    image = floor(background, camera, large_px) if ground is None else ground.copy()
    if blocks:
        raster = _raster(blocks, camera, large_px, drawn_by)
        image *= shadow(background, raster.shaded)
        np.copyto(image, raster.rgb, where=raster.prop[..., None] >= 0)
        image = draw_outlines(image, raster, background)
    pixels = np.rint(image, out=image).astype(np.uint8)
    return Image.fromarray(pixels).resize((size_px, size_px), Image.Resampling.BOX)


def _raster(
    blocks: Sequence[DrawnBlock], camera: Camera, size_px: int, drawn_by: Renderer | None
) -> Raster:
    light = Light(light_direction(camera), _AMBIENT, _DIFFUSE)
    return (drawn_by or renderer()).draw(props_of(blocks), camera, light, size_px)


def props_of(blocks: Sequence[DrawnBlock]) -> list[Prop]:
    """Blocks as a renderer takes them."""
    return [
        Prop(
            drawn_mesh(block.type),
            COLOR_RGB[block.color],
            Pose(np.array(block.position_m), euler_deg_to_quat_xyzw(block.euler_deg)),
        )
        for block in blocks
    ]


def empty_ground(background: Background, camera: Camera, size_px: int) -> NDArray[np.float32]:
    """The floor of a picture of `size_px` squared, before it is scaled down."""
    return floor(background, camera, size_px * SUPERSAMPLE)


def light_direction(camera: Camera) -> NDArray[np.float64]:
    """Unit vector to the light, which goes round with the camera: above, a little to its left."""
    right = camera.axes[0]
    azimuth = math.atan2(-right[0], right[1]) + math.radians(_LIGHT_AZIMUTH_DEG)
    elevation = math.radians(_LIGHT_ELEVATION_DEG)
    flat = math.cos(elevation)
    towards = [flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)]
    return rounded(np.array(towards))
