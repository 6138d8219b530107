"""What an environment plays by: which actions there are, and what becomes of them."""

from __future__ import annotations

import io
from typing import Any, NamedTuple, Protocol

from gymnasium import spaces
from numpy.typing import NDArray
from PIL import Image

from phyblock.data import AssemblyTask
from phyblock.domain import Block, CandidateSet

__all__ = ["DONE", "Acted", "Play", "picture_of"]

DONE = 0
"""The number that ends the assembly; any other is that of a candidate."""


class Acted(NamedTuple):
    """What became of an action, what it is worth, and whether it was no failure."""

    outcome: str
    reward: float
    is_right: bool


class Play(Protocol):
    """One way of building a scene; `begin` comes before all else."""

    action_space: spaces.Space[Any]

    def begin(self, task: AssemblyTask) -> None:
        """Begin a scene."""

    def candidates(self, task: AssemblyTask) -> CandidateSet:
        """The candidates of a scene as they are shown."""
        return task.candidates

    def act(self, action: Any) -> Acted | None:
        """Take an action; None for Done. ValueError for one outside the space."""

    @property
    def has_ended(self) -> bool:
        """Whether the goal is complete, or the rules end it."""

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The blocks in the world."""

    @property
    def chosen(self) -> tuple[int, ...]:
        """The candidates in the world, in the order in which they came there."""

    def right_moves(self) -> tuple[Any, ...]:
        """The actions that would place a block now."""

    def image(self, blocks: tuple[Block, ...]) -> Image.Image:
        """Blocks, seen as the goal is."""

    def candidates_image(self) -> Image.Image:
        """The numbered candidates."""

    def info(self) -> dict[str, Any]:
        """The state in structure; tuples, since arrays of several lengths make no vector."""

    def more_spaces(self) -> dict[str, spaces.Space[Any]]:
        """What `observe="state"` shows of this way of building alone, by name."""
        return {}

    def more_state(self) -> dict[str, NDArray[Any]]:
        """These observations as they are now."""
        return {}

    def close(self) -> None:
        """Release the simulator."""


def picture_of(png: bytes) -> Image.Image:
    """A PNG as an RGB image."""
    with Image.open(io.BytesIO(png)) as image:
        rgb: Image.Image = image.convert("RGB")
        return rgb
