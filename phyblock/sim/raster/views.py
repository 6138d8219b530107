"""Where triangles lie on a screen: that of a camera, and that of a light from far away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phyblock.sim.camera import Camera
from phyblock.sim.exact import cross, dot, turned, unit
from phyblock.sim.raster.solids import Solids

__all__ = ["CameraScreen", "LightScreen", "light_screen"]

Floats = NDArray[np.float64]

_LEAST_DEPTH_M = 1e-3
"""What is nearer to a camera is not drawn, as one cannot project what is behind it."""
_MARGIN_PX = 2


@dataclass(frozen=True, eq=False)
class CameraScreen:
    """The screen of a camera, `size_px` squared; nearness is the inverse of depth [1/m]."""

    camera: Camera
    size_px: int

    @property
    def least(self) -> float:
        """Nearness of the far plane."""
        return 1 / self.camera.far_m

    @property
    def most(self) -> float:
        """Nearness of the near plane, or of what is as near as can be drawn."""
        return 1 / max(self.camera.near_m, _LEAST_DEPTH_M)

    def linear(self, vectors: Floats) -> Floats:
        """Scalar product of vectors (n, 3) with the ray through a pixel's center, as (n, 3).

        The three numbers a, b, c stand for a * column + b * row + c; rays have a depth of 1.
        """
        right, up, forward = turned(vectors, self.camera.axes).T
        step = 2 * self.camera.half_tangent / self.size_px
        middle = (1 - self.size_px) / 2
        across, down = right * step, -up * step
        return np.stack([across, down, (across + down) * middle + forward], axis=1)

    def planes(self, triangles: Solids) -> Floats:
        """Nearness of each triangle's plane, linear over the screen, shape (n, 3)."""
        away = dot(triangles.normals, triangles.anchor_m - self.camera.eye_m)
        return self.linear(triangles.normals / away[:, None])

    def corners_px(self, corners_m: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """Triangles (n, 3, 3) [m] on the screen, shape (k, 3, 2), and whose each of the k is.

        What lies before the nearest depth is cut off, which may leave two of a triangle or none.
        """
        seen = turned(corners_m - self.camera.eye_m, self.camera.axes)
        whole = (seen[..., 2] >= _LEAST_DEPTH_M).all(axis=1)
        owner = np.flatnonzero(whole)
        kept, owners = [seen[whole]], [owner]
        for number in np.flatnonzero(~whole & (seen[..., 2] >= _LEAST_DEPTH_M).any(axis=1)):
            parts = _cut(seen[number])
            kept.append(parts)
            owners.append(np.full(len(parts), number))
        points = np.concatenate(kept)
        middle = self.size_px / 2
        scale = middle / self.camera.half_tangent
        column = points[..., 0] / points[..., 2] * scale + middle
        row = middle - points[..., 1] / points[..., 2] * scale
        return np.stack([column, row], axis=-1), np.concatenate(owners)


@dataclass(frozen=True, eq=False)
class LightScreen:
    """The screen of a far light, `size_px` squared; nearness is the height towards it [m].

    `axes` rows right, up, towards the light (world); a pixel is `pixel_m` wide, and `low_m` (2,)
    is where the first column and row begin [m].
    """

    axes: Floats
    low_m: Floats
    pixel_m: float
    size_px: int

    def planes(self, triangles: Solids) -> Floats:
        """Nearness of each triangle's plane, linear over the screen, shape (n, 3)."""
        right, up, towards = turned(triangles.normals, self.axes).T
        a, b = -right / towards * self.pixel_m, -up / towards * self.pixel_m
        level = dot(triangles.normals, triangles.anchor_m) / towards
        level += (a * self.low_m[0] + b * self.low_m[1]) / self.pixel_m
        return np.stack([a, b, level + (a + b) / 2], axis=1)

    def places(self, points_m: Floats) -> Floats:
        """Column, row and height towards the light of points (..., 3) [m], on the last axis."""
        places = turned(points_m, self.axes)
        places[..., :2] = (places[..., :2] - self.low_m) / self.pixel_m
        return places

    @property
    def steps(self) -> Floats:
        """What `places` changes by for a way of 1 m along x, y and z: rows column, row, height."""
        steps: Floats = self.axes / np.array([[self.pixel_m], [self.pixel_m], [1.0]])
        return steps


def light_screen(direction: Floats, points_m: Floats, size_px: int) -> LightScreen:
    """The screen on which a light from a direction sees all points (n, 3) [m]."""
    beside = np.array([0.0, 0.0, 1.0] if abs(direction[2]) < 0.9 else [1.0, 0.0, 0.0])
    right = unit(cross(beside, direction))
    axes = np.stack([right, cross(direction, right), direction])
    flat = turned(points_m, axes)[..., :2].reshape(-1, 2)
    low, high = flat.min(axis=0), flat.max(axis=0)
    pixel_m = max(float((high - low).max()) / (size_px - 2 * _MARGIN_PX), 1e-6)
    return LightScreen(axes, low - _MARGIN_PX * pixel_m, pixel_m, size_px)


def _cut(corners: Floats) -> Floats:
    """The part of a triangle (3, 3) in front of the camera, as triangles (1 or 2, 3, 3)."""
    polygon: list[Floats] = []
    for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if one[2] >= _LEAST_DEPTH_M:
            polygon.append(one)
        if (one[2] >= _LEAST_DEPTH_M) != (other[2] >= _LEAST_DEPTH_M):
            share = (_LEAST_DEPTH_M - one[2]) / (other[2] - one[2])
            polygon.append(one + share * (other - one))
    return np.array([[polygon[0], polygon[i], polygon[i + 1]] for i in range(1, len(polygon) - 1)])
