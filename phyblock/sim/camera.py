"""Cameras: views by name or angle, and framing that cuts nothing off.

For the axes of a view, "every point lies inside this window of the picture" is a set of linear
inequalities in the camera's position, so the closest camera that sees everything is a closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.sim.geometry import dot, rounded, turned
from phyblock.types import View


def _half_tangent(angle_deg: float) -> float:
    return round(math.tan(math.radians(angle_deg / 2)), 12)


FIELD_OF_VIEW_DEG = 30.0  # Vertical and horizontal field of view; pictures are square.
_HALF_TANGENT = _half_tangent(FIELD_OF_VIEW_DEG)
_DEPTH_MARGIN_M = 0.02
_NEARER = 0.9
_LEAST_DEPTH_M = 0.05  # Least distance from the camera of points that are drawn but not framed.

VIEWS: dict[View, tuple[float, float]] = {
    "oblique": (45.0, 22.0),
    "front": (0.0, 18.0),
    "side": (90.0, 18.0),
    "top": (0.0, 90.0),
}
"""Azimuth (0 looks from +x, 90 from +y) and elevation of the named views [degrees]."""


class Window(NamedTuple):
    """Part of a picture in normalized coordinates: -1..1 from left to right, bottom to top."""

    left: float
    right: float
    bottom: float
    top: float

    def scaled(self, factor: float) -> Window:
        """The window shrunk or grown about its center."""
        x, y = (self.left + self.right) / 2, (self.bottom + self.top) / 2
        half_x, half_y = (self.right - self.left) / 2, (self.top - self.bottom) / 2
        half_x, half_y = half_x * factor, half_y * factor
        return Window(x - half_x, x + half_x, y - half_y, y + half_y)


@dataclass(frozen=True, eq=False)
class Camera:
    """A perspective camera at `eye_m` (3,) [m]; `axes` rows right, up, forward (world)."""

    eye_m: NDArray[np.float64]
    axes: NDArray[np.float64]
    near_m: float
    far_m: float
    field_of_view_deg: float = FIELD_OF_VIEW_DEG

    @property
    def half_tangent(self) -> float:
        """Half the visible width at a depth, as a share of that depth."""
        return _half_tangent(self.field_of_view_deg)

    def project(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Normalized picture coordinates of world points (n, 3), shape (n, 2)."""
        right, up, depth = turned(points_m - self.eye_m, self.axes).T
        seen: NDArray[np.float64] = np.stack([right, up], axis=1) / depth[:, None]
        seen /= self.half_tangent
        return seen

    def to_pixels(self, points_m: NDArray[np.float64], size_px: int) -> NDArray[np.float64]:
        """Pixel coordinates (column, row), row 0 on top, of world points (n, 3), shape (n, 2)."""
        return (self.project(points_m) * [1.0, -1.0] + 1.0) * (size_px / 2)

    def ray_component(self, axis: int, size_px: int) -> NDArray[np.float32]:
        """One world component of the ray of unit depth through each pixel, (size, size)."""
        steps = ((np.arange(size_px) + 0.5) / size_px * 2 - 1) * self.half_tangent
        right, up, forward = self.axes[:, axis]
        across, down = steps * right + forward, steps * up
        return np.subtract.outer(-down, -across).astype(np.float32)

    def width_m(self, depth_m: float) -> float:
        """Visible width at a depth [m]."""
        return 2 * depth_m * self.half_tangent


def view_axes(azimuth_deg: float, elevation_deg: float) -> NDArray[np.float64]:
    """Right, up and forward of a view from that direction, rows of a (3, 3) array."""
    azimuth, elevation = math.radians(azimuth_deg), math.radians(elevation_deg)
    flat = math.cos(elevation)
    towards = np.array([flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)])
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    return rounded(np.stack([right, np.cross(towards, right), -towards]))


def frame(
    points_m: NDArray[np.float64],
    axes: NDArray[np.float64],
    window: Window,
    min_distance_m: float = 0.0,
    drawn_m: NDArray[np.float64] | None = None,
) -> Camera:
    """The closest camera with these axes that sees all points (n, 3), one at least, in the window.

    It stays at least `min_distance_m` [m] from the nearest. `drawn_m` (k, 3) are all drawn points,
    if they are more: they may lie outside of the window, but between the camera's planes.
    """
    right, up, forward = turned(points_m, axes).T
    spans = []
    for across, low, high in ((right, window.left, window.right), (up, window.bottom, window.top)):
        low_slope, high_slope = low * _HALF_TANGENT, high * _HALF_TANGENT
        most = float(np.max(across - high_slope * forward))
        least = float(np.min(across - low_slope * forward))
        spans.append((most, least, low_slope, high_slope))
    limits = [(least - most) / (high - low) for most, least, low, high in spans]
    depth = min(*limits, float(forward.min()) - min_distance_m)
    if drawn_m is not None and len(drawn_m):
        forward = np.append(forward, dot(drawn_m, axes[2]))
        depth = min(depth, float(forward.min()) - _LEAST_DEPTH_M)
    center = [(most + least + (high + low) * depth) / 2 for most, least, low, high in spans]
    eye = rounded(turned(np.array([*center, depth]), axes.T))
    near_m, far_m = float(forward.min()) - depth, float(forward.max()) - depth
    return Camera(eye, axes, near_m * _NEARER, far_m + _DEPTH_MARGIN_M)
