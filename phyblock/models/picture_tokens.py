"""How many tokens providers count for a picture, by their published rules.

Sources, read in November 2026: OpenAI, guide to images and vision, section on costs (for the small
GPT-5 models what is billed, which is less than the guide says); Anthropic, vision guide, section on
costs; Google, Gemini API guides to token counting and media resolution; xAI, guide to image
understanding; Qwen, model cards of Qwen2.5-VL and Qwen3-VL. Models that no rule names count as
GPT-4o does. A budget learns what a provider really counts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable

from phyblock.models.base import Image

__all__ = ["picture_tokens"]

Count = Callable[[float, float], float]
"""Tokens of a picture of so many pixels in width and height."""


def picture_tokens(model_id: str, image: Image) -> int:
    """Tokens of a picture in the detail that a provider takes where nothing is asked for.

    `model_id` may name any provider that serves the model.
    """
    name = model_id.rpartition("/")[2].lower()
    count = next((rule for pattern, rule in _RULES if pattern.search(name)), _USUAL)
    return math.ceil(count(image.width_px, image.height_px))


def _tiles(whole: int, tile: int) -> Count:
    """Tiles of 512 x 512 of a picture fit into 2048 x 2048, then its short side to 768."""

    def count(width: float, height: float) -> float:
        scale = min(1.0, 2048 / max(width, height), 768 / min(width, height))
        return whole + tile * math.ceil(width * scale / 512) * math.ceil(height * scale / 512)

    return count


def _patches(side_px: int, factor: float = 1.0, most: float = math.inf, extra: int = 0) -> Count:
    """Square patches, at most so many, each counted as `factor` tokens."""

    def count(width: float, height: float) -> float:
        patches = math.ceil(width / side_px) * math.ceil(height / side_px)
        return min(patches, most) * factor + extra

    return count


def _shrunk(side_px: int, longest_px: int, most: int) -> Count:
    """Square patches of a picture that is scaled down until it fits both bounds."""

    def count(width: float, height: float) -> float:
        scale = min(1.0, longest_px / max(width, height))
        scale = min(scale, math.sqrt(most * side_px**2 / (width * height)))
        patches = math.ceil(width * scale / side_px) * math.ceil(height * scale / side_px)
        return min(patches, most)

    return count


def _crops(side_px: int, small_px: float, each: int) -> Count:
    """A small picture counts once; a larger one by the squares that cover it."""

    def count(width: float, height: float) -> float:
        if max(width, height) <= small_px:
            return each
        return each * math.ceil(width / side_px) * math.ceil(height / side_px)

    return count


def _grok(width: float, height: float) -> float:
    """Tiles of 448 x 448, at most six, and one of the whole; 256 tokens each."""
    return 256 * (min(6, math.ceil(width / 448) * math.ceil(height / 448)) + 1)


_USUAL = _tiles(85, 170)
_RULES: tuple[tuple[re.Pattern[str], Count], ...] = tuple(
    (re.compile(rf"(^|\.){pattern}"), rule)
    for pattern, rule in (
        (r"gpt-4o-mini", _tiles(2833, 5667)),
        (r"gpt-4\.1-mini", _patches(32, 1.62, 1536)),
        (r"gpt-4\.1-nano", _patches(32, 2.46, 1536)),
        (r"o4-mini", _patches(32, 1.72, 1536)),
        (r"gpt-5-nano", _patches(32, 1.5, 1536)),
        (r"gpt-5-mini", _patches(32, 1.2, 1536)),
        (r"gpt-5(\.1)?($|-)", _tiles(70, 140)),
        (r"gpt-([6-9]|5\.\d)", _patches(32, 1.2, 2500)),
        (r"o[13]($|-)", _tiles(75, 150)),
        (r"claude-(opus-4-[7-9]|[a-z]+-([5-9]|\d\d))", _shrunk(28, 2576, 4784)),
        (r"claude", _shrunk(28, 1568, 1568)),
        (r"gemini-([12]|exp)", _crops(768, 384, 258)),
        (r"gemini", _crops(768, math.inf, 1120)),
        (r"grok", _grok),
        (r"qwen2(\.5)?-vl", _patches(28, extra=2)),
        (r"qwen3", _patches(32, extra=2)),
    )
)
"""By the beginning of a model's name, or what follows a dot in it; the first that matches."""
