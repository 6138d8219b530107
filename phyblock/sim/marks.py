"""Lettered places in a picture: a small target on the surface, a line, and a label at its end.

White discs with a dark rim and a dark letter read on every floor and are unlike any block. The
labels stand off from their targets, where they cover neither a target nor one another.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.question import Mark
from phyblock.sim.camera import Camera

__all__ = ["draw_marks"]

_SUPERSAMPLE = 4
_TARGET_RADIUS_M = 0.007
_DOT_SHARE = 0.38
_LABEL_RADIUS = 0.031
_LEAST_LABEL_PX = 7.5
_RIM = 0.0042
_LETTER = 1.35
_ANGLES_DEG = (90, 60, 120, 30, 150, 0, 180, -30, -150, -60, -120, -90)
_DISTANCES = (2.1, 2.8, 3.6, 4.6)
_ROUNDS = 4
_DARK, _LIGHT = (18, 20, 26, 255), (255, 255, 255, 255)
_BLOCKED = 1000.0

Point = tuple[float, float]


class _Spot(NamedTuple):
    """A target: its center and the outline of its ring, in pixels."""

    letter: str
    center: Point
    ring: NDArray[np.float64]


def draw_marks(image: Image.Image, marks: Sequence[Mark], camera: Camera) -> Image.Image:
    """The picture (square, RGB) with each mark's target, line and label drawn over it."""
    if not marks:
        return image
    size_px = image.width
    spots = [_spot(mark, camera, size_px) for mark in marks]
    radius = max(_LABEL_RADIUS * size_px, _LEAST_LABEL_PX)
    labels = _places(spots, radius, size_px)
    layer = Image.new("RGBA", (size_px * _SUPERSAMPLE,) * 2)
    draw = ImageDraw.Draw(layer)
    rim = max(_RIM * size_px, 1.0) * _SUPERSAMPLE
    for spot, label in zip(spots, labels, strict=True):
        _draw_line(draw, spot.center, label, rim)
    for spot in spots:
        _draw_target(draw, spot, rim)
    for spot, label in zip(spots, labels, strict=True):
        _draw_label(draw, spot.letter, label, radius * _SUPERSAMPLE, rim)
    small = layer.reduce(_SUPERSAMPLE)
    return Image.alpha_composite(image.convert("RGBA"), small).convert("RGB")


def _spot(mark: Mark, camera: Camera, size_px: int) -> _Spot:
    angles = np.linspace(0, 2 * math.pi, 25)[:-1]
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=1)
    place = np.array(mark.position_m)
    center = camera.to_pixels(place[None], size_px)[0]
    ring = camera.to_pixels(place + _TARGET_RADIUS_M * circle, size_px)
    return _Spot(mark.letter, (float(center[0]), float(center[1])), ring)


def _places(spots: Sequence[_Spot], radius: float, size_px: int) -> list[Point]:
    """Where the labels' centers go: each in turn to its best place, until none moves."""
    chosen = [_moved(spot.center, 90, 2.1 * radius) for spot in spots]
    for _ in range(_ROUNDS):
        before = list(chosen)
        for number, spot in enumerate(spots):
            others = [place for i, place in enumerate(chosen) if i != number]
            rest = [other.center for i, other in enumerate(spots) if i != number]
            options = [
                (_cost(spot.center, place, others, rest, radius, size_px) + extra, place)
                for extra, place in _options(spot.center, radius)
            ]
            chosen[number] = min(options)[1]
        if chosen == before:
            break
    return chosen


def _options(center: Point, radius: float) -> list[tuple[float, Point]]:
    """Places round a target, each with what it costs to be far from it or not above it."""
    return [
        (10 * far + index, _moved(center, angle, distance * radius))
        for (far, distance), (index, angle) in product(
            enumerate(_DISTANCES), enumerate(_ANGLES_DEG)
        )
    ]


def _cost(
    center: Point,
    place: Point,
    labels: Sequence[Point],
    targets: Sequence[Point],
    radius: float,
    size_px: int,
) -> float:
    """How bad a label's place is: over an edge, a label, a target, or a line over either."""
    cost = 0.0
    if not all(1.2 * radius <= one <= size_px - 1.2 * radius for one in place):
        cost += 4 * _BLOCKED
    for label in labels:
        if math.dist(place, label) < 2.5 * radius:
            cost += 3 * _BLOCKED
        if _line_distance(center, place, label) < 1.3 * radius:
            cost += 2 * _BLOCKED
    for target in targets:
        if math.dist(place, target) < 1.9 * radius:
            cost += 2 * _BLOCKED
        if _line_distance(center, place, target) < 0.7 * radius:
            cost += _BLOCKED
    return cost


def _line_distance(start: Point, end: Point, point: Point) -> float:
    """Distance of a point from a segment."""
    along = (end[0] - start[0], end[1] - start[1])
    length = math.hypot(*along)
    inside = (point[0] - start[0]) * along[0] + (point[1] - start[1]) * along[1]
    share = min(1.0, max(0.0, inside / length**2))
    return math.dist(point, (start[0] + share * along[0], start[1] + share * along[1]))


def _moved(point: Point, angle_deg: float, distance: float) -> Point:
    angle = math.radians(angle_deg)
    return point[0] + distance * math.cos(angle), point[1] - distance * math.sin(angle)


def _scaled(point: Sequence[float]) -> Point:
    return point[0] * _SUPERSAMPLE, point[1] * _SUPERSAMPLE


def _draw_line(draw: ImageDraw.ImageDraw, start: Point, end: Point, rim: float) -> None:
    ends = [_scaled(start), _scaled(end)]
    draw.line(ends, fill=_DARK, width=round(2.6 * rim))
    draw.line(ends, fill=_LIGHT, width=max(1, round(1.1 * rim)))


def _draw_target(draw: ImageDraw.ImageDraw, spot: _Spot, rim: float) -> None:
    center = np.array(spot.center)
    for reach, color in ((1.0, _DARK), (0.8, _LIGHT), (_DOT_SHARE, _DARK)):
        outline = center + reach * (spot.ring - center)
        draw.polygon([_scaled(corner) for corner in outline.tolist()], fill=color)
    outer = [_scaled(corner) for corner in spot.ring.tolist()]
    draw.line([*outer, outer[0]], fill=_DARK, width=max(1, round(0.6 * rim)))


def _draw_label(
    draw: ImageDraw.ImageDraw, letter: str, place: Point, radius: float, rim: float
) -> None:
    x, y = _scaled(place)
    draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=_DARK)
    inner = radius - rim
    draw.ellipse((x - inner, y - inner, x + inner, y + inner), fill=_LIGHT)
    font = ImageFont.load_default(size=_LETTER * radius)
    low = draw.textbbox((0, 0), letter, font=font)
    left, top = x - (low[0] + low[2]) / 2, y - (low[1] + low[3]) / 2
    draw.text((left, top), letter, fill=_DARK, font=font)
