"""The picture that a link or a result is shared with."""

from __future__ import annotations

import textwrap

from PIL import Image, ImageDraw, ImageFont

from phyblock.sim.pictures import to_png

_SIZE = (1200, 630)
_MARGIN = 50


def card_png(title: str, text: str, picture: Image.Image | None) -> bytes:
    """Return a PNG of 1200 x 630 pixels: a title, lines of text, and a picture beside or below."""
    card = Image.new("RGB", _SIZE, "#ffffff")
    is_wide = picture is not None and picture.width > picture.height
    if picture is not None:
        card.paste(picture, ((_SIZE[0] - picture.width) // 2, 300) if is_wide else (605, 35))
    draw, top = ImageDraw.Draw(card), 40 if is_wide else 110
    columns = (40, 66) if is_wide else (18, 30)
    for said, size, color, width in zip(
        (title, text), (58, 36), ("#16181d", "#3a4cc4"), columns, strict=True
    ):
        for line in (part for whole in said.splitlines() for part in textwrap.wrap(whole, width)):
            draw.text((_MARGIN, top), line, color, ImageFont.load_default(size))
            top += round(1.25 * size)
        top += 36 if not is_wide else 12
    return to_png(card)
