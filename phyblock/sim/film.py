"""Pictures of an assembly: a filmstrip of its steps, and an animation.

Every step is seen by one camera, which frames the finished structure, so that nothing jumps.
"""

from __future__ import annotations

import io
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.scene import Block, CandidateSet, Scene
from phyblock.errors import DataError, Problem
from phyblock.sim.backgrounds import GROUNDS, floor
from phyblock.sim.camera import Camera
from phyblock.sim.pictures import (
    GRID_COLUMNS,
    SUPERSAMPLE,
    DrawnBlock,
    Lookout,
    PictureStyle,
    camera_for,
    candidates_png,
    drawn,
    goal_camera,
    picture,
    shoot,
    to_png,
)

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
    camera, blocks = goal_camera(scene, style), drawn(scene.blocks)
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
    ImageDraw.Draw(image).text(middle, text, GROUNDS["white"].ink, font, anchor="mm")


_RISE_M = 0.035
_SPREAD = 0.55


def exploded_png(scene: Scene, style: PictureStyle) -> bytes:
    """PNG of the structure pulled apart; raises DataError for a scene without blocks."""
    blocks = exploded_blocks(scene)
    camera: Camera = camera_for(blocks, style, scene.id)
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
    moved = []
    for block, bottom in zip(blocks, bottoms, strict=True):
        x, y, z = block.position_m
        middle_x, middle_y = (places.min(axis=0) + places.max(axis=0)) / 2
        out_x, out_y = float(x - middle_x) * _SPREAD, float(y - middle_y) * _SPREAD
        place = (x + out_x, y + out_y, z + _RISE_M * heights.index(bottom))
        moved.append(DrawnBlock(block.type, block.color, place, block.euler_deg))
    return moved


_FADE = 0.68


def marked_png(scene: Scene, orders: Collection[int], style: PictureStyle) -> bytes:
    """The goal picture with every block faded into the floor but those named in `orders`.

    With none to name nothing is faded. Raises DataError for a scene without blocks.
    """
    camera, blocks = goal_camera(scene, style), drawn(scene.blocks)
    image = picture(blocks, camera, style.background, style.size_px)
    named = np.array([block.order in orders for block in scene.blocks])
    if not named.any():
        return to_png(image)
    large_px = style.size_px * SUPERSAMPLE
    seen = shoot(blocks, camera, large_px).block
    faded = (seen >= 0) & ~named[seen]
    share = faded.reshape(style.size_px, SUPERSAMPLE, style.size_px, SUPERSAMPLE).mean(axis=(1, 3))
    below = floor(style.background, camera, style.size_px)
    pixels = np.asarray(image, dtype=np.float32)
    pixels = pixels + (below - pixels) * (_FADE * share[..., None])
    return to_png(Image.fromarray(np.rint(pixels).astype(np.uint8)))


Tone = Literal["plain", "good", "bad"]
_INK: dict[Tone, tuple[int, int, int]] = {
    "plain": (40, 44, 52),
    "good": (28, 122, 52),
    "bad": (192, 32, 32),
}
_RING: dict[Tone, tuple[int, int, int]] = {
    "plain": (230, 232, 236),
    "good": (64, 214, 96),
    "bad": (255, 64, 64),
}
"""Round a candidate, on a dark floor or a light one."""
_STRIP = 0.13

_FRAME = 0.012
_STEP_MS_FILM = 900
_END_MS_FILM = 2600
_SHEET_COLUMNS = 2


@dataclass(frozen=True)
class FilmStep:
    """One frame: what it says, whether that is good, the candidate it is about, the blocks that
    are in the world then, where they are.
    """

    caption: str
    tone: Tone
    candidate: int | None
    blocks: tuple[Block, ...]


def episode_images(
    scene: Scene, candidates: CandidateSet, steps: Sequence[FilmStep], style: PictureStyle
) -> list[Image.Image]:
    """A frame a step: three squares of the style's size under a strip with the caption."""
    lookout = Lookout(scene, style)
    goal = lookout.image(scene.blocks)
    with Image.open(io.BytesIO(candidates_png(candidates, style))) as grid:
        numbered = grid.convert("RGB")
    seen: dict[tuple[Block, ...], Image.Image] = {}
    frames = []
    for step in steps:
        if step.blocks not in seen:
            seen[step.blocks] = lookout.image(step.blocks)
        squares = (goal, _marked(numbered, step), seen[step.blocks])
        frames.append(_frame(squares, step, style.size_px))
    return frames


def episode_gif(images: Sequence[Image.Image]) -> bytes:
    """Frames as an animated GIF that repeats for ever, the last one longer."""
    times = [_STEP_MS_FILM] * (len(images) - 1) + [_END_MS_FILM]
    # Frames of every tone have a part in the colors: the first, the middle and the last ones.
    chosen = [images[0], images[len(images) // 2], images[-1]]
    return animated(images, times, "gif", _stacked(chosen, 1))


def episode_sheet(images: Sequence[Image.Image]) -> bytes:
    """PNG of all frames, from left to right and from top to bottom."""
    return to_png(_stacked(images, _SHEET_COLUMNS))


def _marked(grid: Image.Image, step: FilmStep) -> Image.Image:
    """The candidates with a frame round the one that the step is about."""
    marked = grid.copy()
    if step.candidate is not None and 1 <= step.candidate <= GRID_COLUMNS**2:
        row, column = divmod(step.candidate - 1, GRID_COLUMNS)
        side = grid.width / GRID_COLUMNS
        box = [column * side, row * side, (column + 1) * side - 1, (row + 1) * side - 1]
        width = max(2, round(grid.width * _FRAME))
        ImageDraw.Draw(marked).rectangle(box, outline=_RING[step.tone], width=width)
    return marked


def _frame(squares: Sequence[Image.Image], step: FilmStep, side: int) -> Image.Image:
    gap, strip = max(2, round(side * _GAP)), math.ceil(side * _STRIP)
    width = len(squares) * (side + gap) - gap
    frame = Image.new("RGB", (width, side + strip), "white")
    for place, square in enumerate(squares):
        frame.paste(square, (place * (side + gap), strip))
    font = ImageFont.load_default(size=strip * 0.6)
    ImageDraw.Draw(frame).text((gap, strip / 2), step.caption, _INK[step.tone], font, anchor="lm")
    return frame


def _stacked(images: Sequence[Image.Image], columns: int) -> Image.Image:
    width, height = images[0].size
    gap = max(2, round(height * _GAP))
    rows = math.ceil(len(images) / columns)
    columns = min(columns, len(images))
    size = (columns * (width + gap) - gap, rows * (height + gap) - gap)
    sheet = Image.new("RGB", size, "white")
    for place, image in enumerate(images):
        row, column = divmod(place, columns)
        sheet.paste(image, (column * (width + gap), row * (height + gap)))
    return sheet
