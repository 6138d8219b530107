"""The pictures of questions: a recipe to a PNG, and the key that it caches under.

As with goal pictures, the same recipe and style give the same bytes in every process of one
machine, and the key names everything that the bytes depend on.
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Sequence
from dataclasses import fields, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.blocks import SHAPES
from phyblock.domain.question import Mark, QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.files import decode_picture
from phyblock.sim.camera import Camera, Window, frame, view_axes
from phyblock.sim.pictures import (
    RENDER_VERSION,
    DrawnBlock,
    PictureStyle,
    Shot,
    camera_for,
    drawn,
    on_the_floor,
    picture,
    pixel_versions,
    shoot,
    to_png,
)
from phyblock.stable import hex_digest

QUESTION_RENDER_VERSION = 2
"""Raised whenever the same recipe gives other pixels, so that stored pictures are made again."""
BLOCK_LABEL = "block"
"""The label of a picture that shows one block by itself."""

_BLOCK_WINDOW = Window(-0.52, 0.52, -0.52, 0.52)
_LARGEST_DIAGONAL_M = 0.16
_SIZE_CUE = 0.25


def question_png(picture_recipe: QuestionPicture, style: PictureStyle) -> bytes:
    """PNG of a question's picture, square; its view, and background if any, replace the style's.

    Raises DataError for a recipe with nothing to frame, ValueError for a view that a
    `PictureStyle` does not allow.
    """
    camera = question_camera(picture_recipe, style)
    ground = picture_recipe.background or style.background
    image = picture(drawn_blocks(picture_recipe), camera, ground, style.size_px)
    return to_png(draw_marks(image, picture_recipe.marks, camera))


def question_camera(picture_recipe: QuestionPicture, style: PictureStyle) -> Camera:
    """The camera of a question's picture; raises as `question_png`.

    A block shown by itself (label `block`) fills a like share of its picture whatever its type,
    larger ones a little more, as in the pictures of candidates.
    """
    azimuth_deg, elevation_deg = picture_recipe.view_deg
    seen = replace(style, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)
    shown = drawn_blocks(picture_recipe)
    framed = drawn(picture_recipe.framed) or shown
    if _is_alone(picture_recipe):
        framed = shown
        shape = SHAPES[framed[0].type]
        share = math.dist(shape.low_m, shape.high_m) / _LARGEST_DIAGONAL_M
        window = _BLOCK_WINDOW.scaled(share**_SIZE_CUE)
        return frame(framed[0].vertices_m, view_axes(azimuth_deg, elevation_deg), window)
    return camera_for(framed, seen, picture_recipe.label, shown)


def drawn_blocks(picture_recipe: QuestionPicture) -> list[DrawnBlock]:
    """The blocks as they are drawn; one shown by itself (label `block`) lies on the floor."""
    blocks = drawn(picture_recipe.blocks)
    if _is_alone(picture_recipe):
        return [on_the_floor(blocks[0].type, blocks[0].color, blocks[0].euler_deg)]
    return blocks


def state_picture(scene: Scene, blocks: Sequence[Block], style: PictureStyle) -> QuestionPicture:
    """The recipe of a picture of blocks on the ground, seen exactly as the goal picture is."""
    view_deg = (style.azimuth_deg, style.elevation_deg)
    return QuestionPicture("current", tuple(blocks), view_deg, framed=scene.blocks)


def question_key(picture_recipe: QuestionPicture, style: PictureStyle) -> str:
    """SHA-256 [hex] of all that the picture depends on; of the style, not its own view.

    A label counts only where it changes the framing, so that equal pictures share a file.
    """
    parts = {
        "kind": "question",
        "render_version": [RENDER_VERSION, QUESTION_RENDER_VERSION],
        **pixel_versions(),
        "style": [style.size_px, picture_recipe.background or style.background],
        "view": list(picture_recipe.view_deg),
        "alone": _is_alone(picture_recipe),
        "blocks": _field_values(drawn_blocks(picture_recipe)),
        "framed": _field_values(drawn(picture_recipe.framed)),
        "marks": [[mark.letter, *mark.position_m] for mark in picture_recipe.marks],
    }
    return hex_digest(json.dumps(parts, sort_keys=True, allow_nan=False))


def _is_alone(picture_recipe: QuestionPicture) -> bool:
    return picture_recipe.label == BLOCK_LABEL and len(picture_recipe.blocks) == 1


def _field_values(blocks: Sequence[DrawnBlock]) -> list[list[object]]:
    """All fields of each block; `astuple` would copy what is in them as well."""
    return [[getattr(block, field.name) for field in fields(block)] for block in blocks]


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


LETTERED_VERSION = 1
"""Raised whenever the same pictures give another sheet, so that stored sheets are made again."""

_COLUMNS = 2
_GAP = 0.016
_BADGE = 0.11
_MARGIN = 0.02
_DARK_LETTERED, _LIGHT_LETTERED = (20, 24, 32), (255, 255, 255)


def lettered_sheet_png(pictures: Sequence[bytes], letters: str, side_px: int) -> bytes:
    """PNG with the encoded pictures in rows of two, each `side_px` wide and high.

    A dark letter on a white badge stands in the upper left corner of each.
    """
    sheet = Image.new("RGB", sheet_size_px(len(pictures), side_px), "white")
    step = side_px + _gap_px(side_px)
    for number, (data, letter) in enumerate(zip(pictures, letters, strict=True)):
        row, column = divmod(number, _COLUMNS)
        with decode_picture(data, f"picture {letter}") as picture:
            cell = picture.convert("RGB").resize((side_px, side_px), Image.Resampling.LANCZOS)
        _draw_badge(cell, letter)
        sheet.paste(cell, (column * step, row * step))
    return to_png(sheet)


def sheet_size_px(n: int, side_px: int) -> tuple[int, int]:
    """Width and height of a sheet of `n` pictures."""
    columns, rows = min(n, _COLUMNS), -(-n // _COLUMNS)
    gap = _gap_px(side_px)
    return columns * side_px + (columns - 1) * gap, rows * side_px + (rows - 1) * gap


def _gap_px(side_px: int) -> int:
    return max(2, round(side_px * _GAP))


def _draw_badge(cell: Image.Image, letter: str) -> None:
    side = max(18, round(cell.width * _BADGE))
    start = round(cell.width * _MARGIN)
    draw = ImageDraw.Draw(cell)
    box = (start, start, start + side, start + side)
    draw.rounded_rectangle(
        box,
        radius=side // 5,
        fill=_LIGHT_LETTERED,
        outline=_DARK_LETTERED,
        width=max(1, side // 24),
    )
    font = ImageFont.load_default(size=0.78 * side)
    middle = (start + side / 2, start + side / 2)
    draw.text(middle, letter, _DARK_LETTERED, font=font, anchor="mm")


SEEN_PX = 256
"""Side of the pictures that are compared."""
MARKS_APART_PX = 18.0
"""Targets are this far apart at the least, in pixels of `SEEN_PX`."""
_LEAST_DEPTH_PX = 4
_VISIBLE_STEP = 24
_EDGE = 0.97
_STYLE = PictureStyle(SEEN_PX)


class Top(NamedTuple):
    """A point of a block's surface [m], rounded to 0.1 mm, and where it lies on the block.

    `rise` is the z of the surface's unit normal, `off_center_m` how far the point is from the
    vertical line through the middle of the block.
    """

    position_m: tuple[float, float, float]
    rise: float
    off_center_m: float


def seen(recipe: QuestionPicture) -> Shot:
    """The blocks of a picture by its camera, `SEEN_PX` squared, with no floor and no marks."""
    return _seen(recipe)


@functools.lru_cache(maxsize=48)
def _camera(recipe: QuestionPicture) -> Camera:
    return question_camera(recipe, _STYLE)


@functools.lru_cache(maxsize=48)
def _seen(recipe: QuestionPicture) -> Shot:
    return shoot(drawn_blocks(recipe), _camera(recipe), SEEN_PX)


def differing_pixels(one: Shot, other: Shot) -> int:
    """How many pixels of the two differ by more than a tenth of the scale in some channel."""
    return int(changed_pixels(one, other).sum())


def changed_pixels(one: Shot, other: Shot) -> NDArray[np.bool_]:
    """Where the two differ by more than a tenth of the scale in some channel, shape of both."""
    step = np.abs(_colors(one) - _colors(other)) > _VISIBLE_STEP
    changed: NDArray[np.bool_] = step[..., 0] | step[..., 1] | step[..., 2]
    return changed


def least_difference(shots: Sequence[Shot]) -> int:
    """The fewest pixels in which any two pictures differ; two at least must be given."""
    return min(
        differing_pixels(one, other) for i, one in enumerate(shots) for other in shots[i + 1 :]
    )


def shown_pixels(recipe: QuestionPicture, shot: Shot) -> dict[int, int]:
    """For each block's order, how many pixels show it."""
    counts = np.bincount(shot.block[shot.block >= 0], minlength=len(recipe.blocks))
    return {b.order: int(n) for b, n in zip(recipe.blocks, counts, strict=True)}


def is_inside(recipe: QuestionPicture) -> bool:
    """Whether no block or mark comes near the picture's edge."""
    camera = _camera(recipe)
    points = [block.vertices_m for block in drawn_blocks(recipe)]
    points += [np.array([mark.position_m]) for mark in recipe.marks]
    return bool(np.abs(camera.project(np.vstack(points))).max() < _EDGE)


def block_mark(recipe: QuestionPicture, shot: Shot, order: int, letter: str) -> Mark | None:
    """A mark in the middle of what shows of a block; None where less shows than its target needs.

    The place is the point of the block's surface behind the pixel farthest from the edge of what
    shows; that is four pixels of `SEEN_PX` at the least.
    """
    vertex = next(i for i, block in enumerate(recipe.blocks) if block.order == order)
    pixel, depth = _deepest(shot.block == vertex)
    if depth < _LEAST_DEPTH_PX:
        return None
    block = drawn_blocks(recipe)[vertex]
    hit = _hit(block, _camera(recipe), pixel)
    return None if hit is None else Mark(letter, hit.position_m)


def visible_tops(recipe: QuestionPicture, shot: Shot, step_px: int, least_rise: float) -> list[Top]:
    """Points of the blocks' surfaces that show and face up, behind every `step_px`-th pixel.

    Facing up means that the unit normal's z is `least_rise` or more; pixels at the edge of what
    shows of a block are left out.
    """
    camera, blocks = _camera(recipe), drawn_blocks(recipe)
    tops = []
    for row in range(step_px // 2, SEEN_PX - 2, step_px):
        for column in range(step_px // 2, SEEN_PX - 2, step_px):
            around = shot.block[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
            vertex = int(around[0, 0])
            if vertex < 0 or (around != vertex).any():
                continue
            hit = _hit(blocks[vertex], camera, (row, column))
            if hit is not None and hit.rise >= least_rise:
                tops.append(hit)
    return tops


def mark_pixel(recipe: QuestionPicture, position_m: tuple[float, float, float]) -> tuple[int, int]:
    """The pixel (row, column) of `SEEN_PX` at a point of the world, the nearest one inside."""
    camera = _camera(recipe)
    column, row = camera.to_pixels(np.array([position_m]), SEEN_PX)[0]
    return int(np.clip(row, 0, SEEN_PX - 1)), int(np.clip(column, 0, SEEN_PX - 1))


def seen_order(
    recipe: QuestionPicture, shot: Shot, position_m: tuple[float, float, float]
) -> int | None:
    """Order of the block that shows at a point of the world; None for the floor."""
    vertex = int(shot.block[mark_pixel(recipe, position_m)])
    return recipe.blocks[vertex].order if vertex >= 0 else None


def surface_at(
    recipe: QuestionPicture, shot: Shot, position_m: tuple[float, float, float]
) -> Top | None:
    """The point of a block's surface that shows at a point of the world; None for the floor."""
    pixel = mark_pixel(recipe, position_m)
    vertex = int(shot.block[pixel])
    if vertex < 0:
        return None
    return _hit(drawn_blocks(recipe)[vertex], _camera(recipe), pixel)


def is_apart(
    recipe: QuestionPicture, mark: Mark, others: Sequence[Mark], least_px: float = MARKS_APART_PX
) -> bool:
    """Whether a mark's target is so many pixels of `SEEN_PX` away from all the others'."""
    camera = _camera(recipe)
    places = np.array([one.position_m for one in (mark, *others)])
    pixels = camera.to_pixels(places, SEEN_PX)
    apart = np.linalg.norm(pixels[1:] - pixels[0], axis=1)
    return bool(apart.min(initial=np.inf) >= least_px)


@functools.lru_cache(maxsize=48)
def _colors(shot: Shot) -> NDArray[np.int16]:
    """Colors with every pixel of the floor white."""
    colors = shot.rgb.astype(np.int16)
    colors[shot.block < 0] = 255
    return colors


def _deepest(mask: NDArray[np.bool_]) -> tuple[tuple[int, int], int]:
    """The pixel (row, column) that lasts longest as a mask is eaten from its edge, and how long."""
    depth, last, left = 0, mask, mask
    while left.any():
        depth, last = depth + 1, left
        wide = np.pad(left, 1)
        left = left & wide[2:, 1:-1] & wide[:-2, 1:-1] & wide[1:-1, 2:] & wide[1:-1, :-2]
    if depth == 0:
        return (0, 0), 0
    rows, columns = np.nonzero(last)
    middle = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
    return (int(rows[middle]), int(columns[middle])), depth


def _hit(block: DrawnBlock, camera: Camera, pixel: tuple[int, int]) -> Top | None:
    """Where the ray through a pixel meets the block first (Moeller-Trumbore); None if it misses."""
    half = camera.half_tangent
    across = ((pixel[1] + 0.5) / SEEN_PX * 2 - 1) * half
    up = (1 - (pixel[0] + 0.5) / SEEN_PX * 2) * half
    ray = camera.axes[0] * across + camera.axes[1] * up + camera.axes[2]
    corners = block.triangles_m
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    crossed = np.cross(ray, two)
    scale = np.einsum("ij,ij->i", one, crossed)
    facing = np.abs(scale) > 1e-15
    start = camera.eye_m - corners[:, 0]
    inverse = 1 / np.where(facing, scale, 1.0)
    u = np.einsum("ij,ij->i", start, crossed) * inverse
    turned = np.cross(start, one)
    v = turned @ ray * inverse
    away = np.einsum("ij,ij->i", two, turned) * inverse
    met = facing & (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (away > 0)
    if not met.any():
        return None
    nearest = int(np.argmin(np.where(met, away, np.inf)))
    x, y, z = (round(float(part), 4) + 0.0 for part in camera.eye_m + away[nearest] * ray)
    normal = np.cross(one[nearest], two[nearest])
    middle = (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1))) / 2
    off_center_m = float(np.hypot(x - middle[0], y - middle[1]))
    return Top((x, y, z), float(normal[2] / np.linalg.norm(normal)), off_center_m)
