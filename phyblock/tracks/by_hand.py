"""How a person answers what a track asks: by picking choices, which make a reply in text."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from phyblock.sim.compose import GRID_COLUMNS

__all__ = ["Choice", "Picking", "Spot", "candidate_choices"]

_PICTURES = ("composite", "candidates")
"""Labels of pictures that show numbered candidates: the square at their right end is the grid."""


@dataclass(frozen=True)
class Spot:
    """Where a choice is seen: in the last picture of this `label`, the cell of the grid that fills
    the square at its right end, from 0; or with None the whole picture.
    """

    label: str
    cell: int | None = None

    def box(self, width_px: int, height_px: int) -> tuple[float, float, float, float]:
        """Left, top, width and height in a picture of this size, as shares of its sides."""
        if self.cell is None:
            return (0.0, 0.0, 1.0, 1.0)
        row, column = divmod(self.cell, GRID_COLUMNS)
        side = min(width_px, height_px) / width_px
        width = side / GRID_COLUMNS
        return (1 - side + column * width, row / GRID_COLUMNS, width, 1 / GRID_COLUMNS)


@dataclass(frozen=True)
class Choice:
    """One thing to pick: its name as the prompt says it, what it says where that is a text, and
    where it is seen.
    """

    name: str
    text: str = ""
    spots: tuple[Spot, ...] = ()


@dataclass(frozen=True)
class Picking:
    """An answer made of choices that are picked one after another.

    From `least` to `most` of them, each as often as one likes where `repeats`; `noun` is what one
    pick is called. `write` makes the reply out of their places, in the form that the prompt asks
    for.
    """

    choices: tuple[Choice, ...]
    least: int
    most: int
    repeats: bool
    noun: str
    write: Callable[[Sequence[int]], str]

    def without_cells(self) -> Picking:
        """The same with choices that are not looked for in grids."""
        bare = (
            replace(one, spots=tuple(spot for spot in one.spots if spot.cell is None))
            for one in self.choices
        )
        return replace(self, choices=tuple(bare))

    def reply(self, picks: Sequence[int]) -> str:
        """The reply that picks make, given by their places in `choices`.

        Raises ValueError for too few or many, places that there are not, or repeats where none may
        be.
        """
        if not self.least <= len(picks) <= self.most:
            bounds = f"{self.least} to {self.most}" if self.least < self.most else f"{self.least}"
            raise ValueError(f"holds {len(picks)} picks in place of {bounds}")
        if not all(0 <= place < len(self.choices) for place in picks):
            raise ValueError(f"holds picks outside of 0 to {len(self.choices) - 1}")
        if not self.repeats and len(set(picks)) < len(picks):
            raise ValueError("holds a pick twice")
        return self.write(picks)


def candidate_choices(n_candidates: int) -> tuple[Choice, ...]:
    """The numbered candidates of a scene, wherever a picture shows them."""
    return tuple(
        Choice(str(n + 1), "", tuple(Spot(label, n) for label in _PICTURES))
        for n in range(n_candidates)
    )
