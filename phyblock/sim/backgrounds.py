"""Backgrounds: the floor behind the blocks, the shadow on it, and the colors drawn over it.

The floor z = 0 is colored by a ray through every pixel. Wood, concrete and lawn are seamless
textures of integer hashes and filtered noise, kept as mipmaps. A background is a row of `GROUNDS`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFilter

from phyblock.sim.raster import Camera, Rgb
from phyblock.types import BACKGROUNDS, Background

Grid = NDArray[np.float32]  # One number a texel or pixel, shape (n, n).
Colors = NDArray[np.float64]  # Colors of a texture, shape (n, n, 3), about 0..255.

INK_RGB: Rgb = (14, 14, 16)  # Lines between faces of blocks, and round blocks on light floors.
DARK_INK: Rgb = (20, 24, 32)
LIGHT_INK: Rgb = (255, 255, 255)
PERIOD_M = 2.0  # Textures repeat after this in x and y [m].
_SIZE = 2048
_PLANKS = 16
_JOINT_PX = 1.6
_TILE_M = 0.4
_LIGHT_TILE = np.array([39.0, 56.0, 75.0], dtype=np.float32)
_DARK_TILE = np.array([21.0, 37.0, 53.0], dtype=np.float32)
_FADE_FROM_M = np.float32(4.0)
"""Farther tiles blend into their mean color; at the horizon they are finer than a pixel."""
_SOFTNESS = 340  # Pictures are this many times as wide as the blur at the edge of a shadow.


def _wood(pale: tuple[int, int, int], deep: tuple[int, int, int], seed: int) -> Colors:
    """Boards along x, each with its own tone and grain, and thin joints between them."""
    width = _SIZE // _PLANKS
    board = np.arange(_SIZE) // width
    tone = (_hashed(seed, _PLANKS)[board] - 0.5)[:, None]
    shift = (_hashed(seed + 1, _PLANKS)[board] * _SIZE).astype(np.int64)
    columns = (np.arange(_SIZE)[None, :] + shift[:, None]) % _SIZE
    rows = np.arange(_SIZE)[:, None]
    wave = _noise(seed + 2, 2.0, 40.0, (7.0, 1.0))[rows, columns]
    fiber = _noise(seed + 3, 0.6, 900.0, (36.0, 1.0))[rows, columns]
    pore = np.maximum(_noise(seed + 4, 0.0, 700.0, (22.0, 1.0))[rows, columns] - 1.6, 0.0)
    rings = np.sin(2 * math.pi * (rows / width * 2.2 + 0.9 * wave + 3 * tone))
    depth = 0.42 + 0.55 * tone + 0.14 * rings + 0.10 * fiber + 0.22 * pore
    edge = np.minimum(np.arange(_SIZE) % width, width - np.arange(_SIZE) % width)
    joint = np.clip(1 - edge / _JOINT_PX, 0, 1)[:, None]
    colors = np.array(pale) + depth[..., None] * (np.array(deep) - np.array(pale))
    return colors * (1 - 0.55 * joint[..., None])


def _concrete() -> Colors:
    """Gray, with broad clouds, fine grain and a few small pores."""
    clouds, grain = _noise(31, 1.6, 120.0), _noise(32, 0.3, 1000.0)
    pores = np.maximum(_noise(33, 0.0, 160.0) - 2.7, 0.0)
    light = 158 + 7.5 * clouds + 4.5 * grain - 46 * np.minimum(pores, 1.0)
    return light[..., None] * np.array([1.0, 0.995, 0.975])


def _lawn() -> Colors:
    """Blades in many directions, light ones over dark ones, on ground of uneven tone."""
    patches = _noise(41, 1.8, 24.0)
    blades = np.full((_SIZE, _SIZE), -3.0)
    for number in range(6):
        layer = _noise(50 + number, 0.2, 420.0, (5.0, 1.0), math.pi * number / 6)
        blades = np.maximum(blades, layer)
    light = np.clip(0.36 * (blades - 1.2) + 0.07 * patches, -1, 1)[..., None]
    dry = (0.5 + 0.5 * np.tanh(0.8 * _noise(43, 1.4, 60.0)))[..., None]
    green = np.array([70, 104, 42]) + light * np.array([46, 60, 28])
    return green + dry * np.array([9, 2, -3])


def _noise(
    seed: int,
    slope: float,
    finest: float,
    stretch: tuple[float, float] = (1.0, 1.0),
    turn_rad: float = 0.0,
) -> Grid:
    """Seamless noise of mean 0 and deviation 1, shape (size, size)."""
    white = _hashed(seed, _SIZE * _SIZE).reshape(_SIZE, _SIZE) - 0.5
    rows = np.fft.fftfreq(_SIZE, 1 / _SIZE)[:, None]
    columns = np.fft.rfftfreq(_SIZE, 1 / _SIZE)[None, :]
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    along, across = cosine * columns + sine * rows, cosine * rows - sine * columns
    waves = np.hypot(along * stretch[0], across * stretch[1])
    gain = np.maximum(waves, 1.0) ** -slope * np.exp(-((waves / finest) ** 2))
    gain[0, 0] = 0.0
    noise = np.fft.irfft2(np.fft.rfft2(white) * gain, s=(_SIZE, _SIZE))
    return (noise / noise.std()).astype(np.float32)


def _hashed(seed: int, count: int) -> NDArray[np.float64]:
    """Numbers in 0..1 from an integer hash (SplitMix64), shape (count,)."""
    mixed = np.arange(count, dtype=np.uint64) + np.uint64((seed << 40) + 1)
    mixed *= np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        mixed ^= mixed >> np.uint64(shift)
        mixed *= np.uint64(factor)
    mixed ^= mixed >> np.uint64(31)
    return (mixed >> np.uint64(11)) / float(1 << 53)


def _checkerboard(camera: Camera, size_px: int) -> NDArray[np.float32]:
    down, distance = _to_floor(camera, size_px)
    parity = np.zeros(distance.shape, dtype=np.int64)
    for axis in (0, 1):
        hit = camera.eye_m[axis] + distance * camera.ray_component(axis, size_px)
        parity += np.floor(hit / _TILE_M).astype(np.int64)
    contrast = np.where(parity % 2 == 0, np.float32(0.5), np.float32(-0.5))
    contrast *= np.where(down > 1e-6, _FADE_FROM_M / np.maximum(distance, _FADE_FROM_M), 0.0)
    colors: NDArray[np.float32] = contrast[..., None] * (_LIGHT_TILE - _DARK_TILE)
    colors += (_LIGHT_TILE + _DARK_TILE) / 2
    return colors


def _to_floor(camera: Camera, size_px: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """For each pixel the downward part of its ray, and its distance [m], 0 above the horizon."""
    down = -camera.ray_component(2, size_px)
    below = np.where(down > 1e-6, down, np.float32(np.inf))
    distance: NDArray[np.float32] = np.divide(np.float32(camera.eye_m[2]), below)
    return down, distance


@dataclass(frozen=True)
class Ground:
    """A background: the share of light that a shadow removes, 0..1, and colors.

    `ink` colors text, `line` the candidates' grid, `rim` outlines, `paint` or `texture` the floor.
    """

    shadow: float
    ink: Rgb
    line: Rgb
    rim: Rgb
    paint: Callable[[Camera, int], NDArray[np.float32]] | None = None
    texture: Callable[[], Colors] | None = None


_LIGHT_WOOD = functools.partial(_wood, (232, 204, 164), (196, 156, 110), 11)
_DARK_WOOD = functools.partial(_wood, (112, 76, 52), (62, 39, 27), 21)
GROUNDS: dict[Background, Ground] = {
    "white": Ground(
        0.16, DARK_INK, (205, 208, 214), INK_RGB, lambda _, n: np.full((n, n, 3), np.float32(255))
    ),
    "checkerboard": Ground(0.5, LIGHT_INK, (62, 80, 100), (206, 212, 222), _checkerboard),
    "light-wood": Ground(0.3, DARK_INK, (138, 104, 70), INK_RGB, texture=_LIGHT_WOOD),
    "dark-wood": Ground(0.5, LIGHT_INK, (150, 116, 88), (240, 234, 226), texture=_DARK_WOOD),
    "concrete": Ground(0.3, DARK_INK, (98, 98, 96), INK_RGB, texture=_concrete),
    "lawn": Ground(0.48, LIGHT_INK, (158, 180, 120), (250, 253, 244), texture=_lawn),
}


def add_background(name: str, ground: Ground) -> None:
    """Add a background. Raises ValueError if the name is taken."""
    if name in GROUNDS:
        raise ValueError(f"there is a background of this name: {name}")
    GROUNDS[cast(Background, name)] = ground
    BACKGROUNDS.append(cast(Background, name))


def floor(background: Background, camera: Camera, size_px: int) -> NDArray[np.float32]:
    """Color of every pixel's floor, shape (size, size, 3), 0..255, before any shadow."""
    if (paint := GROUNDS[background].paint) is not None:
        return paint(camera, size_px)
    down, distance = _to_floor(camera, size_px)
    x, y = (
        (camera.eye_m[axis] + distance * camera.ray_component(axis, size_px)).astype(np.float32)
        for axis in (0, 1)
    )
    wide = distance * np.float32(camera.width_m(1.0) / size_px)
    footprint: NDArray[np.float32] = np.divide(wide, np.sqrt(np.maximum(down, np.float32(1e-6))))
    footprint[distance <= 0] = PERIOD_M
    maps = surface_map(background)
    texel_m = PERIOD_M / _SIZE
    # The nearest power of two: borders are half way between powers, and need no logarithm.
    borders = np.sqrt(2.0) * texel_m * np.ldexp(1.0, np.arange(len(maps) - 1))
    level = np.searchsorted(borders.astype(np.float32), footprint).astype(np.int8)
    colors = np.empty((*x.shape, 3), dtype=np.float32)
    for number in np.unique(level).tolist():
        chosen, texture, size = level == number, maps[number], len(maps[number])
        across, along = (place[chosen] / PERIOD_M * size - 0.5 for place in (x, y))
        column, row = np.floor(across).astype(np.int64), np.floor(along).astype(np.int64)
        right, lower = (across - column)[:, None], (along - row)[:, None]
        column, row, beside, below = (n % size for n in (column, row, column + 1, row + 1))
        first = texture[row, column] * (1 - right) + texture[row, beside] * right
        second = texture[below, column] * (1 - right) + texture[below, beside] * right
        colors[chosen] = (first * (1 - lower) + second * lower).astype(np.float32)
    return colors


def shadow(background: Background, shaded: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Share of light left on the floor, shape (size, size, 1), 0..1, from the mask `shaded`."""
    mask = Image.fromarray(shaded.astype(np.uint8) * np.uint8(255))
    soft = np.asarray(mask.filter(ImageFilter.GaussianBlur(len(shaded) / _SOFTNESS)), np.float32)
    return soft[..., None] * np.float32(-GROUNDS[background].shadow / 255.0) + np.float32(1.0)


@functools.cache
def surface_map(background: Background) -> tuple[NDArray[np.uint8], ...]:
    """The texture and its repeated halvings, each (n, n, 3), 0..255, rows along y."""
    texture = GROUNDS[background].texture
    assert texture is not None
    maps = [texture().astype(np.float32).clip(0, 255)]
    while (half := len(maps[-1]) // 2) > 0:
        maps.append(maps[-1].reshape(half, 2, half, 2, 3).mean(axis=(1, 3)))
    return tuple(np.rint(one).astype(np.uint8) for one in maps)
