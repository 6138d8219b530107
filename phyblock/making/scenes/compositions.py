"""Structures of several parts: parts side by side, the same tower at both ends, merged scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.scene import Block
from phyblock.domain.symmetry import Symmetry
from phyblock.making.poses import transformed
from phyblock.making.scenes.buildings import BUILDINGS
from phyblock.making.scenes.creatures import CREATURES
from phyblock.making.scenes.sketch import UNIT_M, Draft, Theme
from phyblock.sim.contact import whole_bounds_m

__all__ = ["COMPOSITIONS", "Axis", "beside"]

Axis = int
"""Along which parts stand side by side: 0 is x, the depth; 1 is y, the front."""
_ACROSS = Symmetry(2, mirrored=True)
"""The mirror image across the plane y = 0."""


def beside(parts: Sequence[Sequence[Block]], gap_units: float, axis: Axis = 1) -> list[Block]:
    """The parts in a row with gaps between their outlines [grid units], numbered through."""
    row: list[Block] = []
    edge_m = 0.0
    for part in parts:
        low_m, high_m = whole_bounds_m(part)
        shift = -(low_m + high_m) / 2
        shift[2] = 0.0
        shift[axis] = edge_m - low_m[axis]
        row += [_shifted(block, shift, len(row) + i) for i, block in enumerate(part, 1)]
        edge_m += float(high_m[axis] - low_m[axis]) + gap_units * UNIT_M
    return row


def _shifted(block: Block, shift: NDArray[np.float64], order: int) -> Block:
    x, y, z = (np.array(block.position_m) + shift).tolist()
    place = (round(x, 6) + 0.0, round(y, 6) + 0.0, round(z, 6) + 0.0)
    return replace(block, order=order, position_m=place)


def _part(d: Draft, *themes: Theme) -> list[Block]:
    """The blocks of a part drawn apart, in the colors of the whole."""
    apart = d.fresh()
    d.pick(themes)(apart)
    return apart.blocks


def _framed(d: Draft) -> None:
    """A building between two towers that mirror one another."""
    names = ("tower", "monument", "balance", "pyramid")
    side = _part(d, *(BUILDINGS[name] for name in names))
    middle = _part(d, *(BUILDINGS[name] for name in ("house", "gate", "arcade", "court")))
    parts = [side, middle, transformed(side, _ACROSS)]
    d.take(beside(parts, d.pick((0.0, 0.0, 1.0))))


def _avenue(d: Draft) -> None:
    """A structure, its mirror image, and something between them."""
    names = ("bridge", "stair", "house", "gate")
    side = _part(d, *(BUILDINGS[name] for name in names))
    middle = _part(d, CREATURES["fountain"], CREATURES["tree"], BUILDINGS["monument"])
    d.take(beside([side, middle, transformed(side, _ACROSS)], d.pick((1.0, 2.0))))


def _street(d: Draft) -> None:
    """A building with a scene before its door."""
    building = _part(d, *(BUILDINGS[name] for name in ("house", "arcade", "court", "tower")))
    names = ("animal", "car", "figure", "tree", "table")
    second = _part(d, *(CREATURES[name] for name in names))
    d.take(beside([building, second], d.pick((1.0, 2.0))))


def _train(d: Draft) -> None:
    """Two or three cars in a row."""
    cars = [_part(d, CREATURES["car"]) for _ in range(d.pick((2, 2, 3)))]
    d.take(beside(cars, 1.0))


COMPOSITIONS: dict[str, Theme] = {
    "avenue": _avenue,
    "framed": _framed,
    "street": _street,
    "train": _train,
}
