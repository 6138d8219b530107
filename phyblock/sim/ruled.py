"""The goal on a ruled floor: lines every centimeter, numbers every five, axes with their names.

The rules lie on the floor, so that blocks stand on them and hide what is behind; numbers run along
the two edges next to the camera, where nothing hides them. A pole at the far corner rules the
height.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.scene import Block, CandidateSet, Scene
from phyblock.sim.backgrounds import GROUNDS
from phyblock.sim.camera import Camera, Window, frame, view_axes
from phyblock.sim.geometry import rounded
from phyblock.sim.pictures import (
    GRID_COLUMNS,
    LARGEST_PX,
    SUPERSAMPLE,
    DrawnBlock,
    PictureStyle,
    candidate_camera,
    candidates_grid,
    drawn,
    empty_ground,
    picture,
    picture_key,
    to_png,
)

RULED_VERSION = 1
"""Raised whenever the rules come out otherwise, so that stored pictures are made again."""

_CM = 100.0
_MARGIN_CM = 3.0
_MAJOR_CM = 5
_WINDOW = Window(-0.93, 0.93, -0.93, 0.93)
_LEAST_DISTANCE_M = 0.45
_LABEL_CM, _NAME_CM = 2.0, 5.0
_MINOR, _MAJOR = 95, 190
_X_INK, _Y_INK, _Z_INK = (255, 92, 92), (96, 220, 110), (110, 170, 255)
_X_DARK, _Y_DARK, _Z_DARK = (190, 20, 20), (10, 120, 30), (20, 60, 190)
_TOP_DEG = 80.0

Point = tuple[float, float, float]


@dataclass(frozen=True)
class _Field:
    """The ruled rectangle [cm], and which of its sides are next to the camera."""

    x: tuple[int, int]
    y: tuple[int, int]
    z: int
    near_x: int
    near_y: int

    @property
    def far_x(self) -> int:
        return self.x[0] if self.near_x == self.x[1] else self.x[1]

    @property
    def far_y(self) -> int:
        return self.y[0] if self.near_y == self.y[1] else self.y[1]

    def beyond(self, axis: int, by: float) -> float:
        """A place beyond the near side of an axis."""
        near, far = (self.near_x, self.far_x) if axis == 0 else (self.near_y, self.far_y)
        return near + math.copysign(by, near - far)


def ruled_png(scene: Scene, style: PictureStyle) -> bytes:
    """PNG of the goal on a ruled floor, seen as the style says; the scene must have a block."""
    return to_png(RuledFloor(scene, style).image(scene.blocks))


class RuledFloor:
    """The ruled floor of a scene, which must have a block: draws blocks seen as its goal is."""

    def __init__(self, scene: Scene, style: PictureStyle) -> None:
        blocks = drawn(scene.blocks)
        field = _field(blocks, style)
        self._camera, self._style = _camera(blocks, field, style), style
        empty = empty_ground(style.background, self._camera, style.size_px)
        self._ground = _ruled(empty, field, self._camera, style)

    def image(self, blocks: Sequence[Block]) -> Image.Image:
        """The blocks on the floor, an RGB image of the style's size."""
        shown = [DrawnBlock(b.type, b.color, b.position_m, b.euler_deg) for b in blocks]
        style = self._style
        return picture(shown, self._camera, style.background, style.size_px, self._ground)


def ruled_key(scene: Scene, style: PictureStyle) -> str:
    """SHA-256 [hex] of all that the picture depends on."""
    content = [RULED_VERSION, *(list(astuple(block)) for block in drawn(scene.blocks))]
    return picture_key("ruled goal", style, content)


def _field(blocks: Sequence[DrawnBlock], style: PictureStyle) -> _Field:
    points = np.vstack([block.vertices_m for block in blocks]) * _CM
    low, high = rounded(points.min(axis=0)), rounded(points.max(axis=0))

    def ends(axis: int) -> tuple[int, int]:
        first = math.floor((low[axis] - _MARGIN_CM) / _MAJOR_CM) * _MAJOR_CM
        last = math.ceil((high[axis] + _MARGIN_CM) / _MAJOR_CM) * _MAJOR_CM
        return int(first), int(last)

    x, y = ends(0), ends(1)
    azimuth = math.radians(style.azimuth_deg)
    # The camera is on the side of +x at azimuth 0; beside an axis, either of its ends will do.
    near_x = x[1] if math.cos(azimuth) > -1e-6 else x[0]
    near_y = y[1] if math.sin(azimuth) > -1e-6 else y[0]
    top = math.ceil((high[2] + 1) / _MAJOR_CM) * _MAJOR_CM
    return _Field(x, y, int(top), near_x, near_y)


def _camera(blocks: Sequence[DrawnBlock], field: _Field, style: PictureStyle) -> Camera:
    (x0, x1), (y0, y1) = field.x, field.y
    wide_x, wide_y = field.beyond(0, _NAME_CM + 1), field.beyond(1, _NAME_CM + 1)
    floor = [(x, y, 0.0) for x in (x0, x1, wide_x) for y in (y0, y1, wide_y)]
    pole = [(field.far_x, field.far_y, field.z + 2.0)] if _has_pole(style) else []
    marks = np.array([*floor, *pole], dtype=np.float64) / _CM
    points = np.vstack([*(block.vertices_m for block in blocks), marks])
    axes = view_axes(style.azimuth_deg, style.elevation_deg)
    return frame(points, axes, _WINDOW, _LEAST_DISTANCE_M)


def _has_pole(style: PictureStyle) -> bool:
    return style.elevation_deg < _TOP_DEG


def _ruled(
    ground: NDArray[np.float32], field: _Field, camera: Camera, style: PictureStyle
) -> NDArray[np.float32]:
    """The floor with all that is written on it."""
    size_px = len(ground)
    pen = _Pen(camera, size_px, Image.new("L", (size_px, size_px)))
    for start, end, is_major in _lines(field):
        pen.line(start, end, _MAJOR if is_major else _MINOR, 2 if is_major else 1)
    share = np.asarray(pen.image, dtype=np.float32)[..., None] / np.float32(255)
    ink = np.array(GROUNDS[style.background].ink, dtype=np.float32)
    ruled = ground * (1 - share) + ink * share
    image = Image.fromarray(np.rint(ruled).astype(np.uint8))
    _write(_Pen(camera, size_px, image), field, style)
    written: NDArray[np.float32] = np.array(image, dtype=np.float32)
    return written


def _lines(field: _Field) -> Iterator[tuple[Point, Point, bool]]:
    """The lines on the floor, those of single centimeters first."""
    (x0, x1), (y0, y1) = field.x, field.y
    for is_major in (False, True):
        for x in range(x0, x1 + 1):
            if (x % _MAJOR_CM == 0) == is_major:
                yield (x, y0, 0.0), (x, y1, 0.0), is_major
        for y in range(y0, y1 + 1):
            if (y % _MAJOR_CM == 0) == is_major:
                yield (x0, y, 0.0), (x1, y, 0.0), is_major


class _Pen:
    """Draws in a picture at places given in centimeters."""

    def __init__(self, camera: Camera, size_px: int, image: Image.Image) -> None:
        self.image = image
        self._camera, self._size_px = camera, size_px
        self._draw = ImageDraw.Draw(image)

    @property
    def right(self) -> tuple[float, float]:
        """What lies to the right in the picture, as a unit vector over the floor."""
        return float(self._camera.axes[0, 0]), float(self._camera.axes[0, 1])

    def pixel(self, place: Point) -> tuple[float, float]:
        """Where a place is in the picture."""
        column, row = self._camera.to_pixels(np.array([place]) / _CM, self._size_px)[0]
        return round(float(column), 3), round(float(row), 3)

    def line(self, start: Point, end: Point, ink: int | tuple[int, int, int], width: int) -> None:
        """A straight line."""
        self._draw.line([self.pixel(start), self.pixel(end)], fill=ink, width=width)

    def text(self, place: Point, text: str, ink: tuple[int, int, int], size_cm: float) -> None:
        """A text about so high, not less than can be read, with its middle at a place."""
        x, y, z = place
        right_x, right_y = self.right
        beside = (x + right_x, y + right_y, z)
        per_cm = math.dist(self.pixel(place), self.pixel(beside))
        size = min(max(size_cm * per_cm, 0.024 * self._size_px), 0.05 * self._size_px)
        font = ImageFont.load_default(size=round(size, 2))
        rim = (0, 0, 0) if sum(ink) > 380 else (255, 255, 255)
        self._draw.text(
            self.pixel(place), text, ink, font, anchor="mm", stroke_width=2, stroke_fill=rim
        )


def _write(pen: _Pen, field: _Field, style: PictureStyle) -> None:
    """Axes through the origin, names and numbers, and the pole."""
    ink = GROUNDS[style.background].ink
    is_dark = sum(ink) < 380
    x_ink, y_ink, z_ink = (_X_DARK, _Y_DARK, _Z_DARK) if is_dark else (_X_INK, _Y_INK, _Z_INK)
    (x0, x1), (y0, y1) = field.x, field.y
    if y0 <= 0 <= y1:
        pen.line((x0, 0, 0), (x1, 0, 0), x_ink, 2 * SUPERSAMPLE)
    if x0 <= 0 <= x1:
        pen.line((0, y0, 0), (0, y1, 0), y_ink, 2 * SUPERSAMPLE)
    beside_y, beside_x = field.beyond(1, _LABEL_CM), field.beyond(0, _LABEL_CM)
    for x in range(x0, x1 + 1, _MAJOR_CM):
        pen.text((x, beside_y, 0), str(x), x_ink if x else ink, 1.9)
    for y in range(y0, y1 + 1, _MAJOR_CM):
        pen.text((beside_x, y, 0), str(y), y_ink if y else ink, 1.9)
    pen.text(((x0 + x1) / 2, field.beyond(1, _NAME_CM), 0), "x", x_ink, 2.8)
    pen.text((field.beyond(0, _NAME_CM), (y0 + y1) / 2, 0), "y", y_ink, 2.8)
    if _has_pole(style):
        x, y = field.far_x, field.far_y
        pen.line((x, y, 0), (x, y, field.z), z_ink, SUPERSAMPLE)
        across = pen.right
        for z in range(1, field.z + 1):
            long = 0.9 if z % _MAJOR_CM == 0 else 0.4
            dx, dy = across[0] * long, across[1] * long
            pen.line((x - dx, y - dy, z), (x + dx, y + dy, z), z_ink, SUPERSAMPLE)
            if z % _MAJOR_CM == 0:
                dx, dy = across[0] * 2.4, across[1] * 2.4
                pen.text((x + dx, y + dy, z), str(z), z_ink, 1.9)
        pen.text((x, y, field.z + 1.6), "z", z_ink, 2.2)


KIT_VERSION = 1
"""Raised whenever the sheet comes out otherwise, so that stored pictures are made again."""

_GROWTH = 1.5

_TEXT, _MARGIN, _DOT = 0.105, 0.04, 0.035


def written_style(style: PictureStyle) -> PictureStyle:
    """The style of pictures that are written on: half as large again, so that it can be read."""
    return replace(style, size_px=min(math.ceil(style.size_px * _GROWTH), LARGEST_PX))


def kit_png(candidates: CandidateSet, style: PictureStyle) -> bytes:
    """PNG of the sheet, square, 4 by 4 cells, seen from where the style says."""
    sheet, blocks, distance_m = candidates_grid(candidates, style)
    for place, block in enumerate(blocks):
        row, column = divmod(place, GRID_COLUMNS)
        side = style.size_px / GRID_COLUMNS
        corner = (column * side, row * side)
        _write_kit(sheet, block, candidate_camera(block, style, distance_m), corner, side, style)
    return to_png(sheet)


def kit_key(candidates: CandidateSet, style: PictureStyle) -> str:
    """SHA-256 [hex] of all that the sheet depends on."""
    content = [astuple(candidate) for candidate in candidates.candidates]
    return picture_key("kit", style, [KIT_VERSION, style.candidate_scale, *content])


def box_cm(block: DrawnBlock) -> NDArray[np.float64]:
    """Low and high corner of the smallest box round a block as it is drawn, shape (2, 3) [cm]."""
    points = block.vertices_m * _CM
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _write_kit(
    sheet: Image.Image,
    block: DrawnBlock,
    camera: Camera,
    corner: tuple[float, float],
    side: float,
    style: PictureStyle,
) -> None:
    low, high = box_cm(block)
    draw, ink = ImageDraw.Draw(sheet), GROUNDS[style.background].ink
    font = ImageFont.load_default(size=_TEXT * side)
    sizes = (f"{name} {_number(size)}" for name, size in zip("xyz", high - low, strict=True))
    left, foot = corner[0] + _MARGIN * side, corner[1] + side * (1 - _MARGIN)
    draw.text((left, foot), ", ".join(sizes), ink, font, anchor="ls")
    middle = ((low + high) / 2 / _CM)[None]
    x, y = camera.to_pixels(middle, round(side))[0]
    column, row = corner[0] + float(x), corner[1] + float(y)
    for radius, fill in ((_DOT * side, "white"), (_DOT * side * 0.6, "black")):
        draw.ellipse((column - radius, row - radius, column + radius, row + radius), fill=fill)


def _number(size_cm: float) -> str:
    return f"{round(float(size_cm), 1):g}"
