"""Answers of people: by picking choices, which make a reply in text.

Where a choice alone does not say it all, as where a block goes, numbers are given with every pick.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from phyblock.sim.pictures import GRID_COLUMNS

__all__ = [
    "Choice",
    "NumberField",
    "Pick",
    "Picking",
    "Spot",
    "candidate_choices",
    "picks_of",
]

_PICTURES = ("composite", "candidates")
"""Labels of pictures that show numbered candidates: the square at their right end is the grid."""


@dataclass(frozen=True)
class Spot:
    """The place where a choice is seen: in the last picture of this `label`, the cell of the grid
    that fills the square at its right end, from 0; or with None the whole picture.
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
class NumberField:
    """A number that goes with every pick: what it is called and its unit.

    From `-most` to `most` with so many `decimals`. Keys change it by `step`, or by `leap`. `start`
    is what stands in it at first, None where it is empty.
    """

    name: str
    unit: str
    most: float
    decimals: int
    step: float
    leap: float
    start: float | None = None

    def check(self, value: float) -> None:
        """Raise ValueError for what is no such number."""
        if not math.isfinite(value) or abs(value) > self.most:
            raise ValueError(f"holds {self.name} {value:g} outside of ±{self.most:g} {self.unit}")
        if abs(value - round(value, self.decimals)) > 1e-9:
            raise ValueError(f"holds {self.name} {value!r} with more than {self.decimals} decimals")


@dataclass(frozen=True)
class Pick:
    """A choice, by its place among them from 0, and the numbers that go with it."""

    place: int
    numbers: tuple[float, ...] = ()


def picks_of(places: Sequence[int], numbers: Sequence[Sequence[float]] = ()) -> tuple[Pick, ...]:
    """Picks by their places, and the numbers of each where there are any.

    Raises ValueError where not every pick has its numbers, and for a number that fits no float.
    """
    if not numbers:
        return tuple(map(Pick, places))
    if len(numbers) != len(places):
        raise ValueError(f"holds numbers of {len(numbers)} picks, and {len(places)} picks")
    pairs = zip(places, numbers, strict=True)
    try:
        return tuple(Pick(place, tuple(map(float, own))) for place, own in pairs)
    except OverflowError:
        raise ValueError("holds a number outside of the range of numbers") from None


@dataclass(frozen=True)
class Picking:
    """An answer made of choices that are picked one after another.

    From `least` to `most` of them, each as often as one likes where `repeats`; `noun` is what one
    pick is called. `fields` are the numbers that go with each. `write` makes the reply, in the form
    that the prompt asks for.
    """

    choices: tuple[Choice, ...]
    least: int
    most: int
    repeats: bool
    noun: str
    write: Callable[[Sequence[Pick]], str]
    fields: tuple[NumberField, ...] = ()

    def without_cells(self) -> Picking:
        """The same with choices that are not looked for in grids."""
        bare = (
            replace(one, spots=tuple(spot for spot in one.spots if spot.cell is None))
            for one in self.choices
        )
        return replace(self, choices=tuple(bare))

    def reply(self, picks: Sequence[Pick]) -> str:
        """The reply that picks make.

        Raises ValueError for too few or many, places that there are not, repeats where none may
        be, and numbers that are lacking or not allowed.
        """
        if not self.least <= len(picks) <= self.most:
            bounds = f"{self.least} to {self.most}" if self.least < self.most else f"{self.least}"
            raise ValueError(f"holds {len(picks)} picks in place of {bounds}")
        places = [pick.place for pick in picks]
        if not all(0 <= place < len(self.choices) for place in places):
            raise ValueError(f"holds picks outside of 0 to {len(self.choices) - 1}")
        if not self.repeats and len(set(places)) < len(picks):
            raise ValueError("holds a pick twice")
        for pick in picks:
            if len(pick.numbers) != len(self.fields):
                found, wanted = len(pick.numbers), len(self.fields)
                raise ValueError(f"holds {found} numbers with a pick in place of {wanted}")
            for field, value in zip(self.fields, pick.numbers, strict=True):
                field.check(value)
        return self.write(picks)


def candidate_choices(n_candidates: int, labels: Sequence[str] = _PICTURES) -> tuple[Choice, ...]:
    """The numbered candidates of a scene, wherever a picture with one of the labels shows them."""
    return tuple(
        Choice(str(n + 1), "", tuple(Spot(label, n) for label in labels))
        for n in range(n_candidates)
    )
