"""An episode as pictures: the goal, the candidate that was tried, and the assembly after it."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from PIL import Image, ImageDraw, ImageFont

from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Block, Scene
from phyblock.sim.assembly import animated
from phyblock.sim.compose import GRID_COLUMNS, to_png
from phyblock.sim.pictures import PictureStyle, candidates_png
from phyblock.sim.site import Lookout

__all__ = ["FilmStep", "Tone", "episode_gif", "episode_images", "episode_sheet"]

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
_GAP = 0.02
_FRAME = 0.012
_STEP_MS = 900
_END_MS = 2600
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
    times = [_STEP_MS] * (len(images) - 1) + [_END_MS]
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
