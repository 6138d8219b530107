"""Blocks to pixels, by whichever renderer is chosen.

Renderers need no anti-aliasing: pictures are made at twice the size and scaled down. A block is
drawn as its solid and as black bars along its true edges; outlines found afterwards in depth or
segmentation would draw false diagonals. A block is no more than a color and two meshes here:
physics lives in `phyblock.sim.world`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from phyblock.domain.blocks import BlockType, Color, Euler, euler_deg_to_quat_xyzw
from phyblock.sim.camera import Camera
from phyblock.sim.geometry import corners_m, edge_bars, solid_mesh
from phyblock.sim.pose import Pose
from phyblock.sim.registry import renderer
from phyblock.sim.renderer import Light, Prop, Renderer, Rgb
from phyblock.sim.textures import floor, shadow
from phyblock.words import Background

__all__ = ["COLOR_RGB", "SUPERSAMPLE", "DrawnBlock", "Shot", "empty_ground", "picture", "shoot"]

SUPERSAMPLE = 2

COLOR_RGB: dict[Color, Rgb] = {
    "red": (244, 54, 54),
    "yellow": (250, 218, 50),
    "blue": (56, 88, 246),
    "green": (72, 190, 42),
    "orange": (250, 124, 46),
}
"""Color of a fully lit face, 0..255."""
_EDGE_RGB = (14, 14, 16)
_EDGE_HALF_WIDTH_M = 0.0004
_EDGE_HALF_WIDTH_PX = 0.45
_EDGE_STEP_M = 0.0001

_PROPS_PER_BLOCK = 2
"""Its solid and its edges."""

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
        """World corners of the solid, shape (n, 3) [m]."""
        return corners_m(self.type, self.position_m, self.euler_deg)

    @property
    def triangles_m(self) -> NDArray[np.float64]:
        """World corners of the solid's triangles, shape (m, 3, 3) [m]."""
        triangles: NDArray[np.float64] = self.vertices_m[solid_mesh(self.type).triangles]
        return triangles


@dataclass(frozen=True, eq=False)
class Shot:
    """Blocks as the renderer gives them, before floor and smoothing.

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
    """Draw blocks (one at least) alone, with no floor, at exactly `size_px` and unsmoothed.

    The chosen renderer draws unless another is given.
    """
    half_width_m = _edge_half_width_m(blocks, camera, size_px)
    props: list[Prop] = []
    for block in blocks:
        pose = Pose(np.array(block.position_m), euler_deg_to_quat_xyzw(block.euler_deg))
        props.append(Prop(solid_mesh(block.type), COLOR_RGB[block.color], pose))
        props.append(Prop(edge_bars(block.type, half_width_m), _EDGE_RGB, pose))
    light = Light(light_direction(camera), _AMBIENT, _DIFFUSE)
    raster = (drawn_by or renderer()).draw(props, camera, light, size_px)
    # Floor division takes -1, for no prop, to -1.
    return Shot(raster.rgb, raster.prop // _PROPS_PER_BLOCK)


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
        shot = shoot(blocks, camera, large_px, drawn_by)
        triangles = [block.triangles_m for block in blocks]
        image *= shadow(background, camera, large_px, triangles, light_direction(camera))
        np.copyto(image, shot.rgb, where=shot.block[..., None] >= 0)
    pixels = np.rint(image, out=image).astype(np.uint8)
    return Image.fromarray(pixels).resize((size_px, size_px), Image.Resampling.BOX)


def empty_ground(background: Background, camera: Camera, size_px: int) -> NDArray[np.float32]:
    """The floor of a picture of `size_px` squared, before it is scaled down."""
    return floor(background, camera, size_px * SUPERSAMPLE)


def light_direction(camera: Camera) -> NDArray[np.float64]:
    """Unit vector to the light, which goes round with the camera: above, a little to its left."""
    right = camera.axes[0]
    azimuth = math.atan2(-right[0], right[1]) + math.radians(_LIGHT_AZIMUTH_DEG)
    elevation = math.radians(_LIGHT_ELEVATION_DEG)
    flat = math.cos(elevation)
    return np.array(
        [flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)], dtype=np.float64
    )


def _edge_half_width_m(blocks: Sequence[DrawnBlock], camera: Camera, size_px: int) -> float:
    """True width, but never finer than a pixel of the finished picture; in steps of 0.1 mm."""
    places = np.array([block.position_m for block in blocks])
    depth_m = float(((places - camera.eye_m) @ camera.axes[2]).mean())
    pixel_m = camera.width_m(depth_m) * SUPERSAMPLE / size_px
    finest_m = max(_EDGE_HALF_WIDTH_M, _EDGE_HALF_WIDTH_PX * pixel_m)
    return round(math.ceil(finest_m / _EDGE_STEP_M) * _EDGE_STEP_M, 6)
