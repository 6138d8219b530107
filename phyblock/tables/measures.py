"""What is measured: counts of samples that add up, and what sums of them are worth."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    import pandas as pd

    from phyblock.scoring.counts import Metric
    from phyblock.tables.load import Run

__all__ = [
    "CELL",
    "SCORED_BY",
    "VALUE_KEY",
    "Better",
    "Cell",
    "Measure",
    "SampleCounts",
    "in_unit",
    "value_key",
]

SCORED_BY = ("setting", "matcher", "criterion")
"""Columns that say how a sample was scored; "" where its track knows no such choice."""
CELL = "cell"
"""Column of the cell that a row of counts is pooled in."""

VALUE_KEY = ("measure", CELL, *SCORED_BY)
"""What tells the values of one model apart."""

Better = Literal["higher", "lower"]
Unit = Literal["%", "cm", "degrees", "steps", "blocks", ""]


@dataclass(frozen=True)
class Cell:
    """A part of what a track asks about, as a level or a subtask: a column of its tables.

    Samples of a cell are pooled. Where `of` names other cells, it is the unweighted mean of these
    instead, and has no value where one of them has none.
    """

    name: str
    heading: str
    group: str = ""
    of: tuple[str, ...] = ()


@dataclass(frozen=True)
class SampleCounts:
    """Counts of samples, from which one or several measures are made.

    `frame` makes them out of a run: a row a sample, way of counting it and cell that it is pooled
    in, with the columns `model`, `scene`, `item`, `seed`, `variant`, those of `SCORED_BY`, `CELL`,
    `replied` (whether the model said anything), and one of each name in `columns`. Samples that the
    run leaves out have no row. Instead of it, `sample` counts one sample when its reply is judged:
    it is given the item that was asked about and the track's judgement of the reply (or the episode
    that was played), and its numbers, one of each name in `columns`, are kept in the record. Where
    it returns None, the sample is not counted.
    """

    name: str
    columns: tuple[str, ...]
    frame: Callable[[Run], pd.DataFrame] | None = None
    sample: Callable[[Any, Any], Sequence[float] | None] | None = None


@dataclass(frozen=True)
class Measure:
    """One number about a model.

    `value` makes it of summed counts, shape (..., columns of `counted`), NaN where it is not
    defined. `heading`, `meaning` and `over` (what is counted) are for people; `unit` "%" stands for
    values in [0, 1] that tables show times 100. `chance` says what guessing gives in a cell,
    `floors` names baselines that never see the goal. One that is not `in_tables` is in the frame of
    estimates alone. One that `is_difference` of two shares may be below zero. Values in another
    unit are from 0 to `most` where that is given, infinity for no end.
    """

    name: str
    heading: str
    counted: SampleCounts
    value: Metric
    meaning: str = ""
    unit: Unit = "%"
    better: Better = "higher"
    over: str = "samples"
    chance: Callable[[Run, str], float] | None = None
    floors: tuple[str, ...] = ()
    in_tables: bool = True
    is_difference: bool = False
    most: float | None = None

    @property
    def heading_in_unit(self) -> str:
        """The heading with the unit of values in brackets, where they have one."""
        return in_unit(self.heading, self.unit)

    @property
    def is_share(self) -> bool:
        """Whether values are parts of a whole, which bounds their intervals."""
        return self.unit == "%" and not self.is_difference

    @property
    def end_of_range(self) -> float:
        """Where the range of values ends that begins at 0; NaN for no range."""
        if self.is_share:
            return 1.0
        return math.nan if self.most is None else self.most

    @property
    def best(self) -> float:
        """The value of a perfect sample, as it is shown; NaN where no value is the best."""
        if self.better == "lower":
            return math.nan if math.isnan(self.end_of_range) else 0.0
        return self.scale * self.end_of_range if math.isfinite(self.end_of_range) else math.nan

    @property
    def scale(self) -> float:
        """What a value is multiplied by where it is shown."""
        return 100.0 if self.unit == "%" else 1.0

    @property
    def most_apart(self) -> float:
        """The most that two values can differ by, as they are shown; infinite without a bound."""
        return self.scale * (2 if self.is_difference else 1) if self.unit == "%" else math.inf


def in_unit(heading: str, unit: str) -> str:
    """A heading with the unit of the values below it in brackets, where they have one."""
    return f"{heading} ({unit})" if unit else heading


def value_key(row: Mapping[Any, Any]) -> str:
    """What a value is of, as a key: `f1/overall/A/optimal/aov`."""
    return "/".join(str(row[name]) for name in VALUE_KEY)
