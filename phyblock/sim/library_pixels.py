"""What the picture library draws, told by a drawing and not by a version number.

Letters, numbers, lines, scaling and PNG compression are the library's. Two versions that draw all
of them alike give the same pictures, so that what was made with one is good under the other.
"""

from __future__ import annotations

import functools
import io

from PIL import Image, ImageDraw, ImageFont

from phyblock.stable import hex_digest

__all__ = ["library_pixels"]

_SIDE_PX = 96
_TEXT = "0123456789 ABCD"
_DIGITS = 16


@functools.cache
def library_pixels() -> str:
    """Hex digest, 16 digits, of a PNG file in which all that pictures use is used."""
    layer = Image.new("RGBA", (2 * _SIDE_PX, 2 * _SIDE_PX))
    draw = ImageDraw.Draw(layer)
    draw.ellipse((10, 20, 90, 110), (216, 49, 49, 120), (20, 24, 32, 255), 5)
    draw.polygon([(100, 30), (180, 50), (120, 160)], (40, 120, 60, 255))
    draw.line([(5, 180), (185, 130)], (20, 24, 32, 255), 7)
    draw.rectangle((20, 120, 60, 170), outline=(255, 255, 255, 255), width=3)
    small = layer.resize((_SIDE_PX, _SIDE_PX), Image.Resampling.LANCZOS)
    sheet = Image.new("RGB", (_SIDE_PX, _SIDE_PX), (130, 150, 170))
    sheet.paste(small, (0, 0), small)
    for size, y in ((13.5, 4), (9.2, 40), (21.0, 60)):
        font = ImageFont.load_default(size=size)
        ImageDraw.Draw(sheet).text((2, y), _TEXT, (20, 24, 32), font, stroke_width=1)
    sheet.paste(sheet.resize((41, 37)), (50, 50))
    sheet.paste(sheet.resize((31, 33), Image.Resampling.BOX), (0, 60))
    buffer = io.BytesIO()
    sheet.save(buffer, format="PNG", optimize=False, compress_level=6)
    return hex_digest(buffer.getvalue())[:_DIGITS]
