"""Pictures for people: an assembly step by step, an episode as film, exploded and marked views.

Every step of an assembly is seen by one camera, which frames the finished structure, so that
nothing jumps. A frame of an episode shows the goal, the candidates with the one that was tried, and
the assembly after it.
"""

from __future__ import annotations

import io
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.scene import Block, CandidateSet, Scene
from phyblock.errors import DataError, Problem
from phyblock.sim.backgrounds import DARK_INK, floor
from phyblock.sim.pictures import (
    GRID_COLUMNS,
    SUPERSAMPLE,
    DrawnBlock,
    Lookout,
    PictureStyle,
    camera_for,
    candidates_grid,
    drawn,
    goal_camera,
    picture,
    shoot,
    to_png,
)
from phyblock.sim.raster import Rgb

Tone = Literal["plain", "good", "bad"]

_MOST_COLUMNS = 6
_GAP = 0.02
_CAPTION = 0.11
_STEP_MS, _END_MS = 650, 2200
_RISE_M = 0.035
_SPREAD = 0.55
_FADE = 0.68
_INK: dict[Tone, Rgb] = {"plain": (40, 44, 52), "good": (28, 122, 52), "bad": (192, 32, 32)}
_RING: dict[Tone, Rgb] = {"plain": (230, 232, 236), "good": (64, 214, 96), "bad": (255, 64, 64)}
"""Round a candidate, on a dark floor or a light one."""
_STRIP = 0.13
_FRAME = 0.012
_FRAME_MS, _LAST_FRAME_MS = 900, 2600


def step_images(scene: Scene, style: PictureStyle) -> list[Image.Image]:
    """The structure after each step, in the stored order; the last is the goal picture.

    Raises DataError when the stored order places a block before one that it depends on, or when
    there is no block.
    """
    camera, blocks = goal_camera(scene, style), drawn(scene.blocks)
    if not scene.graph.is_valid(range(len(scene))):
        message = "places a block before one that it depends on"
        raise DataError(Problem(scene.id, message, "order of blocks"))
    counts = range(1, len(blocks) + 1)
    return [picture(blocks[:n], camera, style.background, style.size_px) for n in counts]


def filmstrip_png(scene: Scene, style: PictureStyle) -> bytes:
    """PNG of all steps, numbered from 1 on a strip above each picture, in rows of up to six.

    Each picture is `style.size_px` squared; raises as `step_images`.
    """
    images = step_images(scene, style)
    side = style.size_px
    caption, gap = math.ceil(side * _CAPTION), max(2, round(side * _GAP))
    rows = math.ceil(len(images) / _MOST_COLUMNS)
    columns = math.ceil(len(images) / rows)
    size = (columns * (side + gap) - gap, rows * (side + caption + gap) - gap)
    strip = Image.new("RGB", size, "white")
    font, draw = ImageFont.load_default(size=caption * 0.8), ImageDraw.Draw(strip)
    for number, image in enumerate(images):
        row, column = divmod(number, columns)
        x, y = column * (side + gap), row * (side + caption + gap)
        middle = (x + side / 2, y + caption / 2)
        draw.text(middle, str(number + 1), DARK_INK, font, anchor="mm")
        strip.paste(image, (x, y + caption))
    return to_png(strip)


def animation(scene: Scene, style: PictureStyle, kind: Literal["gif", "webp"] = "gif") -> bytes:
    """The assembly as an animated GIF or WebP that repeats for ever; raises as `step_images`.

    A GIF holds at most 256 colors, chosen once over all its pictures; a WebP is lossless.
    """
    images = step_images(scene, style)
    return _animated(images, _STEP_MS, _END_MS, kind, images[-1])


def _animated(
    images: Sequence[Image.Image], each_ms: int, last_ms: int, kind: str, colorful: Image.Image
) -> bytes:
    """Images shown for so long each [ms], over and over.

    A GIF takes its 256 colors from `colorful`, once for all images, so that nothing flickers.
    """
    options: dict[str, Any] = {"lossless": True}
    if kind == "gif":
        palette = colorful.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
        images = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in images]
        options = {"disposal": 1, "optimize": False}
    buffer, times_ms = io.BytesIO(), [each_ms] * (len(images) - 1) + [last_ms]
    options |= {"save_all": True, "append_images": images[1:], "duration": times_ms, "loop": 0}
    images[0].save(buffer, kind.upper(), **options)
    return buffer.getvalue()


def exploded_png(scene: Scene, style: PictureStyle) -> bytes:
    """PNG of the structure pulled apart; raises DataError for a scene without blocks."""
    blocks = exploded_blocks(scene)
    camera = camera_for(blocks, style, scene.id)
    return to_png(picture(blocks, camera, style.background, style.size_px))


def exploded_blocks(scene: Scene) -> list[DrawnBlock]:
    """The blocks pulled apart: what stands over something else moves away from it, upward.

    A block rises by 35 mm for each height below its own at which some block begins, and moves
    out from the structure's axis by 55 % of its distance.
    """
    blocks = drawn(scene.blocks)
    bottoms = [round(float(block.vertices_m[:, 2].min()), 3) for block in blocks]
    heights = sorted(set(bottoms))
    places = np.array([block.position_m[:2] for block in blocks]).reshape(-1, 2)
    apart = []
    for block, bottom in zip(blocks, bottoms, strict=True):
        x, y, z = block.position_m
        middle_x, middle_y = (places.min(axis=0) + places.max(axis=0)) / 2
        out_x, out_y = float(x - middle_x) * _SPREAD, float(y - middle_y) * _SPREAD
        place = (x + out_x, y + out_y, z + _RISE_M * heights.index(bottom))
        apart.append(replace(block, position_m=place))
    return apart


def marked_png(scene: Scene, orders: Collection[int], style: PictureStyle) -> bytes:
    """The goal picture with every block faded into the floor but those named in `orders`.

    With none to name nothing is faded. Raises DataError for a scene without blocks.
    """
    camera, blocks = goal_camera(scene, style), drawn(scene.blocks)
    image = picture(blocks, camera, style.background, style.size_px)
    named = np.array([block.order in orders for block in scene.blocks])
    if not named.any():
        return to_png(image)
    seen = shoot(blocks, camera, style.size_px * SUPERSAMPLE).block
    faded = (seen >= 0) & ~named[seen]
    share = faded.reshape(style.size_px, SUPERSAMPLE, style.size_px, SUPERSAMPLE).mean(axis=(1, 3))
    below = floor(style.background, camera, style.size_px)
    pixels = np.asarray(image, dtype=np.float32)
    pixels = pixels + (below - pixels) * (_FADE * share[..., None])
    return to_png(Image.fromarray(np.rint(pixels).astype(np.uint8)))


@dataclass(frozen=True)
class FilmStep:
    """One frame: its caption and tone, the candidate that it is about, and the blocks then."""

    caption: str
    tone: Tone
    candidate: int | None
    blocks: tuple[Block, ...]


def episode_images(
    scene: Scene, candidates: CandidateSet, steps: Sequence[FilmStep], style: PictureStyle
) -> list[Image.Image]:
    """A frame a step: three squares of the style's size under a strip with the caption."""
    side, lookout = style.size_px, Lookout(scene, style)
    gap, strip = max(2, round(side * _GAP)), math.ceil(side * _STRIP)
    font = ImageFont.load_default(size=strip * 0.6)
    goal, (numbered, _, _) = lookout.image(scene.blocks), candidates_grid(candidates, style)
    seen: dict[tuple[Block, ...], Image.Image] = {}
    frames = []
    for step in steps:
        if step.blocks not in seen:
            seen[step.blocks] = lookout.image(step.blocks)
        marked = numbered.copy()
        if step.candidate is not None and 1 <= step.candidate <= GRID_COLUMNS**2:
            row, column = divmod(step.candidate - 1, GRID_COLUMNS)
            cell = side / GRID_COLUMNS
            box = [column * cell, row * cell, (column + 1) * cell - 1, (row + 1) * cell - 1]
            width = max(2, round(side * _FRAME))
            ImageDraw.Draw(marked).rectangle(box, outline=_RING[step.tone], width=width)
        frame = Image.new("RGB", (3 * (side + gap) - gap, side + strip), "white")
        for place, square in enumerate((goal, marked, seen[step.blocks])):
            frame.paste(square, (place * (side + gap), strip))
        ink = _INK[step.tone]
        ImageDraw.Draw(frame).text((gap, strip / 2), step.caption, ink, font, anchor="lm")
        frames.append(frame)
    return frames


def episode_gif(images: Sequence[Image.Image]) -> bytes:
    """Frames as an animated GIF that repeats for ever, the last one longer."""
    # Frames of every tone have a part in the colors: the first, the middle and the last ones.
    chosen = [images[0], images[len(images) // 2], images[-1]]
    width, height = images[0].size
    step = height + max(2, round(height * _GAP))
    sheet = Image.new("RGB", (width, 2 * step + height), "white")
    for place, image in enumerate(chosen):
        sheet.paste(image, (0, place * step))
    return _animated(images, _FRAME_MS, _LAST_FRAME_MS, "gif", sheet)
