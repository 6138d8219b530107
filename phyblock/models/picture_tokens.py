"""How many tokens providers count for a picture, by their published rules.

Sources, read in November 2026: OpenAI, guide to images and vision, sections on sizing and costs;
Anthropic, vision guide, section on costs; Google, Gemini API guides to token counting and media
resolution; xAI, guide to image understanding; Qwen, model cards of Qwen2.5-VL and Qwen3-VL. Models
that no rule names count as GPT-4o does. A budget learns what a provider really counts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from phyblock.models.base import Image
from phyblock.types import ImageDetail

__all__ = ["picture_tokens"]

Count = Callable[[float, float], float]
"""Tokens of a picture of so many pixels in width and height."""


def picture_tokens(model_id: str, image: Image, detail: ImageDetail | None = None) -> int:
    """Tokens of a picture in a detail, or in the one that a provider takes where none is asked for.

    `model_id` may name any provider that serves the model.
    """
    name = model_id.rpartition("/")[2].lower()
    rule = next((rule for pattern, rule in _RULES if pattern.search(name)), _USUAL)
    count = rule.at.get(detail or "auto", rule.usual)
    return math.ceil(count(image.width_px, image.height_px))


@dataclass(frozen=True)
class _Rule:
    """How a family of models counts: as usual, or in a detail where that differs."""

    usual: Count
    at: Mapping[str, Count] = field(default_factory=dict)


def _tiles(whole: int, tile: int) -> _Rule:
    """Tiles of 512 x 512 of a picture fit into 2048 x 2048, then its short side to 768; in low
    detail the whole alone.
    """

    def count(width: float, height: float) -> float:
        scale = min(1.0, 2048 / max(width, height), 768 / min(width, height))
        return whole + tile * math.ceil(width * scale / 512) * math.ceil(height * scale / 512)

    return _Rule(count, {"low": _fixed(whole)})


def _fixed(tokens: int) -> Count:
    return lambda _width, _height: tokens


def _patches(factor: float, most: int, longest_px: int = 2048) -> Count:
    """Square patches of 32 pixels of a picture that is scaled down to a longest side, then until
    they are at most so many; each counts as `factor` tokens.
    """

    def count(width: float, height: float) -> float:
        scale = min(1.0, longest_px / max(width, height))
        width, height = (max(1, round(side * scale)) for side in (width, height))
        if _covering(32, width, height) > most:
            scale = math.sqrt(32**2 * most / (width * height))
            whole = (
                math.floor(side * scale / 32) / (side * scale / 32) for side in (width, height)
            )
            scale *= min(part or 1.0 for part in whole)
            width, height = (max(1, math.floor(side * scale)) for side in (width, height))
        return min(most, _covering(32, width, height)) * factor

    return count


def _covering(side_px: int, width: float, height: float) -> int:
    return math.ceil(width / side_px) * math.ceil(height / side_px)


def _framed(side_px: int, extra: int) -> _Rule:
    """Square patches, and some tokens that frame them."""
    return _Rule(lambda width, height: _covering(side_px, width, height) + extra)


def _shrunk(side_px: int, longest_px: int, most: int) -> _Rule:
    """Square patches of a picture that is scaled down until it fits both bounds."""

    def count(width: float, height: float) -> float:
        scale = min(1.0, longest_px / max(width, height))
        scale = min(scale, math.sqrt(most * side_px**2 / (width * height)))
        return min(_covering(side_px, width * scale, height * scale), most)

    return _Rule(count)


def _crops(width: float, height: float) -> float:
    """A small picture counts once; a larger one by the squares that cover it."""
    return 258 if max(width, height) <= 384 else 258 * _covering(768, width, height)


def _grok(width: float, height: float) -> float:
    """Tiles of 448 x 448, at most six, and one of the whole; 256 tokens each."""
    return 256 * (min(6, _covering(448, width, height)) + 1)


_SMALL = _patches(1.2, 2500, 512)
_HIGH = _patches(1.2, 2500)
_ORIGINAL = _patches(1.2, 10_000, 6000)
_WHOLE = _patches(1.2, 30_000, 65_535)
_USUAL = _tiles(85, 170)
_RULES: tuple[tuple[re.Pattern[str], _Rule], ...] = tuple(
    (re.compile(rf"(^|\.){pattern}"), rule)
    for pattern, rule in (
        (r"gpt-4o-mini", _tiles(2833, 5667)),
        (r"gpt-4\.1-mini", _Rule(_patches(1.62, 6144))),
        (r"gpt-4\.1-nano", _Rule(_patches(2.46, 1536))),
        (r"o4-mini", _Rule(_patches(1.72, 1536))),
        (r"gpt-5-nano", _Rule(_patches(1.5, 1536))),
        (r"gpt-5-mini", _Rule(_patches(1.2, 1536))),
        (r"gpt-5(\.1)?($|-)", _tiles(70, 140)),
        (r"gpt-5\.[23]", _Rule(_patches(1.2, 6144))),
        (r"gpt-5\.4", _Rule(_HIGH, {"low": _patches(1.2, 6144), "original": _ORIGINAL})),
        (r"gpt-5\.5", _Rule(_ORIGINAL, {"low": _SMALL, "high": _HIGH})),
        (r"gpt-([6-9]|5\.\d)", _Rule(_WHOLE, {"low": _SMALL, "high": _HIGH})),
        (r"o[13]($|-)", _tiles(75, 150)),
        (r"claude-(opus-4-[7-9]|[a-z]+-([5-9]|\d\d))", _shrunk(28, 2576, 4784)),
        (r"claude", _shrunk(28, 1568, 1568)),
        (r"gemini-([12]|exp)", _Rule(_crops, {"low": _fixed(64), "medium": _fixed(256)})),
        (
            r"gemini",
            _Rule(
                _fixed(1120),
                {"low": _fixed(280), "medium": _fixed(560), "ultra_high": _fixed(2240)},
            ),
        ),
        (r"grok", _Rule(_grok)),
        (r"qwen2(\.5)?-vl", _framed(28, 2)),
        (r"qwen3", _framed(32, 2)),
    )
)
"""By the beginning of a model's name, or what follows a dot in it; the first that matches."""
