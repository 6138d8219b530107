"""Blocks to pixels with PyBullet's software renderer (TinyRenderer), the same on every machine.

TinyRenderer has no anti-aliasing, so pictures are made at twice the size and scaled down. A block
is drawn as its solid and as black bars along its true edges; outlines found afterwards in depth
or segmentation would draw false diagonals. A block is no more than a color and two meshes here:
physics lives in `phyblock.sim.world`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from phyblock.domain.blocks import (
    BlockType,
    Color,
    Euler,
    euler_deg_to_quat_xyzw,
    quat_xyzw_to_matrix,
)
from phyblock.sim import engine
from phyblock.sim.camera import Camera
from phyblock.sim.geometry import edge_bars, solid_mesh
from phyblock.sim.mesh import Mesh
from phyblock.sim.textures import Background, floor, shadow

__all__ = ["COLOR_RGB", "RENDERER", "SUPERSAMPLE", "DrawnBlock", "Shot", "picture", "shoot"]

RENDERER = "tinyrenderer"
SUPERSAMPLE = 2

COLOR_RGB: dict[Color, tuple[int, int, int]] = {
    "red": (244, 54, 54),
    "yellow": (250, 218, 50),
    "blue": (56, 88, 246),
    "green": (72, 190, 42),
    "orange": (250, 124, 46),
}
"""Color of a fully lit face, 0..255."""
_EDGE_RGB = (14, 14, 16)
_EDGE_HALF_WIDTH_M = 0.00045
_EDGE_HALF_WIDTH_PX = 0.48

_BODIES_PER_BLOCK = 2
"""Solid and edges; a fresh client counts its bodies from 0, and -1 // 2 stays -1."""

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
    def rotation(self) -> NDArray[np.float64]:
        """Body to world, shape (3, 3)."""
        return quat_xyzw_to_matrix(euler_deg_to_quat_xyzw(self.euler_deg))

    @property
    def vertices_m(self) -> NDArray[np.float64]:
        """World corners of the solid, shape (n, 3) [m]."""
        turned: NDArray[np.float64] = solid_mesh(self.type).vertices_m @ self.rotation.T
        turned += np.array(self.position_m)
        return turned

    @property
    def triangles_m(self) -> NDArray[np.float64]:
        """World corners of the solid's triangles, shape (m, 3, 3) [m]."""
        triangles: NDArray[np.float64] = self.vertices_m[solid_mesh(self.type).triangles]
        return triangles


@dataclass(frozen=True, eq=False)
class Shot:
    """The renderer's raw answer.

    `rgb` shape (size, size, 3), 0..255; `block` shape (size, size), the 0-based number of the
    block seen in each pixel, -1 where there is none.
    """

    rgb: NDArray[np.uint8]
    block: NDArray[np.int64]


def shoot(blocks: Sequence[DrawnBlock], camera: Camera, size_px: int) -> Shot:
    """Draw blocks alone, with no floor behind them, at exactly `size_px` and unsmoothed."""
    depth = float(
        np.mean([(np.array(b.position_m) - camera.eye_m) @ camera.axes[2] for b in blocks])
    )
    half_width_m = _edge_half_width_m(depth, size_px)
    with engine.client() as (bullet, client):
        for block in blocks:
            _add_body(bullet, client, solid_mesh(block.type), COLOR_RGB[block.color], block)
            _add_body(bullet, client, edge_bars(block.type, half_width_m), _EDGE_RGB, block)
        width, height, rgba, _, bodies = bullet.getCameraImage(
            size_px,
            size_px,
            camera.view_matrix(),
            camera.projection_matrix(),
            lightDirection=light_direction(camera).tolist(),
            lightAmbientCoeff=_AMBIENT,
            lightDiffuseCoeff=_DIFFUSE,
            lightSpecularCoeff=0.0,
            shadow=0,
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=client,
        )
    colors = np.asarray(rgba, dtype=np.uint8).reshape(height, width, 4)[..., :3]
    seen = np.asarray(bodies, dtype=np.int64).reshape(height, width)
    return Shot(colors.copy(), seen // _BODIES_PER_BLOCK)


def picture(
    blocks: Sequence[DrawnBlock], camera: Camera, background: Background, size_px: int
) -> Image.Image:
    """Blocks on their floor, anti-aliased, an RGB image of `size_px` squared."""
    large_px = size_px * SUPERSAMPLE
    image = floor(background, camera, large_px)
    if blocks:
        shot = shoot(blocks, camera, large_px)
        triangles = [block.triangles_m for block in blocks]
        image *= shadow(background, camera, large_px, triangles, light_direction(camera))
        image = np.where(shot.block[..., None] >= 0, shot.rgb, image)
    pixels = np.rint(image).astype(np.uint8)
    return Image.fromarray(pixels).resize((size_px, size_px), Image.Resampling.BOX)


def light_direction(camera: Camera) -> NDArray[np.float64]:
    """Unit vector to the light, which goes round with the camera: above, a little to its left."""
    right = camera.axes[0]
    azimuth = math.atan2(-right[0], right[1]) + math.radians(_LIGHT_AZIMUTH_DEG)
    elevation = math.radians(_LIGHT_ELEVATION_DEG)
    flat = math.cos(elevation)
    return np.array(
        [flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)], dtype=np.float64
    )


def _edge_half_width_m(depth_m: float, size_px: int) -> float:
    """True width, but never finer than a pixel of the finished picture."""
    pixel_m = 2 * depth_m * math.tan(math.radians(15)) * SUPERSAMPLE / size_px
    return max(_EDGE_HALF_WIDTH_M, _EDGE_HALF_WIDTH_PX * pixel_m)


def _add_body(
    bullet: ModuleType, client: int, mesh: Mesh, rgb: tuple[int, int, int], block: DrawnBlock
) -> None:
    corners = mesh.corners_m.reshape(-1, 3)
    shape = bullet.createVisualShape(
        bullet.GEOM_MESH,
        vertices=corners.tolist(),
        indices=list(range(len(corners))),
        normals=np.repeat(mesh.normals, 3, axis=0).tolist(),
        uvs=[[0.0, 0.0]] * len(corners),
        rgbaColor=[*(channel / 255 for channel in rgb), 1.0],
        physicsClientId=client,
    )
    bullet.createMultiBody(
        baseVisualShapeIndex=shape,
        basePosition=block.position_m,
        baseOrientation=euler_deg_to_quat_xyzw(block.euler_deg).tolist(),
        physicsClientId=client,
    )
