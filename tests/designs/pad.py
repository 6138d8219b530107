"""A sketch pad for designs by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from phyblock.domain import BlockType, Color
from phyblock.making.scenes.sketch import Sketch

__all__ = ["Design", "Pad"]


@dataclass
class Pad(Sketch):
    """A sketch whose `origin` (y, x) [grid units] shifts all that follows."""

    origin: tuple[float, float] = (0.0, 0.0)

    def put(
        self,
        block_type: BlockType,
        y: float = 0.0,
        x: float = 0.0,
        pose: str = "",
        color: Color | None = None,
    ) -> None:
        super().put(block_type, y + self.origin[0], x + self.origin[1], pose, color)

    def pair(
        self,
        block_type: BlockType,
        y: float,
        x: float = 0.0,
        poses: tuple[str, str] = ("", ""),
        color: Color | None = None,
    ) -> None:
        """The same block at -y and at +y, the mirror image when the two poses say so."""
        self.put(block_type, -y, x, poses[0], color)
        self.put(block_type, y, x, poses[1], color)


Design = Callable[[Pad], None]
"""A structure as the steps that draw it."""
