"""The renderer: faces in their colors under one light, with shadows, each by its number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.sim.camera import Camera
from phyblock.sim.exact import cross, dot
from phyblock.sim.raster.scan import NOTHING, nearest, spans
from phyblock.sim.raster.shadows import LightMap, ground_shadow
from phyblock.sim.raster.solids import Solids, solids
from phyblock.sim.raster.views import CameraScreen
from phyblock.sim.renderer import Light, Prop, Raster

__all__ = ["RASTER_VERSION", "NumpyRenderer"]

RASTER_VERSION = "1"
"""Raised whenever the same props give other pixels."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LIGHT_SCREEN = 0.75
"""Side of the light's picture, as a share of the camera's: props fill the former wholly."""


class NumpyRenderer:
    """Draws with plain arithmetic on arrays, which gives the same bytes on every machine."""

    @property
    def name(self) -> str:
        """What it is called in the keys of pictures."""
        return "raster"

    @property
    def versions(self) -> Mapping[str, str]:
        """Its own: no library decides a pixel."""
        return {"raster": RASTER_VERSION}

    def __hash__(self) -> int:
        return hash(self.name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, NumpyRenderer)

    def draw(self, props: Sequence[Prop], camera: Camera, light: Light, size_px: int) -> Raster:
        """Draw closed meshes with one light, `size_px` squared."""
        screen = CameraScreen(camera, size_px)
        rgb = np.zeros((size_px, size_px, 3), dtype=np.uint8)
        if not props:
            nothing = np.full((size_px, size_px), NOTHING)
            return Raster(rgb, nothing, nothing, nothing != NOTHING)
        solid = solids(props)
        front = solid[dot(solid.normals, solid.anchor_m - camera.eye_m) < 0]
        corners_px, owner = screen.corners_px(front.corners_m)
        found = spans(corners_px, size_px)
        found = found._replace(triangle=owner[found.triangle])
        seen = nearest(found, screen.planes(front), size_px, screen.least, screen.most)
        row, column = np.nonzero(seen.triangle != NOTHING)
        shown, depth_m = seen.triangle[row, column], 1 / seen.nearness[row, column]
        pixels = _Pixels(column.astype(np.float64), row.astype(np.float64), depth_m)
        bright = _facing(front, light.direction, screen, shown, pixels)
        if light.diffuse:
            _take_shadow(
                bright,
                LightMap(solid, light.direction, round(size_px * _LIGHT_SCREEN)),
                screen,
                pixels,
            )
        bright = light.ambient + light.diffuse * bright
        colors = np.array([prop.rgb for prop in props], dtype=np.float64)[front.prop[shown]]
        rgb[row, column] = np.rint(np.clip(colors * bright[:, None], 0, 255))
        return Raster(
            rgb,
            np.append(front.prop, NOTHING)[seen.triangle],
            np.append(front.face, NOTHING)[seen.triangle],
            ground_shadow(solid, light.direction, screen),
        )


class _Pixels(NamedTuple):
    """Pixels that show something, each (n,): column, row, and the depth of what they show [m]."""

    column: Floats
    row: Floats
    depth_m: Floats

    def some(self, chosen: Ints) -> _Pixels:
        return _Pixels(self.column[chosen], self.row[chosen], self.depth_m[chosen])

    def linear(self, start: Floats, slope: Floats) -> Floats:
        """The sum start + depth * (a * column + b * row + c) for `slope` (3,) or (3, n)."""
        a, b, c = slope
        total: Floats = (a * self.column + (b * self.row + c)) * self.depth_m
        total += start
        return total


def _take_shadow(bright: Floats, light: LightMap, screen: CameraScreen, pixels: _Pixels) -> None:
    """Take away from `bright` (n,) what does not reach the pixels for what stands in the way."""
    to_light = np.flatnonzero(bright > 0)
    if len(to_light):
        lit = pixels.some(to_light)
        starts = light.screen.places(screen.camera.eye_m)
        slopes = screen.linear(light.screen.steps)
        places = [lit.linear(start, slope) for start, slope in zip(starts, slopes, strict=True)]
        bright[to_light] *= light.lit(*places)


def _facing(
    front: Solids, direction: Floats, screen: CameraScreen, shown: Ints, pixels: _Pixels
) -> Floats:
    """How much what pixels show is turned to the light, 0..1, by the triangles shown (n,).

    The cosine at the corners, and linear between them: its gradient follows from its corners.
    """
    values = dot(front.bends, direction)
    facing: Floats = values[shown, 0]
    curved = np.flatnonzero(np.ptp(values, axis=1)[shown])
    one, two = (front.corners_m[:, i] - front.corners_m[:, 0] for i in (1, 2))
    normal = cross(one, two)
    rise_one, rise_two = (values[:, i, None] - values[:, :1] for i in (1, 2))
    gradient = rise_one * cross(two, normal) + rise_two * cross(normal, one)
    gradient /= dot(normal, normal)[:, None]
    start = values[:, 0] + dot(gradient, screen.camera.eye_m - front.corners_m[:, 0])
    bent = shown[curved]
    slope = screen.linear(gradient).T[:, bent]
    facing[curved] = pixels.some(curved).linear(start[bent], slope)
    np.maximum(facing, 0.0, out=facing)
    return facing
