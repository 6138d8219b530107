"""The pictures of questions: a recipe to a PNG, and the key that it caches under.

As with goal pictures, the same recipe and style give the same bytes in every process of one
machine, and the key names everything that the bytes depend on.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import fields, replace

from phyblock.domain.blocks import SHAPES
from phyblock.domain.question import QuestionPicture
from phyblock.domain.scene import Block
from phyblock.sim.camera import Camera, Window, frame, view_axes
from phyblock.sim.compose import to_png
from phyblock.sim.marks import draw_marks
from phyblock.sim.pictures import (
    RENDER_VERSION,
    PictureStyle,
    camera_for,
    on_the_floor,
    pixel_versions,
)
from phyblock.sim.render import DrawnBlock, picture
from phyblock.stable import hex_digest

__all__ = [
    "BLOCK_LABEL",
    "QUESTION_RENDER_VERSION",
    "drawn_blocks",
    "question_camera",
    "question_key",
    "question_png",
]

QUESTION_RENDER_VERSION = 2
"""Raised whenever the same recipe gives other pixels, so that stored pictures are made again."""
BLOCK_LABEL = "block"
"""The label of a picture that shows one block by itself."""

_BLOCK_WINDOW = Window(-0.52, 0.52, -0.52, 0.52)
_LARGEST_DIAGONAL_M = 0.16
_SIZE_CUE = 0.25


def question_png(picture_recipe: QuestionPicture, style: PictureStyle) -> bytes:
    """PNG of a question's picture, square; its view, and background if any, replace the style's.

    Raises DataError for a recipe with nothing to frame, ValueError for a view that a
    `PictureStyle` does not allow.
    """
    camera = question_camera(picture_recipe, style)
    ground = picture_recipe.background or style.background
    image = picture(drawn_blocks(picture_recipe), camera, ground, style.size_px)
    return to_png(draw_marks(image, picture_recipe.marks, camera))


def question_camera(picture_recipe: QuestionPicture, style: PictureStyle) -> Camera:
    """The camera of a question's picture; raises as `question_png`.

    A block shown by itself (label `block`) fills a like share of its picture whatever its type,
    larger ones a little more, as in the pictures of candidates.
    """
    azimuth_deg, elevation_deg = picture_recipe.view_deg
    seen = replace(style, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)
    shown = drawn_blocks(picture_recipe)
    framed = _drawn(picture_recipe.framed) or shown
    if _is_alone(picture_recipe):
        framed = shown
        shape = SHAPES[framed[0].type]
        share = math.dist(shape.low_m, shape.high_m) / _LARGEST_DIAGONAL_M
        window = _BLOCK_WINDOW.scaled(share**_SIZE_CUE)
        return frame(framed[0].vertices_m, view_axes(azimuth_deg, elevation_deg), window)
    return camera_for(framed, seen, picture_recipe.label, shown)


def drawn_blocks(picture_recipe: QuestionPicture) -> list[DrawnBlock]:
    """The blocks as they are drawn; one shown by itself (label `block`) lies on the floor."""
    blocks = _drawn(picture_recipe.blocks)
    if _is_alone(picture_recipe):
        return [on_the_floor(blocks[0].type, blocks[0].color, blocks[0].euler_deg)]
    return blocks


def question_key(picture_recipe: QuestionPicture, style: PictureStyle) -> str:
    """SHA-256 [hex] of all that the picture depends on; of the style, not its own view.

    A label counts only where it changes the framing, so that equal pictures share a file.
    """
    parts = {
        "kind": "question",
        "render_version": [RENDER_VERSION, QUESTION_RENDER_VERSION],
        **pixel_versions(),
        "style": [style.size_px, picture_recipe.background or style.background],
        "view": list(picture_recipe.view_deg),
        "alone": _is_alone(picture_recipe),
        "blocks": _field_values(drawn_blocks(picture_recipe)),
        "framed": _field_values(_drawn(picture_recipe.framed)),
        "marks": [[mark.letter, *mark.position_m] for mark in picture_recipe.marks],
    }
    return hex_digest(json.dumps(parts, sort_keys=True, allow_nan=False))


def _is_alone(picture_recipe: QuestionPicture) -> bool:
    return picture_recipe.label == BLOCK_LABEL and len(picture_recipe.blocks) == 1


def _drawn(blocks: Sequence[Block]) -> list[DrawnBlock]:
    return [DrawnBlock(b.type, b.color, b.position_m, b.euler_deg) for b in blocks]


def _field_values(blocks: Sequence[DrawnBlock]) -> list[list[object]]:
    """All fields of each block; `astuple` would copy what is in them as well."""
    return [[getattr(block, field.name) for field in fields(block)] for block in blocks]
