"""A whole question as one picture: text, options and pictures, and nothing of its answer."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.question import LETTERS, Question, is_picture_option
from phyblock.files import decode_picture
from phyblock.making.questions.sheet import Draw
from phyblock.sim.compose import to_png

__all__ = ["blind_png"]

_TEXT_PX, _LINE_PX, _MARGIN_PX, _GAP_PX = 20, 28, 12, 8
_LETTER_PX = 9.5
"""Width of a letter of the text, on average."""
_INK = (20, 24, 32)
_CAPTIONS = {"scene": "first picture", "block": "second picture"}
_LEAST_WIDTH_PX = 720


def blind_png(question: Question, draw: Draw) -> bytes:
    """PNG: the id, the text and its options; below, the scene and the block, then option pictures.

    `draw` gives the PNG of each picture.
    """
    pictures = {picture.label: picture for picture in question.pictures}
    rows = [
        [_captioned(draw(pictures[label]), caption) for label, caption in row if label in pictures]
        for row in (_CAPTIONS.items(), zip(LETTERS, LETTERS, strict=True))
    ]
    shown = [_joined(row) for row in rows if row]
    width = max([_LEAST_WIDTH_PX, *(row.width for row in shown)])
    text = _text(question, width - 2 * _MARGIN_PX)
    whole = Image.new("RGB", (width, sum(part.height for part in (text, *shown))), "white")
    top = 0
    for part in (text, *shown):
        whole.paste(part, (0, top))
        top += part.height
    return to_png(whole)


def _text(question: Question, width_px: int) -> Image.Image:
    lines = [question.id, *textwrap.wrap(question.text, int(width_px / _LETTER_PX))]
    if not all(map(is_picture_option, question.options)):
        lines += [
            f"{letter}. {option}" for letter, option in zip(LETTERS, question.options, strict=True)
        ]
    image = Image.new("RGB", (width_px + 2 * _MARGIN_PX, len(lines) * _LINE_PX + 2 * _MARGIN_PX),
                      "white")  # fmt: skip
    ink, font = ImageDraw.Draw(image), ImageFont.load_default(size=_TEXT_PX)
    for number, line in enumerate(lines):
        ink.text((_MARGIN_PX, _MARGIN_PX + number * _LINE_PX), line, _INK, font=font)
    return image


def _captioned(data: bytes, caption: str) -> Image.Image:
    with decode_picture(data, caption) as picture:
        image = Image.new("RGB", (picture.width + _GAP_PX, picture.height + _LINE_PX), "white")
        image.paste(picture.convert("RGB"), (0, _LINE_PX))
    ImageDraw.Draw(image).text(
        (_MARGIN_PX, 2), caption, _INK, font=ImageFont.load_default(size=_TEXT_PX)
    )
    return image


def _joined(images: Sequence[Image.Image]) -> Image.Image:
    row = Image.new("RGB", (sum(i.width for i in images), max(i.height for i in images)), "white")
    left = 0
    for image in images:
        row.paste(image, (left, 0))
        left += image.width
    return row
