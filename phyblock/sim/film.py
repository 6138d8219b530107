"""Films for people: an assembly step by step, an episode with its attempts.

One camera, which frames the finished structure, shows every step. A frame of an episode shows the
goal, the candidates with the attempted one marked, and the assembly after it.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.scene import Block, CandidateSet, Scene
from phyblock.errors import DataError, Problem
from phyblock.sim.pictures import (
    GRID_COLUMNS,
    Lookout,
    PictureStyle,
    candidates_grid,
    goal_camera,
    picture,
)
from phyblock.sim.raster import Rgb

Tone = Literal["plain", "good", "bad"]

_GAP = 0.02
_STEP_MS, _END_MS = 650, 2200
_INK: dict[Tone, Rgb] = {"plain": (40, 44, 52), "good": (28, 122, 52), "bad": (192, 32, 32)}
_RING: dict[Tone, Rgb] = {"plain": (230, 232, 236), "good": (64, 214, 96), "bad": (255, 64, 64)}
"""Colors of the ring around a candidate, by tone."""
_STRIP = 0.13
_FRAME = 0.012
_FRAME_MS, _LAST_FRAME_MS = 900, 2600


def assembly_gif(scene: Scene, style: PictureStyle) -> bytes:
    """The assembly in the stored order as a GIF. Raises DataError if that order is not valid."""
    camera = goal_camera(scene, style)
    if not scene.graph.is_valid(range(len(scene))):
        message = "places a block before one that it depends on"
        raise DataError(Problem(scene.id, message, "order of blocks"))
    counts, shown = range(1, len(scene) + 1), (camera, style.background, style.size_px)
    images = [picture(scene.blocks[:n], *shown) for n in counts]
    return _gif(images, _STEP_MS, _END_MS)


def _gif(images: Sequence[Image.Image], each_ms: int, last_ms: int) -> bytes:
    """An animated GIF of images with these durations [ms], which repeats."""
    # The palette is made from frames of every tone: the first, the middle and the last ones.
    chosen = np.concatenate([images[0], images[len(images) // 2], images[-1]])
    colorful = Image.fromarray(chosen)
    palette = colorful.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    images = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in images]
    buffer, times_ms = io.BytesIO(), [each_ms] * (len(images) - 1) + [last_ms]
    more = {"save_all": True, "append_images": images[1:], "loop": 0, "disposal": 1}
    images[0].save(buffer, "GIF", duration=times_ms, optimize=False, **more)
    return buffer.getvalue()


@dataclass(frozen=True)
class FilmStep:
    """One frame: its caption and tone, its candidate, and the blocks at that time.

    `note` is not drawn.
    """

    caption: str
    tone: Tone
    candidate: int | None
    blocks: tuple[Block, ...]
    note: str = ""


def episode_images(
    scene: Scene, candidates: CandidateSet, steps: Sequence[FilmStep], style: PictureStyle
) -> list[Image.Image]:
    """One frame per step: three squares of the style's size under a strip with the caption."""
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
    """Frames as an animated GIF that repeats forever, with a longer last frame."""
    return _gif(images, _FRAME_MS, _LAST_FRAME_MS)
