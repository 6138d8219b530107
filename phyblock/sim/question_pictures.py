"""The pictures of questions: from a recipe to a PNG, its key, its marks, and its visible facts.

The same recipe and style give the same bytes, and the key covers all that they depend on. A mark is
a target on the surface, a line and a label. Pictures are compared without anti-aliasing.
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.question import Mark, QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.sim import pictures
from phyblock.sim.geometry import drawn_mesh
from phyblock.sim.pictures import PictureStyle, Shot
from phyblock.sim.raster import HALF_TANGENT, Camera, Window
from phyblock.text import hex_digest

QUESTION_RENDER_VERSION = 2
"""Increased whenever the same recipe gives other pixels, so that stored pictures are redrawn."""
BLOCK_LABEL = "block"  # The label of a picture that shows one block by itself.
SEEN_PX = 256  # Side of the pictures that are compared.
MARKS_APART_PX = 14.0  # Targets are this far apart at the least, in pixels of `SEEN_PX`.

_BLOCK_WINDOW = Window(-0.52, 0.52, -0.52, 0.52)
_STYLE = PictureStyle(SEEN_PX)
_LEAST_DEPTH_PX = 4
_VISIBLE_STEP = 24
_EDGE = 0.97
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


def question_png(recipe: QuestionPicture, style: PictureStyle) -> bytes:
    """PNG of a question's picture, square; its view, and background if any, replace the style's."""
    camera = question_camera(recipe, style)
    ground = recipe.background or style.background
    image = pictures.picture(drawn_blocks(recipe), camera, ground, style.size_px)
    return pictures.to_png(_with_marks(image, recipe.marks, camera) if recipe.marks else image)


@functools.lru_cache(maxsize=48)
def question_camera(recipe: QuestionPicture, style: PictureStyle) -> Camera:
    """The camera of a question's picture: like a goal's, or like a candidate's for one block."""
    azimuth_deg, elevation_deg = recipe.view_deg
    seen_from = replace(style, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)
    shown = drawn_blocks(recipe)
    if _is_alone(recipe):
        return pictures.close_camera(shown[0], seen_from, _BLOCK_WINDOW)
    return pictures.camera_for(recipe.framed or shown, seen_from, recipe.label, shown)


def drawn_blocks(recipe: QuestionPicture) -> Sequence[Block]:
    """The blocks as drawn; a single block (label `block`) lies on the floor."""
    if _is_alone(recipe):
        only = recipe.blocks[0]
        return [pictures.on_the_floor(only.type, only.color, only.euler_deg)]
    return recipe.blocks


def _is_alone(recipe: QuestionPicture) -> bool:
    return recipe.label == BLOCK_LABEL and len(recipe.blocks) == 1


def state_picture(scene: Scene, blocks: Sequence[Block], style: PictureStyle) -> QuestionPicture:
    """The recipe of a picture of blocks on the ground, with the goal picture's camera."""
    view_deg = (style.azimuth_deg, style.elevation_deg)
    return QuestionPicture("current", tuple(blocks), view_deg, framed=scene.blocks)


def question_key(recipe: QuestionPicture, style: PictureStyle) -> str:
    """SHA-256 [hex] of everything the picture depends on, so that equal pictures share a file."""
    parts = {
        "kind": "question",
        "render_version": [pictures.RENDER_VERSION, QUESTION_RENDER_VERSION],
        **pictures.pixel_versions(),
        "style": [style.size_px, recipe.background or style.background],
        "view": list(recipe.view_deg),
        "alone": _is_alone(recipe),
        "blocks": pictures.looks(drawn_blocks(recipe)),
        "framed": pictures.looks(recipe.framed),
        "marks": [[mark.letter, *mark.position_m] for mark in recipe.marks],
    }
    return hex_digest(json.dumps(parts, sort_keys=True, allow_nan=False))


def _with_marks(image: Image.Image, marks: Sequence[Mark], camera: Camera) -> Image.Image:
    """The picture (square, RGB) with each mark's target, line and label drawn over it."""
    size_px = image.width
    angles = np.linspace(0, 2 * math.pi, 25)[:-1]
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))], axis=1)
    places = [np.array(mark.position_m) for mark in marks]
    centers = [tuple(camera.to_pixels(place[None], size_px)[0].tolist()) for place in places]
    radius = max(_LABEL_RADIUS * size_px, _LEAST_LABEL_PX)
    labels = _label_places(centers, radius, size_px)
    layer = Image.new("RGBA", (size_px * _SUPERSAMPLE,) * 2)
    draw = ImageDraw.Draw(layer)
    rim = max(_RIM * size_px, 1.0) * _SUPERSAMPLE

    def scaled(point: Sequence[float]) -> Point:
        return point[0] * _SUPERSAMPLE, point[1] * _SUPERSAMPLE

    for center, label in zip(centers, labels, strict=True):
        ends = [scaled(center), scaled(label)]
        draw.line(ends, fill=_DARK, width=round(2.6 * rim))
        draw.line(ends, fill=_LIGHT, width=max(1, round(1.1 * rim)))
    for center, place in zip(centers, places, strict=True):
        ring = camera.to_pixels(place + _TARGET_RADIUS_M * circle, size_px)
        for reach, color in ((1.0, _DARK), (0.8, _LIGHT), (_DOT_SHARE, _DARK)):
            outline = np.array(center) + reach * (ring - np.array(center))
            draw.polygon([scaled(corner) for corner in outline.tolist()], fill=color)
        outer = [scaled(corner) for corner in ring.tolist()]
        draw.line([*outer, outer[0]], fill=_DARK, width=max(1, round(0.6 * rim)))
    font = ImageFont.load_default(size=_LETTER * radius * _SUPERSAMPLE)
    for mark, label in zip(marks, labels, strict=True):
        x, y = scaled(label)
        outer_px = radius * _SUPERSAMPLE
        for reach_px, color in ((outer_px, _DARK), (outer_px - rim, _LIGHT)):
            draw.ellipse((x - reach_px, y - reach_px, x + reach_px, y + reach_px), fill=color)
        low = draw.textbbox((0, 0), mark.letter, font=font)
        left, top = x - (low[0] + low[2]) / 2, y - (low[1] + low[3]) / 2
        draw.text((left, top), mark.letter, fill=_DARK, font=font)
    return Image.alpha_composite(image.convert("RGBA"), layer.reduce(_SUPERSAMPLE)).convert("RGB")


def _label_places(centers: Sequence[Point], radius: float, size_px: int) -> list[Point]:
    """The centers of labels: each is moved to its best place in turn, until none moves."""

    def beside(center: Point, angle_deg: float, distance: float) -> Point:
        angle, far = math.radians(angle_deg), distance * radius
        return center[0] + far * math.cos(angle), center[1] - far * math.sin(angle)

    def from_line(point: Point, center: Point, place: Point) -> float:
        """Distance from the line between target and label."""
        along = (place[0] - center[0], place[1] - center[1])
        length = math.hypot(*along)
        inside = (point[0] - center[0]) * along[0] + (point[1] - center[1]) * along[1]
        share = min(1.0, max(0.0, inside / length**2))
        return math.dist(point, (center[0] + share * along[0], center[1] + share * along[1]))

    def cost(number: int, place: Point) -> float:
        """Cost of a label's place on an edge, a label or a target, or of its line on one."""
        center, whole = centers[number], 0.0
        if not all(1.2 * radius <= one <= size_px - 1.2 * radius for one in place):
            whole += 4 * _BLOCKED
        for label in chosen[:number] + chosen[number + 1 :]:
            whole += 3 * _BLOCKED * (math.dist(place, label) < 2.5 * radius)
            whole += 2 * _BLOCKED * (from_line(label, center, place) < 1.3 * radius)
        for target in (*centers[:number], *centers[number + 1 :]):
            whole += 2 * _BLOCKED * (math.dist(place, target) < 1.9 * radius)
            whole += _BLOCKED * (from_line(target, center, place) < 0.7 * radius)
        return whole

    chosen = [beside(center, 90, 2.1) for center in centers]
    for _ in range(_ROUNDS):
        before = list(chosen)
        for number, center in enumerate(centers):
            options = []
            for far, index in product(range(len(_DISTANCES)), range(len(_ANGLES_DEG))):
                place = beside(center, _ANGLES_DEG[index], _DISTANCES[far])
                # Distance from the target costs, and so does a place that is not above it.
                options.append((cost(number, place) + (10 * far + index), place))
            chosen[number] = min(options)[1]
        if chosen == before:
            break
    return chosen


@functools.lru_cache(maxsize=48)
def seen(recipe: QuestionPicture) -> Shot:
    """The blocks of a picture from its camera, `SEEN_PX` squared, without floor and marks."""
    return pictures.shoot(drawn_blocks(recipe), question_camera(recipe, _STYLE), SEEN_PX)


def changed_pixels(one: Shot, other: Shot) -> NDArray[np.bool_]:
    """The pixels that differ by more than a tenth of the scale in some channel, shape of both."""
    step = np.abs(_colors(one) - _colors(other)) > _VISIBLE_STEP
    return step[..., 0] | step[..., 1] | step[..., 2]


@functools.lru_cache(maxsize=48)
def _colors(shot: Shot) -> NDArray[np.int16]:
    """Colors, with white floor pixels."""
    colors = shot.rgb.astype(np.int16)
    colors[shot.block < 0] = 255
    return colors


def least_difference(shots: Sequence[Shot]) -> int:
    """The least number of pixels in which any two of at least two pictures differ."""
    return min(int(changed_pixels(*pair).sum()) for pair in combinations(shots, 2))


def shown_pixels(recipe: QuestionPicture, shot: Shot) -> dict[int, int]:
    """For each block's order, the number of pixels that show it."""
    counts = np.bincount(shot.block[shot.block >= 0], minlength=len(recipe.blocks))
    return {b.order: int(n) for b, n in zip(recipe.blocks, counts, strict=True)}


def filled(recipe: QuestionPicture) -> float:
    """The share of a picture that its blocks fill."""
    return float((seen(replace(recipe, marks=())).block >= 0).mean())


def is_inside(recipe: QuestionPicture) -> bool:
    """True if no block or mark comes near the picture's edge."""
    points = [pictures.drawn_m(block) for block in drawn_blocks(recipe)]
    points += [np.array([mark.position_m]) for mark in recipe.marks]
    return bool(np.abs(question_camera(recipe, _STYLE).project(np.vstack(points))).max() < _EDGE)


def block_mark(recipe: QuestionPicture, shot: Shot, order: int, letter: str) -> Mark | None:
    """A mark at the center of the visible part of a block; None if too little is visible."""
    vertex = next(i for i, block in enumerate(recipe.blocks) if block.order == order)
    # The pixels that remain longest as the mask is eroded.
    depth, last, left = 0, shot.block == vertex, shot.block == vertex
    while left.any():
        depth, last = depth + 1, left
        wide = np.pad(left, 1)
        left = left & wide[2:, 1:-1] & wide[:-2, 1:-1] & wide[1:-1, 2:] & wide[1:-1, :-2]
    if depth < _LEAST_DEPTH_PX:
        return None
    rows, columns = np.nonzero(last)
    middle = np.argmin((rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2)
    # Where the ray through that pixel first meets the block (Moeller-Trumbore).
    block, camera = drawn_blocks(recipe)[vertex], question_camera(recipe, _STYLE)
    across = ((int(columns[middle]) + 0.5) / SEEN_PX * 2 - 1) * HALF_TANGENT
    up = (1 - (int(rows[middle]) + 0.5) / SEEN_PX * 2) * HALF_TANGENT
    ray = camera.axes[0] * across + camera.axes[1] * up + camera.axes[2]
    corners = pictures.drawn_m(block)[drawn_mesh(block.type).triangles]
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
    return Mark(letter, (x, y, z))


def mark_pixel(recipe: QuestionPicture, position_m: tuple[float, float, float]) -> tuple[int, int]:
    """The pixel (row, column) of `SEEN_PX` at a point of the world, the nearest one inside."""
    column, row = question_camera(recipe, _STYLE).to_pixels(np.array([position_m]), SEEN_PX)[0]
    return int(np.clip(row, 0, SEEN_PX - 1)), int(np.clip(column, 0, SEEN_PX - 1))


def seen_order(
    recipe: QuestionPicture, shot: Shot, position_m: tuple[float, float, float]
) -> int | None:
    """Order of the block that is visible at a point of the world; None for the floor."""
    vertex = int(shot.block[mark_pixel(recipe, position_m)])
    return recipe.blocks[vertex].order if vertex >= 0 else None
