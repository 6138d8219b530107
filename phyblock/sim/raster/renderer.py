"""The renderer: faces in their colors under one light, with shadows, each by its number."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.sim.camera import Camera
from phyblock.sim.exact import cross, dot
from phyblock.sim.raster.scan import AT_ONCE, NOTHING, nearest, spans
from phyblock.sim.raster.shadows import LightMap, ground_shadow
from phyblock.sim.raster.solids import Solids, solids
from phyblock.sim.raster.views import CameraScreen
from phyblock.sim.renderer import Light, Prop, Raster

__all__ = ["RASTER_VERSION", "NumpyRenderer"]

RASTER_VERSION = "1"
"""Raised whenever the same props give other pixels."""

Floats = NDArray[np.float64]

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
        covering = spans(corners_px, size_px)
        covering = covering._replace(triangle=owner[covering.triangle])
        seen = nearest(covering, screen.planes(front), size_px, screen.least, screen.most)
        look = _Look(props, solid, front, screen, light)
        prop, face = (np.full((size_px, size_px), NOTHING) for _ in range(2))
        pixels = np.flatnonzero(seen.triangle != NOTHING)
        for start in range(0, len(pixels), AT_ONCE):
            part = pixels[start : start + AT_ONCE]
            shown = seen.triangle.ravel()[part]
            row, column = np.divmod(part, size_px)
            points = _Points(column * 1.0, row * 1.0, 1 / seen.nearness.ravel()[part])
            rgb.reshape(-1, 3)[part] = look.colors(shown, points)
            prop.ravel()[part], face.ravel()[part] = front.prop[shown], front.face[shown]
        return Raster(rgb, prop, face, ground_shadow(solid, light.direction, screen))


class _Points(NamedTuple):
    """What pixels show, each (n,): their column and row, and its depth [m]."""

    column: Floats
    row: Floats
    depth_m: Floats

    def some(self, chosen: NDArray[np.int64]) -> _Points:
        return _Points(self.column[chosen], self.row[chosen], self.depth_m[chosen])

    def linear(self, start: Floats, slope: Floats) -> Floats:
        """The sum start + depth * (a * column + b * row + c) for `slope` (3,) or (3, n)."""
        a, b, c = slope
        total: Floats = (a * self.column + (b * self.row + c)) * self.depth_m
        total += start
        return total


class _Look:
    """How the triangles in `front` of a camera look in a light that all of `solid` shades."""

    def __init__(
        self,
        props: Sequence[Prop],
        solid: Solids,
        front: Solids,
        screen: CameraScreen,
        light: Light,
    ) -> None:
        self._rgb = np.array([prop.rgb for prop in props], dtype=np.float64)[front.prop]
        self._light, self._map = light, None
        # The cosine to the light is known at corners, and linear between them.
        cosines = dot(front.bends, light.direction)
        gradient = _gradient(front.corners_m, cosines)
        self._is_bent = np.ptp(cosines, axis=1) > 0
        self._cosine = cosines[:, 0]
        self._start = cosines[:, 0]
        self._start = self._start + dot(gradient, screen.camera.eye_m - front.corners_m[:, 0])
        self._slope = screen.linear(gradient).T
        if light.diffuse:
            self._map = LightMap(solid, light.direction, round(screen.size_px * _LIGHT_SCREEN))
            steps = screen.linear(self._map.screen.steps)
            eye = self._map.screen.places(screen.camera.eye_m)
            self._map_places = list(zip(eye, steps, strict=True))

    def colors(self, shown: NDArray[np.int32], points: _Points) -> Floats:
        """Color of each point by the triangle that it is of, shape (n, 3), 0..255, whole."""
        bright = self._cosine[shown]
        bent = np.flatnonzero(self._is_bent[shown])
        which = shown[bent]
        bright[bent] = points.some(bent).linear(self._start[which], self._slope[:, which])
        to_light = np.flatnonzero(bright > 0)
        if self._map is not None:
            lit = points.some(to_light)
            places = [lit.linear(start, slope) for start, slope in self._map_places]
            bright[to_light] *= self._map.lit(*places)
        np.maximum(bright, 0.0, out=bright)
        bright *= self._light.diffuse
        bright += self._light.ambient
        colors: Floats = self._rgb[shown]
        colors *= bright[:, None]
        np.minimum(colors, 255.0, out=colors)
        return np.rint(colors, out=colors)


def _gradient(corners_m: Floats, values: Floats) -> Floats:
    """Gradient (n, 3) in its plane of what has these values (n, 3) at a triangle's corners."""
    one, two = (corners_m[:, i] - corners_m[:, 0] for i in (1, 2))
    normal = cross(one, two)
    rise_one, rise_two = (values[:, i, None] - values[:, :1] for i in (1, 2))
    gradient = rise_one * cross(two, normal) + rise_two * cross(normal, one)
    gradient /= dot(normal, normal)[:, None]
    return gradient
