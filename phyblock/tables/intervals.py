"""Counts by scene and cell, with the base scenes of each scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from phyblock.scoring.ratios import Floats
from phyblock.scoring.uncertainty import Clusters
from phyblock.tables.load import Run

__all__ = ["CountCube", "Grouping", "base_scenes", "grouped", "parents_of", "summed"]

# pandas groups rows by several columns far more slowly than numpy numbers of them, and tables are
# made of hundreds of such sums.


@dataclass(frozen=True, eq=False)
class Grouping:
    """Which of `values`, sorted, each row has: `codes` are places among them."""

    codes: NDArray[np.intp]
    values: list[Any]


def grouped(table: pd.DataFrame, by: str | Sequence[str]) -> Grouping:
    """Rows by their values in a column, or in several, whose values together are tuples."""
    if isinstance(by, str):
        codes, known = pd.factorize(table[by].to_numpy(), sort=True)
        return Grouping(codes, list(known))
    columns = [grouped(table, name) for name in by]
    shape = tuple(len(column.values) for column in columns)
    flat = np.ravel_multi_index([column.codes for column in columns], shape)
    numbers, codes = np.unique(flat, return_inverse=True)
    places = zip(*np.unravel_index(numbers, shape), strict=True)
    values = [tuple(c.values[at] for c, at in zip(columns, place, strict=True)) for place in places]
    return Grouping(codes.reshape(-1), values)


def summed(
    table: pd.DataFrame, columns: Sequence[str], groupings: Sequence[Grouping]
) -> tuple[Floats, NDArray[np.intp]]:
    """Sums of columns over rows by all groupings, shape (*groupings, columns), and the number of
    rows, (*groupings); a missing value counts as nothing.
    """
    shape = tuple(len(grouping.values) for grouping in groupings)
    size = int(np.prod(shape))
    if not size:
        return np.zeros((*shape, len(columns))), np.zeros(shape, dtype=np.intp)
    flat = np.ravel_multi_index([grouping.codes for grouping in groupings], shape)
    values = [table[name].to_numpy(np.float64, na_value=np.nan) for name in columns]
    sums = [_sums(flat, np.nan_to_num(value), size) for value in values]
    rows = np.bincount(flat, minlength=size).reshape(shape)
    return np.stack(sums, axis=-1).reshape(*shape, len(columns)), rows


def _sums(places: NDArray[np.intp], values: Floats, size: int) -> Floats:
    """Sums of values by their place, below `size`, whatever their order."""
    if (values == np.rint(values)).all():
        return np.bincount(places, values, size).astype(np.float64)
    order = np.argsort(places, kind="stable")
    ends = np.searchsorted(places[order], np.arange(size + 1))
    parts = values[order].tolist()
    sums = [math.fsum(parts[first:last]) for first, last in pairwise(ends.tolist())]
    return np.array(sums, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class CountCube:
    """Counts of scenes x cells, summed over seeds.

    `counts` has shape (scenes, cells, counts); `present`, (scenes, cells), says where a cell has a
    sample of the scene; `parents` are the base scenes of each scene. Scenes and cells are sorted.
    """

    cells: list[tuple[Any, ...]]
    counts: Floats
    present: NDArray[np.bool_]
    parents: list[tuple[str, ...]]

    @classmethod
    def of(
        cls,
        table: pd.DataFrame,
        parents: pd.Series[Any],
        by: Sequence[str],
        sums: Sequence[str],
    ) -> CountCube:
        """Rows of samples, in cells of equal values in the columns `by`."""
        scenes, cells = grouped(table, "scene"), grouped(table, by)
        counts, rows = summed(table, sums, (scenes, cells))
        return cls(cells.values, counts, rows > 0, base_scenes(parents, scenes.values))

    def only(self, cells: Sequence[int]) -> CountCube:
        """Of the cells at these places, and of the scenes that they have."""
        scenes = np.flatnonzero(self.present[:, cells].any(axis=1))
        at = np.ix_(scenes, np.asarray(cells, dtype=np.intp))
        parents = [self.parents[scene] for scene in scenes]
        return CountCube([self.cells[n] for n in cells], self.counts[at], self.present[at], parents)

    @property
    def clusters(self) -> Clusters:
        """The scenes' base scenes."""
        return Clusters.of(self.parents)


def base_scenes(parents: pd.Series[Any], scenes: Sequence[str]) -> list[tuple[str, ...]]:
    """Base scenes of each scene, itself where it has no others."""
    return [tuple(parents[scene]) or (scene,) for scene in scenes]


def parents_of(run: Run) -> pd.Series[Any]:
    """Base scenes by scene."""
    return run.records.drop_duplicates("scene").set_index("scene")["parents"]
