"""Cameras, and the rasterizer: triangles to pixels in numpy, the same bytes on every machine.

All triangles are scanned at once: each row of pixels that one crosses is a span. The nearest one of
a pixel is found by a number that is linear over the screen (inverse depth, or height to a light).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import quat_xyzw_to_matrix
from phyblock.sim.engine import Pose
from phyblock.sim.geometry import Mesh, cross, dot, rounded, turned, unit
from phyblock.types import View

RASTER_VERSION = "1"  # Increased whenever the same props give other pixels.
NOTHING = -1  # The triangle of a pixel that shows none.

Rgb = tuple[int, int, int]  # Red, green and blue, 0..255.
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

FIELD_OF_VIEW_DEG = 30.0  # Vertical and horizontal field of view; pictures are square.
HALF_TANGENT = round(math.tan(math.radians(FIELD_OF_VIEW_DEG / 2)), 12)
"""Half the visible width at a depth, as a share of that depth."""
_DEPTH_MARGIN_M = 0.02
_NEARER = 0.9
_LEAST_DRAWN_M = 0.05  # Least distance from the camera of points that are drawn but not framed.

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


@dataclass(frozen=True, eq=False)
class Camera:
    """A perspective camera at `eye_m` (3,) [m]; `axes` rows right, up, forward (world)."""

    eye_m: NDArray[np.float64]
    axes: NDArray[np.float64]
    near_m: float
    far_m: float

    def project(self, points_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Normalized picture coordinates of world points (n, 3), shape (n, 2)."""
        right, up, depth = turned(points_m - self.eye_m, self.axes).T
        seen: NDArray[np.float64] = np.stack([right, up], axis=1) / depth[:, None]
        seen /= HALF_TANGENT
        return seen

    def to_pixels(self, points_m: NDArray[np.float64], size_px: int) -> NDArray[np.float64]:
        """Pixel coordinates (column, row), row 0 on top, of world points (n, 3), shape (n, 2)."""
        return (self.project(points_m) * [1.0, -1.0] + 1.0) * (size_px / 2)

    def ray_component(self, axis: int, size_px: int) -> NDArray[np.float32]:
        """One world component of the ray of unit depth through each pixel, (size, size)."""
        steps = ((np.arange(size_px) + 0.5) / size_px * 2 - 1) * HALF_TANGENT
        right, up, forward = self.axes[:, axis]
        across, down = steps * right + forward, steps * up
        return np.subtract.outer(-down, -across).astype(np.float32)

    def width_m(self, depth_m: float) -> float:
        """Visible width at a depth [m]."""
        return 2 * depth_m * HALF_TANGENT


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

    For given axes, "every point lies inside this window" means linear inequalities in the camera's
    position, so the closest camera is a closed form. It is `min_distance_m` [m] or more from every
    point. `drawn_m` (k, 3) are more points to be between its planes, also outside of the window.
    """
    right, up, forward = turned(points_m, axes).T
    spans = []
    for across, low, high in ((right, window.left, window.right), (up, window.bottom, window.top)):
        low_slope, high_slope = low * HALF_TANGENT, high * HALF_TANGENT
        most = float(np.max(across - high_slope * forward))
        least = float(np.min(across - low_slope * forward))
        spans.append((most, least, low_slope, high_slope))
    limits = [(least - most) / (high - low) for most, least, low, high in spans]
    depth = min(*limits, float(forward.min()) - min_distance_m)
    if drawn_m is not None and len(drawn_m):
        forward = np.append(forward, dot(drawn_m, axes[2]))
        depth = min(depth, float(forward.min()) - _LEAST_DRAWN_M)
    center = [(most + least + (high + low) * depth) / 2 for most, least, low, high in spans]
    eye = rounded(turned(np.array([*center, depth]), axes.T))
    near_m, far_m = float(forward.min()) - depth, float(forward.max()) - depth
    return Camera(eye, axes, near_m * _NEARER, far_m + _DEPTH_MARGIN_M)


_AT_ONCE = 1 << 16  # Pixels that are processed together, so that their memory is reused.
_FLAT = 1e-9  # Unit normals that differ by less in each component belong to one plane.
_LEAST_DEPTH_M = 1e-3
"""Faces nearer to a camera are not drawn, since points behind it cannot be projected."""
_LIGHT_SCREEN = 0.75
"""Side of the light's picture, as a share of the camera's; props fill all of it."""
_MARGIN_PX = 2
_AWAY = -1e-6
_TOUCHING_M = 5e-5  # A point this close behind a face is on it: blocks at rest overlap by less [m].
_TAPS = ((0, 0), (1, 0), (0, 1), (1, 1))


@dataclass(frozen=True, eq=False)
class Prop:
    """A mesh in one color at a pose."""

    mesh: Mesh
    rgb: Rgb
    pose: Pose


@dataclass(frozen=True, eq=False)
class Light:
    """A distant light: `direction` (3,) is the unit vector to it, in the world.

    A face in the light has its color times ambient + diffuse * max(0, normal . direction).
    """

    direction: Floats
    ambient: float
    diffuse: float


@dataclass(frozen=True, eq=False)
class Raster:
    """A drawing: `rgb` shape (size, size, 3), 0..255, row 0 on top; the others (size, size).

    `prop` is the prop in each pixel, or -1, `face` its face; `shaded` is true for
    ground in shadow.
    """

    rgb: NDArray[np.uint8]
    prop: Ints
    face: Ints
    shaded: Bools


def draw(props: Sequence[Prop], camera: Camera, light: Light, size_px: int) -> Raster:
    """Draw closed meshes between the camera's near and far planes, `size_px` squared."""
    screen = _CameraScreen(camera, size_px)
    rgb = np.zeros((size_px, size_px, 3), dtype=np.uint8)
    if not props:
        nothing = np.full((size_px, size_px), NOTHING)
        return Raster(rgb, nothing, nothing, nothing != NOTHING)
    solid = _solids(props)
    away = dot(solid.normals, solid.anchor_m - camera.eye_m)
    front = solid[away < 0]
    planes = screen.linear(front.normals / away[away < 0][:, None])
    corners_px, owner = screen.corners_px(front.corners_m)
    covering = _spans(corners_px, size_px)
    covering = covering._replace(triangle=owner[covering.triangle])
    # From the far plane to the near one, or to the nearest depth that can be drawn.
    ends = 1 / camera.far_m, 1 / max(camera.near_m, _LEAST_DEPTH_M)
    triangle, nearness = _nearest(covering, planes, size_px, *ends)
    prop, face = (np.full((size_px, size_px), NOTHING) for _ in range(2))
    pixels = np.flatnonzero(triangle != NOTHING)
    shown = triangle.ravel()[pixels]
    prop.ravel()[pixels], face.ravel()[pixels] = front.prop[shown], front.face[shown]
    bright = _brightness(solid, front, screen, light)
    colors = np.array([one.rgb for one in props], dtype=np.float64)[front.prop]
    for start in range(0, len(pixels), _AT_ONCE):
        part, which = pixels[start : start + _AT_ONCE], shown[start : start + _AT_ONCE]
        row, column = np.divmod(part, size_px)
        share = bright(which, column * 1.0, row * 1.0, 1 / nearness.ravel()[part])
        rgb.reshape(-1, 3)[part] = np.rint(np.minimum(colors[which] * share[:, None], 255.0))
    return Raster(rgb, prop, face, _ground_shadow(solid, light.direction, screen))


@dataclass(frozen=True, eq=False)
class _Solids:
    """Triangles of all props in the world, n of them, with their unit normals.

    `anchor_m` (n, 3) [m] is the same for all triangles of a flat face; `bends` (n, 3, 3) are the
    normals of the surface at corners; `prop` and `face` (n,) the prop's place and the face in it.
    """

    corners_m: Floats
    anchor_m: Floats
    normals: Floats
    bends: Floats
    prop: Ints
    face: Ints

    def __getitem__(self, chosen: Bools) -> _Solids:
        """Some of the triangles."""
        return _Solids(*(getattr(self, field.name)[chosen] for field in fields(self)))


def _solids(props: Sequence[Prop]) -> _Solids:
    """The triangles of at least one prop."""

    def name(place: int) -> tuple[object, ...]:
        prop = props[place]
        pose, vertices = prop.pose, prop.mesh.vertices_m.ravel()
        return (pose.position_m.tolist(), pose.quat_xyzw.tolist(), prop.rgb, vertices.tolist())

    parts = []
    for place in sorted(range(len(props)), key=name):
        mesh, pose = props[place].mesh, props[place].pose
        matrix = rounded(quat_xyzw_to_matrix(pose.quat_xyzw))
        corners_m = turned(mesh.corners_m, matrix) + pose.position_m
        apart = np.abs(mesh.normals - mesh.normals[mesh.faces]).max(axis=1)
        anchors = np.where(apart < _FLAT, mesh.faces, np.arange(len(corners_m)))
        normals, bends = turned(mesh.normals, matrix), turned(mesh.corner_normals, matrix)
        numbers = np.full(len(corners_m), place)
        parts.append((corners_m, corners_m[anchors, 0], normals, bends, numbers, mesh.faces))
    return _Solids(*(np.concatenate(column) for column in zip(*parts, strict=True)))


@dataclass(frozen=True, eq=False)
class _CameraScreen:
    """The screen of a camera, `size_px` squared; nearness is the inverse of depth [1/m]."""

    camera: Camera
    size_px: int

    def linear(self, vectors: Floats) -> Floats:
        """Scalar product of vectors (n, 3) with the ray through a pixel's center, as (n, 3)."""
        right, up, forward = turned(vectors, self.camera.axes).T
        step = 2 * HALF_TANGENT / self.size_px
        middle = (1 - self.size_px) / 2
        across, down = right * step, -up * step
        return np.stack([across, down, (across + down) * middle + forward], axis=1)

    def corners_px(self, corners_m: Floats) -> tuple[Floats, Ints]:
        """Triangles (n, 3, 3) [m] cut at the least depth, on screen (k, 3, 2), and their owners."""
        seen = turned(corners_m - self.camera.eye_m, self.camera.axes)
        whole = (seen[..., 2] >= _LEAST_DEPTH_M).all(axis=1)
        kept, owners = [seen[whole]], [np.flatnonzero(whole)]
        for number in np.flatnonzero(~whole & (seen[..., 2] >= _LEAST_DEPTH_M).any(axis=1)):
            kept.append(parts := _cut(seen[number]))
            owners.append(np.full(len(parts), number))
        points = np.concatenate(kept)
        middle = self.size_px / 2
        scale = middle / HALF_TANGENT
        column = points[..., 0] / points[..., 2] * scale + middle
        row = middle - points[..., 1] / points[..., 2] * scale
        return np.stack([column, row], axis=-1), np.concatenate(owners)


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


class _Spans(NamedTuple):
    """Runs of pixels: their triangle, their row, the first column and the one after the last."""

    triangle: Ints
    row: Ints
    left: Ints
    right: Ints


def _spans(corners_px: Floats, size_px: int) -> _Spans:
    """The spans of triangles with corners (n, 3, 2), column and row, on a screen `size_px` wide."""

    def from_center(place: Floats) -> Ints:
        """The first pixel whose center is not before a place, within the screen."""
        return np.ceil(np.clip(place, 0.0, size_px) - 0.5).astype(np.int64)

    # Crossings depend only on an edge's ends, in one order: each pixel is in exactly one triangle.
    order = np.argsort(corners_px[..., 1], axis=1, kind="stable")
    x, y = np.moveaxis(np.take_along_axis(corners_px, order[..., None], axis=1), -1, 0)
    first, end = (from_center(y[:, i]) for i in (0, 2))
    heights = np.maximum(end - first, 0)
    triangle = np.repeat(np.arange(len(x)), heights)
    row = np.arange(len(triangle)) - np.repeat(np.cumsum(heights) - heights - first, heights)
    x, y, center = x[triangle], y[triangle], row + 0.5

    def crossing(start: int, end: int) -> Floats:
        """Crossing of the edge between two corners with a row's center; arbitrary if level."""
        rise = y[:, end] - y[:, start]
        slope = (x[:, end] - x[:, start]) / np.where(rise > 0, rise, 1.0)
        return x[:, start] + (center - y[:, start]) * slope

    long = crossing(0, 2)
    short = np.where(center < y[:, 1], crossing(0, 1), crossing(1, 2))
    left, right = from_center(np.minimum(long, short)), from_center(np.maximum(long, short))
    some = right > left
    return _Spans(triangle[some], row[some], left[some], right[some])


def _nearest(
    covering: _Spans, planes: Floats, size_px: int, least: float, most: float
) -> tuple[NDArray[np.int32], Floats]:
    """The nearest triangle of each pixel, or `NOTHING`, and its nearness there, (size, size)."""
    best = np.full(size_px * size_px, least)
    shown = np.full(size_px * size_px, NOTHING, dtype=np.int32)
    ends = np.cumsum(covering.right - covering.left)
    cuts = np.flatnonzero(np.diff(ends // _AT_ONCE)) + 1
    for group in np.split(np.arange(len(ends)), cuts):
        part = _Spans(*(column[group] for column in covering))
        lengths = part.right - part.left
        a, b, c = planes.T[:, part.triangle]
        start = np.cumsum(lengths) - lengths
        column = np.arange(int(lengths.sum())) - np.repeat(start - part.left, lengths)
        pixel = column + np.repeat(part.row * size_px, lengths)
        nearness = np.repeat(a, lengths) * column
        nearness += np.repeat(b * part.row + c, lengths)
        if nearness.max(initial=-np.inf) > most:
            nearness[nearness > most] = -np.inf
        np.maximum.at(best, pixel, nearness)
        seen = nearness == best[pixel]
        shown[pixel[seen]] = np.repeat(part.triangle, lengths)[seen]
    return shown.reshape(size_px, size_px), best.reshape(size_px, size_px)


def _brightness(
    solid: _Solids, front: _Solids, screen: _CameraScreen, light: Light
) -> Callable[[NDArray[np.int32], Floats, Floats, Floats], Floats]:
    """A function from points of triangles in `front` of a camera to the share of their color.

    It takes triangle, column, row and depth [m] of visible points, (n,); `solid` shades them.
    """
    # The cosine to the light is computed at corners, and interpolated between them.
    cosines = dot(front.bends, light.direction)
    one, two = (front.corners_m[:, i] - front.corners_m[:, 0] for i in (1, 2))
    normal = cross(one, two)
    rise_one, rise_two = (cosines[:, i, None] - cosines[:, :1] for i in (1, 2))
    gradient = rise_one * cross(two, normal) + rise_two * cross(normal, one)
    gradient /= dot(normal, normal)[:, None]
    is_bent, eye_m = np.ptp(cosines, axis=1) > 0, screen.camera.eye_m
    start = cosines[:, 0] + dot(gradient, eye_m - front.corners_m[:, 0])
    slope = screen.linear(gradient).T
    if light.diffuse:
        shadows = _LightMap(solid, light.direction, round(screen.size_px * _LIGHT_SCREEN))
        ways = list(zip(shadows.places(eye_m), screen.linear(shadows.steps), strict=True))

    def bright(shown: NDArray[np.int32], column: Floats, row: Floats, depth_m: Floats) -> Floats:
        def linear(chosen: Ints, start: Floats, slope: Floats) -> Floats:
            """The sum start + depth * (a * column + b * row + c) for `slope` (3,) or (3, n)."""
            a, b, c = slope
            return (a * column[chosen] + (b * row[chosen] + c)) * depth_m[chosen] + start

        share: Floats = cosines[:, 0][shown]
        bent = np.flatnonzero(is_bent[shown])
        share[bent] = linear(bent, start[shown[bent]], slope[:, shown[bent]])
        if light.diffuse:
            to_light = np.flatnonzero(share > 0)
            share[to_light] *= shadows.lit(*(linear(to_light, *way) for way in ways))
        return np.maximum(share, 0.0) * light.diffuse + light.ambient

    return bright


class _LightMap:
    """The picture from the light, `size_px` squared: shadows of props on props.

    It stores the face nearest to the light among those that face away from it: points behind its
    plane are in shadow. So lit faces never shade themselves, and no bias is needed (second-depth
    shadow mapping: Wang and Molnar 1994). Nearness is the height towards the light [m].
    """

    def __init__(self, solid: _Solids, direction: Floats, size_px: int) -> None:
        beside = np.array([0.0, 0.0, 1.0] if abs(direction[2]) < 0.9 else [1.0, 0.0, 0.0])
        right = unit(cross(beside, direction))
        self._axes = np.stack([right, cross(direction, right), direction])
        flat = turned(solid.corners_m, self._axes)[..., :2].reshape(-1, 2)
        low, high = flat.min(axis=0), flat.max(axis=0)
        self._pixel_m = max(float((high - low).max()) / (size_px - 2 * _MARGIN_PX), 1e-6)
        self._low_m = low - _MARGIN_PX * self._pixel_m
        self._size_px = size_px
        backs = solid[dot(solid.normals, direction) < _AWAY]
        # Nearness of each triangle's plane, linear over the screen.
        right, up, towards = turned(backs.normals, self._axes).T
        a, b = -right / towards * self._pixel_m, -up / towards * self._pixel_m
        level = dot(backs.normals, backs.anchor_m) / towards
        level += (a * self._low_m[0] + b * self._low_m[1]) / self._pixel_m
        planes = np.stack([a, b, level + (a + b) / 2], axis=1)
        covering = _spans(self.places(backs.corners_m)[..., :2], size_px)
        shown, _ = _nearest(covering, planes, size_px, -np.inf, np.inf)
        same = np.ones(shown.shape, dtype=np.bool_)
        same[:-1, :-1] = shown[:-1, :-1] == shown[1:, 1:]
        same[:-1, :-1] &= (shown[:-1, :-1] == shown[:-1, 1:]) & (shown[:-1, :-1] == shown[1:, :-1])
        self._shown, self._same = shown.ravel(), same.ravel()
        # Empty pixels cast no shadow.
        self._planes = np.vstack([planes, [0.0, 0.0, -np.inf]]).T.copy()

    def places(self, points_m: Floats) -> Floats:
        """Column, row and height towards the light of points (..., 3) [m], on the last axis."""
        places = turned(points_m, self._axes)
        places[..., :2] = (places[..., :2] - self._low_m) / self._pixel_m
        return places

    @property
    def steps(self) -> Floats:
        """Change of `places` per 1 m along x, y and z: rows column, row, height."""
        return self._axes / np.array([[self._pixel_m], [self._pixel_m], [1.0]])

    def lit(self, column: Floats, row: Floats, height: Floats) -> Floats:
        """The share of light on points of a surface, 0..1, by their places."""
        column, row = column - 0.5, row - 0.5
        left, top = np.floor(column), np.floor(row)
        pixel = (top * self._size_px + left).astype(np.int64)
        lit = self._is_before(pixel, column, row, height).astype(np.float64)
        mixed = np.flatnonzero(~self._same[pixel])
        pixel, column, row, height = pixel[mixed], column[mixed], row[mixed], height[mixed]
        across, down = column - left[mixed], row - top[mixed]
        share = np.zeros(len(mixed))
        for right, below in _TAPS:
            tap = pixel + (below * self._size_px + right)
            weight = (across if right else 1 - across) * (down if below else 1 - down)
            share += weight * self._is_before(tap, column, row, height)
        lit[mixed] = share
        return lit

    def _is_before(self, pixel: Ints, column: Floats, row: Floats, height: Floats) -> Bools:
        """True for points on the light's side of the face in their pixel."""
        a, b, c = self._planes
        shown = self._shown[pixel]
        return height + _TOUCHING_M > a[shown] * column + (b[shown] * row + c[shown])


def _ground_shadow(solid: _Solids, direction: Floats, screen: _CameraScreen) -> Bools:
    """The pixels whose ground z = 0 is in shadow, even behind props, (size, size)."""
    size_px = screen.size_px
    inside = np.zeros((size_px, size_px), dtype=np.bool_)
    if direction[2] <= 0:
        return inside
    backs = solid.corners_m[dot(solid.normals, direction) < _AWAY]
    corners_px, _ = screen.corners_px(backs - backs[..., 2:] * (direction / direction[2]))
    covering = _spans(corners_px, size_px)
    if len(covering.row):
        first, end = int(covering.row.min()), int(covering.row.max()) + 1
        n, start = (end - first) * (size_px + 1), (covering.row - first) * (size_px + 1)
        depth = np.bincount(start + covering.left, minlength=n)
        depth -= np.bincount(start + covering.right, minlength=n)
        # A row's spans end within it, so that one cumulative sum covers all rows.
        np.cumsum(depth, out=depth)
        inside[first:end] = depth.reshape(-1, size_px + 1)[:, :-1] > 0
    return inside
