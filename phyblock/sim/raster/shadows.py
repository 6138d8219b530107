"""Shadows: of props on props by a picture from the light, of props on the ground by projection.

The picture from the light shows, for each of its pixels, the face nearest to the light of those
that look away from it: where light leaves a solid. A point is in shadow when it lies behind that
face's plane. Faces that look to the light never shade themselves this way, so that no bias is
needed, and shadows touch what casts them (second-depth shadow mapping: Wang and Molnar 1994).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phyblock.sim.exact import dot
from phyblock.sim.raster.scan import covered, nearest, spans
from phyblock.sim.raster.solids import Solids
from phyblock.sim.raster.views import CameraScreen, light_screen

__all__ = ["LightMap", "ground_shadow"]

Floats = NDArray[np.float64]

_AWAY = -1e-6
_TOUCHING_M = 5e-5
"""What lies this little behind a face is at it: blocks at rest overlap by less [m]."""
_TAPS = ((0, 0), (1, 0), (0, 1), (1, 1))


class LightMap:
    """The picture from the light, `size_px` squared, of all triangles."""

    def __init__(self, solid: Solids, direction: Floats, size_px: int) -> None:
        self.screen = light_screen(direction, solid.corners_m, size_px)
        backs = solid[dot(solid.normals, direction) < _AWAY]
        planes = self.screen.planes(backs)
        covering = spans(self.screen.places(backs.corners_m)[..., :2], size_px)
        shown = nearest(covering, planes, size_px, -np.inf, np.inf).triangle
        alike = np.ones(shown.shape, dtype=np.bool_)
        alike[:-1, :-1] = shown[:-1, :-1] == shown[1:, 1:]
        alike[:-1, :-1] &= (shown[:-1, :-1] == shown[:-1, 1:]) & (shown[:-1, :-1] == shown[1:, :-1])
        self._size_px = size_px
        self._shown, self._alike = shown.ravel(), alike.ravel()
        # Where nothing is seen, nothing shades.
        self._planes = np.vstack([planes, [0.0, 0.0, -np.inf]]).T.copy()

    def lit(self, column: Floats, row: Floats, height: Floats) -> Floats:
        """How much of the light points of a surface get, 0..1, by their places on the screen.

        The four pixels round a point count by how near they are to it.
        """
        column, row = column - 0.5, row - 0.5
        left, top = np.floor(column), np.floor(row)
        pixel = (top * self._size_px + left).astype(np.int64)
        lit = self._is_before(pixel, column, row, height).astype(np.float64)
        mixed = np.flatnonzero(~self._alike[pixel])
        pixel, column, row, height = pixel[mixed], column[mixed], row[mixed], height[mixed]
        across, down = column - left[mixed], row - top[mixed]
        share = np.zeros(len(mixed))
        for right, below in _TAPS:
            tap = pixel + (below * self._size_px + right)
            weight = (across if right else 1 - across) * (down if below else 1 - down)
            share += weight * self._is_before(tap, column, row, height)
        lit[mixed] = share
        return lit

    def _is_before(
        self, pixel: NDArray[np.int64], column: Floats, row: Floats, height: Floats
    ) -> NDArray[np.bool_]:
        """Whether points lie on the light's side of the face that each pixel shows."""
        a, b, c = self._planes
        shown = self._shown[pixel]
        before: NDArray[np.bool_] = height + _TOUCHING_M > a[shown] * column + (
            b[shown] * row + c[shown]
        )
        return before


def ground_shadow(solid: Solids, direction: Floats, screen: CameraScreen) -> NDArray[np.bool_]:
    """Where the ground z = 0 lies in shadow, shape (size, size), whatever stands before it."""
    if direction[2] <= 0:
        return np.zeros((screen.size_px, screen.size_px), dtype=np.bool_)
    backs = solid.corners_m[dot(solid.normals, direction) < _AWAY]
    fallen = backs - backs[..., 2:] * (direction / direction[2])
    corners_px, _ = screen.corners_px(fallen)
    return covered(spans(corners_px, screen.size_px), screen.size_px)
