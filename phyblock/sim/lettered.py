"""Four pictures on one sheet, each with its letter: options for models that take one picture."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

from phyblock.files import decode_picture
from phyblock.sim.compose import to_png

__all__ = ["LETTERED_VERSION", "lettered_sheet_png", "sheet_size_px"]

LETTERED_VERSION = 1
"""Raised whenever the same pictures give another sheet, so that stored sheets are made again."""

_COLUMNS = 2
_GAP = 0.016
_BADGE = 0.11
_MARGIN = 0.02
_DARK, _LIGHT = (20, 24, 32), (255, 255, 255)


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
        box, radius=side // 5, fill=_LIGHT, outline=_DARK, width=max(1, side // 24)
    )
    font = ImageFont.load_default(size=0.78 * side)
    middle = (start + side / 2, start + side / 2)
    draw.text(middle, letter, _DARK, font=font, anchor="mm")
