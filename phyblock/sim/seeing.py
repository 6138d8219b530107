"""What can be told from a question's picture: differences in pixels, and blocks that show.

Pictures are compared as the renderer gives them at 256 pixels, before floor and smoothing, which
add nothing that tells two of them apart.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.question import Mark, QuestionPicture
from phyblock.sim.camera import Camera
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import drawn_blocks, question_camera
from phyblock.sim.registry import renderer
from phyblock.sim.render import DrawnBlock, Shot, shoot
from phyblock.sim.renderer import Renderer

__all__ = [
    "MARKS_APART_PX",
    "SEEN_PX",
    "Top",
    "block_mark",
    "changed_pixels",
    "differing_pixels",
    "is_apart",
    "is_inside",
    "least_difference",
    "mark_pixel",
    "seen",
    "seen_order",
    "shown_pixels",
    "surface_at",
    "visible_tops",
]

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
    return _seen(recipe, renderer())


@functools.lru_cache(maxsize=48)
def _camera(recipe: QuestionPicture) -> Camera:
    return question_camera(recipe, _STYLE)


@functools.lru_cache(maxsize=48)
def _seen(recipe: QuestionPicture, drawn_by: Renderer) -> Shot:
    return shoot(drawn_blocks(recipe), _camera(recipe), SEEN_PX, drawn_by)


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
