"""Outlines: dark lines where one face ends, and a light rim round blocks on dark floors."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from phyblock.sim.backgrounds import INK_RGB, TONES
from phyblock.sim.renderer import Raster
from phyblock.types import Background

__all__ = ["draw_outlines"]

Pixel = TypeVar("Pixel", np.uint8, np.float32)


def draw_outlines(
    image: NDArray[Pixel], raster: Raster, background: Background | None
) -> NDArray[Pixel]:
    """A picture (size, size, 3) of a raster with its outlines; without background, no rim.

    A line takes a pixel on either side of where a face ends, a rim one more on the floor: scaled
    down to half the size, it fills a pixel's width wherever it lies.
    """
    lined: NDArray[Pixel] = image.copy()
    lined[_ends(raster.face, raster.prop) & (raster.prop >= 0)] = INK_RGB
    if background is not None:
        rim = _ends(raster.prop >= 0)
        lined[rim | _ends(rim) & (raster.prop < 0)] = TONES[background].rim
    return lined


def _ends(*numbers: NDArray[np.int64] | NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The pixels beside which some number (size, size) changes, to the sides, above or below."""
    across = np.logical_or.reduce([number[:, 1:] != number[:, :-1] for number in numbers])
    down = np.logical_or.reduce([number[1:] != number[:-1] for number in numbers])
    ends = np.zeros(numbers[0].shape, dtype=np.bool_)
    ends[:, 1:] |= across
    ends[:, :-1] |= across
    ends[1:] |= down
    ends[:-1] |= down
    return ends
