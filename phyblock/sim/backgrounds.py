"""What writing, lines and shadows look like on each background."""

from __future__ import annotations

from dataclasses import dataclass

from phyblock.sim.renderer import Rgb
from phyblock.types import Background

__all__ = ["DARK_INK", "INK_RGB", "LIGHT_INK", "TONES", "Tones"]

INK_RGB: Rgb = (14, 14, 16)
"""Lines between faces of blocks, and round blocks on light floors."""
DARK_INK: Rgb = (20, 24, 32)
LIGHT_INK: Rgb = (255, 255, 255)


@dataclass(frozen=True)
class Tones:
    """What is drawn on a background: the share of light that a shadow takes, 0..1, and colors.

    `ink` is of writing, `line` of the grid between candidates, and `rim` of the lines where
    blocks end at the floor, which contrast with it by 3:1 or more.
    """

    shadow: float
    ink: Rgb
    line: Rgb
    rim: Rgb


TONES: dict[Background, Tones] = {
    "white": Tones(0.16, DARK_INK, (205, 208, 214), INK_RGB),
    "checkerboard": Tones(0.5, LIGHT_INK, (62, 80, 100), (206, 212, 222)),
    "light-wood": Tones(0.3, DARK_INK, (138, 104, 70), INK_RGB),
    "dark-wood": Tones(0.5, LIGHT_INK, (150, 116, 88), (240, 234, 226)),
    "concrete": Tones(0.3, DARK_INK, (98, 98, 96), INK_RGB),
    "lawn": Tones(0.48, LIGHT_INK, (158, 180, 120), (250, 253, 244)),
}
