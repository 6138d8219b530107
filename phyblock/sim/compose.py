"""Putting pictures together: PNG bytes, the numbered grid, the composite of goal and grid."""

from __future__ import annotations

import io
from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

from phyblock.sim.backgrounds import DARK_INK, LIGHT_INK, TONES
from phyblock.sim.surfaces import SURFACES
from phyblock.types import Background

__all__ = [
    "GRID_COLUMNS",
    "LABEL_STRIP",
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
    draw, line = ImageDraw.Draw(grid), TONES[background].line
    for edge in edges[1:-1]:
        draw.line([(edge, 0), (edge, size_px)], fill=line)
        draw.line([(0, edge), (size_px, edge)], fill=line)
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
    ink = TONES[background].ink
    rim = DARK_INK if ink == LIGHT_INK else LIGHT_INK
    width = round(side * _RIM) if background in SURFACES else 0
    ImageDraw.Draw(cell).text(
        place, str(number), ink, font, anchor="rs", stroke_width=width, stroke_fill=rim
    )
