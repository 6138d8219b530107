"""Answers that people make by hand: picked choices, with numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from phyblock.sim.pictures import GRID_COLUMNS


@dataclass(frozen=True)
class Choice:
    """One thing to pick: its name in the prompt, and its text if it has one.

    It is in the last picture of each label: the whole picture, or `cell`, from 0, of the grid in
    the square at the right end.
    """

    name: str
    text: str = ""
    labels: tuple[str, ...] = ()
    cell: int | None = None

    def box(self, width_px: int, height_px: int) -> tuple[float, float, float, float]:
        """Return left, top, width and height in a picture of this size, as shares of its sides."""
        if self.cell is None:
            return (0.0, 0.0, 1.0, 1.0)
        row, column = divmod(self.cell, GRID_COLUMNS)
        side = min(width_px, height_px) / width_px
        width = side / GRID_COLUMNS
        return (1 - side + column * width, row / GRID_COLUMNS, width, 1 / GRID_COLUMNS)


@dataclass(frozen=True)
class NumberField:
    """A number that goes with every pick: its name and unit, from `-most` to `most` with at most
    `decimals` decimals. Keys change it by `step`, or by `leap`.
    """

    name: str
    unit: str
    most: float
    decimals: int
    step: float
    leap: float

    def allows(self, value: float) -> bool:
        """True for a number within the bounds and with no more decimals; NaN is refused."""
        return abs(value) <= self.most and abs(value - round(value, self.decimals)) <= 1e-9


@dataclass(frozen=True)
class Pick:
    """A choice, by its place among them from 0, and the numbers that go with it."""

    place: int
    numbers: tuple[float, ...] = ()


@dataclass(frozen=True)
class Picking:
    """An answer made of choices that are picked one after another.

    `least` to `most` are picked, with `repeats` any of them repeatedly; `noun` is the name of one
    pick. `fields` are the numbers that go with each. `write` makes the reply in the form that the
    prompt asks for. `task` says in one line what to do.
    """

    choices: tuple[Choice, ...]
    least: int
    most: int
    repeats: bool
    noun: str
    write: Callable[[Sequence[Pick]], str]
    fields: tuple[NumberField, ...] = ()
    task: str = ""

    def without_cells(self) -> Picking:
        """Return the same with choices that are whole pictures."""
        plain = (one if one.cell is None else Choice(one.name, one.text) for one in self.choices)
        return replace(self, choices=tuple(plain))

    def reply(self, picks: Sequence[Pick]) -> str:
        """Return the reply made of picks.

        Raises ValueError for too few or too many, unknown places, repeats that are not allowed,
        and numbers that are missing or not allowed.
        """
        places = [pick.place for pick in picks]
        is_answer = (
            self.least <= len(picks) <= self.most
            and all(0 <= place < len(self.choices) for place in places)
            and (self.repeats or len(set(places)) == len(places))
            and all(len(pick.numbers) == len(self.fields) for pick in picks)
            and all(
                field.allows(value)
                for pick in picks
                for field, value in zip(self.fields, pick.numbers, strict=True)
            )
        )
        if not is_answer:
            raise ValueError("holds picks that make no answer")
        return self.write(picks)


def candidate_choices(
    n_candidates: int, labels: tuple[str, ...] = ("composite", "candidates")
) -> tuple[Choice, ...]:
    """Return the numbered candidates of a scene as choices in the pictures with these labels."""
    return tuple(Choice(str(n + 1), "", labels, n) for n in range(n_candidates))
