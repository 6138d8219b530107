"""Recoloring scenes from the full palette, where the kit's colors would give an answer away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import COLORS
from phyblock.domain.scene import Scene

__all__ = ["recolored", "with_own_colors"]


def recolored(scene: Scene, rng: np.random.Generator) -> Scene:
    """The scene with a color drawn for every block."""
    drawn = rng.integers(len(COLORS), size=len(scene))
    blocks = [
        replace(block, color=COLORS[int(i)]) for block, i in zip(scene.blocks, drawn, strict=True)
    ]
    return replace(scene, blocks=tuple(blocks))


def with_own_colors(scene: Scene, orders: Sequence[int], rng: np.random.Generator) -> Scene:
    """The scene with a color for each of up to four blocks that no other block has.

    The other blocks share the colors that are left. Raises ValueError for more than four blocks
    when there are others.
    """
    colors = [COLORS[int(i)] for i in rng.permutation(len(COLORS))]
    own = dict(zip(orders, colors, strict=False))
    left = colors[len(orders) :]
    if len(orders) > len(colors) or (not left and len(orders) < len(scene)):
        raise ValueError(f"there are {len(colors)} colors for {len(orders)} blocks and the rest")
    blocks = []
    for block in scene.blocks:
        color = own.get(block.order) or left[int(rng.integers(len(left)))]
        blocks.append(replace(block, color=color))
    return replace(scene, blocks=tuple(blocks))
