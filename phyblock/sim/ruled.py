"""Pictures with scales: the goal on a ruled floor, and the sheet of all candidates.

The floor has lines every centimeter, numbers every five along the two edges next to the camera, and
named axes. A pole at the far corner marks the height.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.scene import Block, CandidateSet, Scene
from phyblock.sim.backgrounds import GROUNDS
from phyblock.sim.camera import Camera, Window, frame
from phyblock.sim.geometry import rounded
from phyblock.sim.pictures import (
    GRID_COLUMNS,
    LARGEST_PX,
    SUPERSAMPLE,
    PictureStyle,
    candidate_camera,
    candidates_grid,
    drawn_m,
    empty_ground,
    looks,
    picture,
    picture_key,
    to_png,
)
from phyblock.sim.raster import Rgb

RULED_VERSION = 1
"""Increased whenever the scales change, so that stored pictures are redrawn."""
KIT_VERSION = 1
"""Increased whenever the sheet changes, so that stored pictures are redrawn."""

_CM = 100.0
_MARGIN_CM = 3.0
_MAJOR_CM = 5
_WINDOW = Window(-0.93, 0.93, -0.93, 0.93)
_LEAST_DISTANCE_M = 0.45
_LABEL_CM, _NAME_CM = 2.0, 5.0
_MINOR, _MAJOR = 95, 190
_BRIGHT: tuple[Rgb, ...] = ((255, 92, 92), (96, 220, 110), (110, 170, 255))
_DARK: tuple[Rgb, ...] = ((190, 20, 20), (10, 120, 30), (20, 60, 190))
"""Colors of x, y and z on dark floors and on light ones."""
_LIGHT_SUM = 380
_TOP_DEG = 80.0
_GROWTH = 1.5
_TEXT, _MARGIN, _DOT = 0.105, 0.04, 0.035

Point = tuple[float, float, float]


def ruled_png(scene: Scene, style: PictureStyle) -> bytes:
    """PNG of the goal on a ruled floor, in the view of the style; the scene must have a block."""
    return to_png(RuledFloor(scene, style).image(scene.blocks))


def ruled_key(scene: Scene, style: PictureStyle) -> str:
    """SHA-256 [hex] of everything that the picture depends on."""
    content = [RULED_VERSION, *looks(scene.blocks)]
    return picture_key("ruled goal", style, content)


class RuledFloor:
    """The ruled floor of a scene, which must have a block; draws blocks from the goal's camera."""

    def __init__(self, scene: Scene, style: PictureStyle) -> None:
        field = _field(scene.blocks, style)
        self._camera, self._style = _camera(scene.blocks, field, style), style
        ground = empty_ground(style.background, self._camera, style.size_px)
        size_px, ink = len(ground), GROUNDS[style.background].ink
        rules = _Pen(self._camera, Image.new("L", (size_px, size_px)))
        (x0, x1), (y0, y1) = field.x, field.y
        for is_major in (False, True):
            shade, width = (_MAJOR, 2) if is_major else (_MINOR, 1)
            lines = [((x, y0, 0), (x, y1, 0), x) for x in range(x0, x1 + 1)]
            lines += [((x0, y, 0), (x1, y, 0), y) for y in range(y0, y1 + 1)]
            for start, end, at in lines:
                if (at % _MAJOR_CM == 0) == is_major:
                    rules.line(start, end, shade, width)
        share = np.asarray(rules.image, dtype=np.float32)[..., None] / np.float32(255)
        ruled = ground * (1 - share) + np.array(ink, dtype=np.float32) * share
        written = _Pen(self._camera, Image.fromarray(np.rint(ruled).astype(np.uint8)))
        _write(written, field, ink, has_pole=style.elevation_deg < _TOP_DEG)
        self._ground: NDArray[np.float32] = np.array(written.image, dtype=np.float32)

    def image(self, blocks: Sequence[Block]) -> Image.Image:
        """The blocks on the floor, an RGB image of the style's size."""
        style = self._style
        return picture(blocks, self._camera, style.background, style.size_px, self._ground)


class _Field(NamedTuple):
    """The ruled rectangle [cm], and along x and y its sides next to the camera and far from it."""

    x: tuple[int, int]
    y: tuple[int, int]
    z: int
    near: tuple[int, int]
    far: tuple[int, int]

    def beyond(self, axis: int, by: float) -> float:
        """A place beyond the near side of an axis."""
        return self.near[axis] + math.copysign(by, self.near[axis] - self.far[axis])


def _field(blocks: Sequence[Block], style: PictureStyle) -> _Field:
    points = np.vstack([drawn_m(block) for block in blocks]) * _CM
    low, high = rounded(points.min(axis=0)), rounded(points.max(axis=0))
    first = [math.floor((side - _MARGIN_CM) / _MAJOR_CM) * _MAJOR_CM for side in low]
    last = [math.ceil((side + _MARGIN_CM) / _MAJOR_CM) * _MAJOR_CM for side in high]
    azimuth = math.radians(style.azimuth_deg)
    # The camera is on the side of +x at azimuth 0; beside an axis, either end is suitable.
    x, y = ((first[axis], last[axis]) for axis in (0, 1))
    near_x, near_y = math.cos(azimuth) > -1e-6, math.sin(azimuth) > -1e-6
    top = math.ceil((high[2] + 1) / _MAJOR_CM) * _MAJOR_CM
    return _Field(x, y, top, (x[near_x], y[near_y]), (x[not near_x], y[not near_y]))


def _camera(blocks: Sequence[Block], field: _Field, style: PictureStyle) -> Camera:
    wide_x, wide_y = field.beyond(0, _NAME_CM + 1), field.beyond(1, _NAME_CM + 1)
    marks = [(x, y, 0.0) for x in (*field.x, wide_x) for y in (*field.y, wide_y)]
    if style.elevation_deg < _TOP_DEG:
        marks.append((*field.far, field.z + 2.0))
    corners = np.array(marks, dtype=np.float64) / _CM
    points = np.vstack([*(drawn_m(block) for block in blocks), corners])
    return frame(points, style.axes, _WINDOW, _LEAST_DISTANCE_M)


class _Pen:
    """Draws in a square picture at places given in centimeters."""

    def __init__(self, camera: Camera, image: Image.Image) -> None:
        self.image = image
        self._camera, self._size_px = camera, image.width
        self._draw = ImageDraw.Draw(image)

    def along(self, place: Point, by: float) -> Point:
        """The place at a distance to the right of another in the picture, at the same height."""
        right_x, right_y, _ = self._camera.axes[0].tolist()
        return (place[0] + right_x * by, place[1] + right_y * by, place[2])

    def pixel(self, place: Point) -> tuple[float, float]:
        """The pixel of a place."""
        column, row = self._camera.to_pixels(np.array([place]) / _CM, self._size_px)[0]
        return round(float(column), 3), round(float(row), 3)

    def line(self, start: Point, end: Point, ink: int | Rgb, width: int) -> None:
        """A straight line."""
        self._draw.line([self.pixel(start), self.pixel(end)], fill=ink, width=width)

    def text(self, place: Point, text: str, ink: Rgb, size_cm: float) -> None:
        """Draw a text of about this height, but readable, with its center at a place."""
        per_cm = math.dist(self.pixel(place), self.pixel(self.along(place, 1)))
        size = min(max(size_cm * per_cm, 0.024 * self._size_px), 0.05 * self._size_px)
        font = ImageFont.load_default(size=round(size, 2))
        rim = (0, 0, 0) if sum(ink) > _LIGHT_SUM else (255, 255, 255)
        self._draw.text(
            self.pixel(place), text, ink, font, anchor="mm", stroke_width=2, stroke_fill=rim
        )


def _write(pen: _Pen, field: _Field, ink: Rgb, *, has_pole: bool) -> None:
    """Draw axes through the origin, names and numbers, and the pole."""
    x_ink, y_ink, z_ink = _DARK if sum(ink) < _LIGHT_SUM else _BRIGHT
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
    if has_pole:
        x, y = field.far
        pen.line((x, y, 0), (x, y, field.z), z_ink, SUPERSAMPLE)
        for z in range(1, field.z + 1):
            long = 0.9 if z % _MAJOR_CM == 0 else 0.4
            pen.line(pen.along((x, y, z), -long), pen.along((x, y, z), long), z_ink, SUPERSAMPLE)
            if z % _MAJOR_CM == 0:
                pen.text(pen.along((x, y, z), 2.4), str(z), z_ink, 1.9)
        pen.text((x, y, field.z + 1.6), "z", z_ink, 2.2)


def written_style(style: PictureStyle) -> PictureStyle:
    """The style of pictures with text: half as large again, so that it is readable."""
    return replace(style, size_px=min(math.ceil(style.size_px * _GROWTH), LARGEST_PX))


def kit_png(candidates: CandidateSet, style: PictureStyle) -> bytes:
    """PNG of `kit_sheet`."""
    return to_png(kit_sheet(candidates, style))


def kit_sheet(candidates: CandidateSet, style: PictureStyle) -> Image.Image:
    """Every candidate with its number, its dimensions, and a dot at the center of its box."""
    sheet, blocks, distance_m = candidates_grid(candidates, style)
    draw, side = ImageDraw.Draw(sheet), style.size_px / GRID_COLUMNS
    font = ImageFont.load_default(size=_TEXT * side)
    for place, block in enumerate(blocks):
        row, column = divmod(place, GRID_COLUMNS)
        points = drawn_m(block) * _CM
        low, high = points.min(axis=0), points.max(axis=0)
        sides = zip("xyz", (high - low).tolist(), strict=True)
        sizes = (f"{name} {round(side_cm, 1):g}" for name, side_cm in sides)
        left, foot = column * side + _MARGIN * side, row * side + side * (1 - _MARGIN)
        ink = GROUNDS[style.background].ink
        draw.text((left, foot), ", ".join(sizes), ink, font, anchor="ls")
        camera, middle = candidate_camera(block, style, distance_m), ((low + high) / 2 / _CM)[None]
        x, y = camera.to_pixels(middle, round(side))[0].tolist()
        x, y = column * side + x, row * side + y
        for radius, fill in ((_DOT * side, "white"), (_DOT * side * 0.6, "black")):
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=fill)
    return sheet


def kit_key(candidates: CandidateSet, style: PictureStyle) -> str:
    """SHA-256 [hex] of everything that the sheet depends on."""
    content = [astuple(candidate) for candidate in candidates.candidates]
    return picture_key("kit", style, [KIT_VERSION, "common", *content])
