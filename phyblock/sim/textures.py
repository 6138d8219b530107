"""What stands behind the blocks: procedural floors, and the shadow that falls on them.

The floor is the plane z = 0, colored by casting a ray through every pixel. It needs no image
file, has no far edge, and needs no textures of the renderer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFilter

from phyblock.sim.backgrounds import TONES
from phyblock.sim.camera import Camera
from phyblock.sim.surfaces import PERIOD_M, SURFACES, Surface, sample
from phyblock.types import Background

__all__ = ["floor", "shadow"]

_TILE_M = 0.4
_LIGHT_TILE = np.array([39.0, 56.0, 75.0], dtype=np.float32)
_DARK_TILE = np.array([21.0, 37.0, 53.0], dtype=np.float32)
_FADE_FROM_M = np.float32(4.0)
"""Farther tiles blend into their mean color; at the horizon they are finer than a pixel."""
_SOFTNESS = 340
"""Pictures are this many times as wide as the blur at the edge of a shadow."""


def floor(background: Background, camera: Camera, size_px: int) -> NDArray[np.float32]:
    """Color of every pixel's floor, shape (size, size, 3), 0..255, before any shadow.

    Raises ValueError for a background that has no floor here.
    """
    if background == "white":
        return np.full((size_px, size_px, 3), 255.0, dtype=np.float32)
    down = -camera.ray_component(2, size_px)
    below = down > 1e-6
    distance = np.float32(camera.eye_m[2]) / np.where(below, down, np.float32(np.inf))
    if background in SURFACES:
        return _surface(background, camera, down, distance)
    if background == "checkerboard":
        return _checkerboard(camera, below, distance)
    raise ValueError(f"{background} has no floor")


def _checkerboard(
    camera: Camera, below: NDArray[np.bool_], distance: NDArray[np.float32]
) -> NDArray[np.float32]:
    parity = np.zeros(distance.shape, dtype=np.int64)
    for axis in (0, 1):
        hit = camera.eye_m[axis] + distance * camera.ray_component(axis, len(distance))
        parity += np.floor(hit / _TILE_M).astype(np.int64)
    contrast = np.where(parity % 2 == 0, np.float32(0.5), np.float32(-0.5))
    contrast *= np.where(below, _FADE_FROM_M / np.maximum(distance, _FADE_FROM_M), 0.0)
    colors: NDArray[np.float32] = contrast[..., None] * (_LIGHT_TILE - _DARK_TILE)
    colors += (_LIGHT_TILE + _DARK_TILE) / 2
    return colors


def _surface(
    surface: Surface,
    camera: Camera,
    down: NDArray[np.float32],
    distance: NDArray[np.float32],
) -> NDArray[np.float32]:
    """A procedural floor; above the horizon, its mean color goes on."""
    size_px = len(distance)
    far = distance <= 0
    places = [
        (camera.eye_m[axis] + distance * camera.ray_component(axis, size_px)).astype(np.float32)
        for axis in (0, 1)
    ]
    wide = distance * np.float32(camera.width_m(1.0) / size_px)
    footprint = wide / np.sqrt(np.maximum(down, np.float32(1e-6)))
    footprint[far] = PERIOD_M
    return sample(surface, places[0], places[1], footprint)


def shadow(background: Background, shaded: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Share of light that is left on each pixel's floor, shape (size, size, 1), 0..1.

    `shaded` shape (size, size) is where the shadow is; its edge is drawn soft.
    """
    mask = Image.fromarray(shaded.astype(np.uint8) * np.uint8(255))
    soft = mask.filter(ImageFilter.GaussianBlur(len(shaded) / _SOFTNESS))
    left: NDArray[np.float32] = np.asarray(soft, dtype=np.float32)[..., None]
    left = left * np.float32(-TONES[background].shadow / 255.0)
    left += np.float32(1.0)
    return left
