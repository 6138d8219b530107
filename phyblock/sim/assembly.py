"""Pictures of an assembly: a filmstrip of its steps, and an animation.

Every step is seen by one camera, which frames the finished structure, so that nothing jumps.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import Literal

from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.scene import Scene
from phyblock.errors import DataError, Problem
from phyblock.sim.backgrounds import TONES
from phyblock.sim.compose import to_png
from phyblock.sim.pictures import PictureStyle, drawn, goal_camera
from phyblock.sim.render import picture

__all__ = ["animated", "animation", "filmstrip_png", "step_images"]

_MOST_COLUMNS = 6
_GAP = 0.02
_CAPTION = 0.11
_STEP_MS = 650
_END_MS = 2200


def step_images(scene: Scene, style: PictureStyle) -> list[Image.Image]:
    """The structure after each step, in the stored order; the last is the goal picture.

    Raises DataError when the stored order places a block before one that it depends on, or when
    there is no block.
    """
    camera, blocks = goal_camera(scene, style), drawn(scene)
    if not scene.graph.is_valid(range(len(scene))):
        message = "places a block before one that it depends on"
        raise DataError(Problem(scene.id, message, "order of blocks"))
    return [
        picture(blocks[: count + 1], camera, style.background, style.size_px)
        for count in range(len(blocks))
    ]


def filmstrip_png(scene: Scene, style: PictureStyle) -> bytes:
    """PNG of all steps, numbered from 1 on a strip above each picture, in rows of up to six.

    Each picture is `style.size_px` squared; raises as `step_images`.
    """
    images = step_images(scene, style)
    side = style.size_px
    caption, gap = math.ceil(side * _CAPTION), max(2, round(side * _GAP))
    rows = math.ceil(len(images) / _MOST_COLUMNS)
    columns = math.ceil(len(images) / rows)
    width = columns * (side + gap) - gap
    strip = Image.new("RGB", (width, rows * (side + caption + gap) - gap), "white")
    for number, image in enumerate(images):
        row, column = divmod(number, columns)
        place = (column * (side + gap), row * (side + caption + gap))
        _write(strip, str(number + 1), (place[0] + side / 2, place[1] + caption / 2), caption * 0.8)
        strip.paste(image, (place[0], place[1] + caption))
    return to_png(strip)


def animation(scene: Scene, style: PictureStyle, kind: Literal["gif", "webp"] = "gif") -> bytes:
    """The assembly as an animated GIF or WebP that repeats for ever; raises as `step_images`.

    A GIF holds at most 256 colors, chosen once over all its pictures; a WebP is lossless.
    """
    images = step_images(scene, style)
    times = [_STEP_MS] * (len(images) - 1) + [_END_MS]
    return animated(images, times, kind, images[-1])


def animated(
    images: Sequence[Image.Image],
    times_ms: Sequence[int],
    kind: Literal["gif", "webp"],
    colorful: Image.Image,
) -> bytes:
    """Images shown for so long each [ms], over and over.

    A GIF takes its 256 colors from `colorful`, once for all images, so that nothing flickers.
    """
    options: dict[str, bool | int] = {"lossless": True}
    if kind == "gif":
        images, options = _one_palette(images, colorful), {"disposal": 1, "optimize": False}
    buffer = io.BytesIO()
    images[0].save(
        buffer,
        kind.upper(),
        save_all=True,
        append_images=images[1:],
        duration=list(times_ms),
        loop=0,
        **options,
    )
    return buffer.getvalue()


def _one_palette(images: Sequence[Image.Image], colorful: Image.Image) -> list[Image.Image]:
    palette = colorful.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    return [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]


def _write(image: Image.Image, text: str, middle: tuple[float, float], size: float) -> None:
    font = ImageFont.load_default(size=size)
    ImageDraw.Draw(image).text(middle, text, TONES["white"].ink, font, anchor="mm")
