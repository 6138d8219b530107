"""A structure in the making by the grammar: a sketch pad, a random source and a color scheme."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from typing import Literal, TypeVar

import numpy as np

from phyblock.domain.blocks import BLOCK_TYPES, COLORS, KIT_PALETTE, SHAPES, BlockType, Color
from phyblock.domain.scene import Block
from phyblock.making.scenes.sketch import Sketch

__all__ = ["PALETTES", "Draft", "Palette", "Theme"]

Palette = Literal["kit", "full"]
"""The pairs of type and color of the official kit, or all that there are."""
PALETTES: dict[Palette, tuple[tuple[BlockType, Color], ...]] = {
    "kit": KIT_PALETTE,
    "full": tuple(product(BLOCK_TYPES, COLORS)),
}
"""The pairs of type and color in each palette."""
T = TypeVar("T")


class Draft:
    """What the rules of the grammar draw on.

    A cube comes in one of two tones of the structure, 0 or 1, so that a storey has one color; any
    other type has one color a structure, the kit's own with the palette `kit`.
    """

    def __init__(self, rng: np.random.Generator, palette: Palette = "kit") -> None:
        self.rng = rng
        self.sketch = Sketch()
        order = rng.permutation(len(COLORS))
        self._tones: tuple[Color, ...] = tuple(COLORS[i] for i in order[:2])
        self._colors = {block_type: shape.kit_colors[0] for block_type, shape in SHAPES.items()}
        if palette == "full":
            drawn = rng.integers(len(COLORS), size=len(BLOCK_TYPES))
            self._colors = {t: COLORS[int(i)] for t, i in zip(BLOCK_TYPES, drawn, strict=True)}

    @property
    def blocks(self) -> list[Block]:
        """All that was put down so far."""
        return self.sketch.blocks

    def __len__(self) -> int:
        return len(self.sketch.blocks)

    def fresh(self) -> Draft:
        """An empty draft with the same colors and the same random source."""
        other = Draft.__new__(Draft)
        other.rng, other.sketch = self.rng, Sketch()
        other._tones, other._colors = self._tones, self._colors
        return other

    def take(self, blocks: Sequence[Block]) -> None:
        """Add blocks that were drawn elsewhere, numbered to go on from here."""
        self.sketch.blocks += blocks

    def pick(self, options: Sequence[T]) -> T:
        """One of the options, all alike."""
        return options[int(self.rng.integers(len(options)))]

    def pick_type(self, *options: BlockType) -> BlockType:
        """One of the block types, all alike."""
        return self.pick(options)

    def maybe(self, chance: float = 0.5) -> bool:
        """True in a share `chance` of cases."""
        return float(self.rng.random()) < chance

    def put(
        self, block_type: BlockType, y: float = 0.0, x: float = 0.0, pose: str = "", tone: int = 0
    ) -> None:
        """Let a block down at (y, x) [grid units], as `Sketch.put`."""
        self.sketch.put(block_type, y, x, pose, self._color(block_type, tone))

    def pair(
        self,
        block_type: BlockType,
        y: float,
        poses: tuple[str, str] = ("", ""),
        tone: int = 0,
        x: float = 0.0,
    ) -> None:
        """The same block at -y and at +y."""
        self.put(block_type, -y, x, poses[0], tone)
        self.put(block_type, y, x, poses[1], tone)

    def _color(self, block_type: BlockType, tone: int) -> Color:
        return self._tones[tone % 2] if block_type == "cube" else self._colors[block_type]


Theme = Callable[[Draft], None]
"""A rule that draws a whole structure."""
