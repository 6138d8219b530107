"""How many tokens providers count for a picture, by OpenAI's published rules.

Other providers count otherwise, most of them less; a budget learns what they really count.
Source: OpenAI's guide to images and vision, section on costs.
"""

from __future__ import annotations

import math
import re

from phyblock.models.base import Image

__all__ = ["picture_tokens"]

_TILES = ((re.compile(r"gpt-4o-mini"), (2833, 5667)),)
_USUAL_TILES = (85, 170)
"""Tokens of a picture, and of each of its tiles of 512 x 512."""

_PATCHES = (
    (re.compile(r"(gpt-4\.1|gpt-5(\.\d+)?)-mini"), 1.62),
    (re.compile(r"(gpt-4\.1|gpt-5(\.\d+)?)-nano"), 2.46),
    (re.compile(r"o4-mini"), 1.72),
)
"""Tokens of each patch of 32 x 32, for models that count patches."""
_MOST_PATCHES = 1536


def picture_tokens(model_id: str, image: Image) -> int:
    """Tokens of a detailed picture; `model_id` may name any provider that serves the model."""
    name = model_id.rpartition("/")[2]
    for pattern, factor in _PATCHES:
        if pattern.match(name):
            patches = math.ceil(image.width_px / 32) * math.ceil(image.height_px / 32)
            return math.ceil(min(patches, _MOST_PATCHES) * factor)
    whole, tile = next((cost for pattern, cost in _TILES if pattern.match(name)), _USUAL_TILES)
    return whole + tile * _tiles(image)


def _tiles(image: Image) -> int:
    """Tiles of a picture fit into 2048 x 2048, then its short side to 768."""
    width, height = float(image.width_px), float(image.height_px)
    scale = min(1.0, 2048 / max(width, height), 768 / min(width, height))
    return math.ceil(width * scale / 512) * math.ceil(height * scale / 512)
