"""The kit sheet: every candidate with its number, its dimensions, and the middle of its box."""

from __future__ import annotations

import math
from dataclasses import astuple, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.candidates import CandidateSet
from phyblock.sim.backgrounds import TONES
from phyblock.sim.camera import Camera
from phyblock.sim.compose import GRID_COLUMNS, numbered_grid, to_png
from phyblock.sim.pictures import (
    LARGEST_PX,
    PictureStyle,
    candidate_camera,
    common_distance_m,
    empty_cell,
    on_the_floor,
    picture_key,
    thumbnail,
)
from phyblock.sim.registry import renderer
from phyblock.sim.render import DrawnBlock

__all__ = ["KIT_VERSION", "box_cm", "kit_key", "kit_png", "written_style"]

KIT_VERSION = 1
"""Raised whenever the sheet comes out otherwise, so that stored pictures are made again."""

_GROWTH = 1.5
_CM = 100.0
_TEXT, _MARGIN, _DOT = 0.105, 0.04, 0.035


def written_style(style: PictureStyle) -> PictureStyle:
    """The style of pictures that are written on: half as large again, so that it can be read."""
    return replace(style, size_px=min(math.ceil(style.size_px * _GROWTH), LARGEST_PX))


def kit_png(candidates: CandidateSet, style: PictureStyle) -> bytes:
    """PNG of the sheet, square, 4 by 4 cells, seen from where the style says."""
    cell_px = math.ceil(style.size_px / GRID_COLUMNS)
    blocks = [on_the_floor(c.type, c.color, c.euler_deg) for c in candidates.candidates]
    distance_m = common_distance_m(blocks, style) if style.candidate_scale == "common" else None
    cells = [thumbnail(block, style, cell_px, distance_m, renderer()) for block in blocks]
    empty = empty_cell(style, cell_px)
    sheet = numbered_grid(cells, empty, style.background, style.size_px)
    for place, block in enumerate(blocks):
        row, column = divmod(place, GRID_COLUMNS)
        side = style.size_px / GRID_COLUMNS
        corner = (column * side, row * side)
        _write(sheet, block, candidate_camera(block, style, distance_m), corner, side, style)
    return to_png(sheet)


def kit_key(candidates: CandidateSet, style: PictureStyle) -> str:
    """SHA-256 [hex] of all that the sheet depends on."""
    content = [astuple(candidate) for candidate in candidates.candidates]
    return picture_key("kit", style, [KIT_VERSION, style.candidate_scale, *content])


def box_cm(block: DrawnBlock) -> NDArray[np.float64]:
    """Low and high corner of the smallest box round a block as it is drawn, shape (2, 3) [cm]."""
    points = block.vertices_m * _CM
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _write(
    sheet: Image.Image,
    block: DrawnBlock,
    camera: Camera,
    corner: tuple[float, float],
    side: float,
    style: PictureStyle,
) -> None:
    low, high = box_cm(block)
    draw, ink = ImageDraw.Draw(sheet), TONES[style.background].ink
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
