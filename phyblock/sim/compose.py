"""Putting pictures together: PNG bytes, the numbered grid, the composite of goal and grid."""

from __future__ import annotations

import io
from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

from phyblock.sim.surfaces import SURFACES
from phyblock.words import Background

__all__ = [
    "GRID_COLUMNS",
    "LABEL_STRIP",
    "ink_on",
    "joined_size_px",
    "numbered_grid",
    "side_by_side",
    "to_png",
]

GRID_COLUMNS = 4
LABEL_STRIP = 0.23
"""Share of a cell's height, at its foot, that is kept free for the number."""
_LABEL_SIZE = 0.17
_LABEL_MARGIN = 0.05
_RIM = 0.012
_GAP = 0.016
_DARK_INK, _LIGHT_INK = (20, 24, 32), (255, 255, 255)
_INK: dict[Background, tuple[int, int, int]] = {
    "white": _DARK_INK,
    "checkerboard": _LIGHT_INK,
    "light-wood": _DARK_INK,
    "dark-wood": _LIGHT_INK,
    "concrete": _DARK_INK,
    "lawn": _LIGHT_INK,
}
_LINE: dict[Background, tuple[int, int, int]] = {
    "white": (205, 208, 214),
    "checkerboard": (62, 80, 100),
    "light-wood": (138, 104, 70),
    "dark-wood": (150, 116, 88),
    "concrete": (98, 98, 96),
    "lawn": (158, 180, 120),
}


def ink_on(background: Background) -> tuple[int, int, int]:
    """The color of writing that reads well on a background."""
    return _INK[background]


def to_png(image: Image.Image) -> bytes:
    """The image as PNG; the same pixels always give the same bytes (no time, no metadata)."""
    buffer = io.BytesIO()
    image.save(buffer, format="PNG", optimize=False, compress_level=6)
    return buffer.getvalue()


def numbered_grid(
    cells: Sequence[Image.Image], empty: Image.Image, background: Background, size_px: int
) -> Image.Image:
    """Cells in a 4 by 4 grid from the top left, numbered from 1; the rest shows `empty`."""
    grid = Image.new("RGB", (size_px, size_px))
    edges = [round(i * size_px / GRID_COLUMNS) for i in range(GRID_COLUMNS + 1)]
    for place in range(GRID_COLUMNS**2):
        row, column = divmod(place, GRID_COLUMNS)
        box = (edges[column], edges[row], edges[column + 1], edges[row + 1])
        cell = cells[place].copy() if place < len(cells) else empty.copy()
        if place < len(cells):
            _write_number(cell, place + 1, background)
        grid.paste(cell.resize((box[2] - box[0], box[3] - box[1])), box[:2])
    draw = ImageDraw.Draw(grid)
    for edge in edges[1:-1]:
        draw.line([(edge, 0), (edge, size_px)], fill=_LINE[background])
        draw.line([(0, edge), (size_px, edge)], fill=_LINE[background])
    return grid


def side_by_side(left: Image.Image, right: Image.Image) -> Image.Image:
    """Two pictures of one height with a narrow white gap between them."""
    gap = _gap_px(left.height)
    joined = Image.new("RGB", (left.width + gap + right.width, left.height), "white")
    joined.paste(left, (0, 0))
    joined.paste(right, (left.width + gap, 0))
    return joined


def joined_size_px(side_px: int) -> tuple[int, int]:
    """Width and height of two squares side by side."""
    return 2 * side_px + _gap_px(side_px), side_px


def _gap_px(height_px: int) -> int:
    return max(2, round(height_px * _GAP))


def _write_number(cell: Image.Image, number: int, background: Background) -> None:
    """The number at the foot of the cell; on a floor with a grain, with a rim around it."""
    side = cell.height
    font = ImageFont.load_default(size=_LABEL_SIZE * side)
    place = (side * (1 - _LABEL_MARGIN), side * (1 - _LABEL_MARGIN))
    ink = _INK[background]
    rim = _DARK_INK if ink == _LIGHT_INK else _LIGHT_INK
    width = round(side * _RIM) if background in SURFACES else 0
    ImageDraw.Draw(cell).text(
        place, str(number), ink, font, anchor="rs", stroke_width=width, stroke_fill=rim
    )
