"""Sums of counts by scene, model and whatever else rows differ in; base scenes of scenes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from phyblock.scoring.counts import Floats
from phyblock.tables.load import Run

__all__ = ["Grouping", "base_scenes", "grouped", "parents_of", "summed"]

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


def base_scenes(parents: pd.Series[Any], scenes: Sequence[str]) -> list[tuple[str, ...]]:
    """Base scenes of each scene, itself where it has no others."""
    return [tuple(parents[scene]) or (scene,) for scene in scenes]


def parents_of(run: Run) -> pd.Series[Any]:
    """Base scenes by scene."""
    return run.records.drop_duplicates("scene").set_index("scene")["parents"]
