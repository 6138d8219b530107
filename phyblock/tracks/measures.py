"""Measures of a track, the cells that they are pooled in, and what results show of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.scoring.counts import Floats, mean_of, ratio_of
from phyblock.scoring.plan import ERROR_TYPES

if TYPE_CHECKING:
    import pandas as pd

    from phyblock.data import AssemblyTask, Dataset
    from phyblock.records.record import Record
    from phyblock.results.load import Design, Run
    from phyblock.results.text import TextTable
    from phyblock.scoring.counts import Metric
    from phyblock.sim.film import FilmStep

SCORED_BY = ("setting", "matcher", "criterion")
"""Columns that say how a sample was scored; "" where its track knows no such choice."""
CELL = "cell"
"""Column of the cell that a row of counts is pooled in."""

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

    `frame` makes them out of a run: a row a sample and way of counting it, with the columns `row`
    (of the sample's record), those of `SCORED_BY` where they tell ways apart, and one of each name
    in `columns`. Samples that the run leaves out have no row. Instead of it, `sample` counts one
    sample when its reply is judged: it is given the item that was asked about and the track's
    judgement of the reply (or the episode that was played), and its numbers, one of each name in
    `columns`, are kept in the record. Where
    it returns None, the sample is not counted. `cells` are its own where they are not the track's.
    """

    name: str
    columns: tuple[str, ...]
    frame: Callable[[Run], pd.DataFrame] | None = None
    sample: Callable[[Any, Any], Sequence[float] | None] | None = None
    cells: tuple[Cell, ...] = ()


@dataclass(frozen=True)
class Measure:
    """One number about a model.

    `value` makes it of summed counts, shape (..., columns of `counted`), NaN where it is not
    defined. `heading`, `meaning` and `over` (what is counted) are for people; `unit` "%" stands for
    values in [0, 1] that tables show times 100. `chance` says what guessing gives in a cell,
    `floors` names baselines that never see the goal. One that `is_difference` of two shares may be
    below zero. Values in another unit are from 0 to `most` where that is given, infinity for none.
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
    is_difference: bool = False
    most: float | None = None

    @property
    def heading_in_unit(self) -> str:
        """The heading with the unit of values in brackets, where they have one."""
        return in_unit(self.heading, self.unit)

    @property
    def is_share(self) -> bool:
        """True if values are parts of a whole, which bounds their intervals."""
        return self.unit == "%" and not self.is_difference

    @property
    def end_of_range(self) -> float:
        """The end of the range of values, which begins at 0; NaN for no range."""
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
        """The factor of a value where it is shown."""
        return 100.0 if self.unit == "%" else 1.0

    @property
    def most_apart(self) -> float:
        """The most that two values can differ by, as they are shown; infinite without a bound."""
        return self.scale * (2 if self.is_difference else 1) if self.unit == "%" else math.inf


def share(
    counted: SampleCounts,
    parts: str | tuple[str, ...],
    whole: str,
    heading: str,
    *,
    name: str = "",
    unit: Unit = "%",
    ratio: Metric | None = None,
    **about: Any,
) -> Measure:
    """Return the measure of a part of a whole: the sum of some columns over that of another.

    In another unit than "%" it is a mean, which has no upper end. `ratio` divides another way.
    """
    columns = [parts] if isinstance(parts, str) else list(parts)
    places = [counted.columns.index(column) for column in columns]
    end = counted.columns.index(whole)
    divide = ratio or (ratio_of if unit == "%" else mean_of)

    def value(sums: Floats) -> Floats:
        pair = np.stack([sums[..., places].sum(axis=-1), sums[..., end]], axis=-1)
        return divide(pair)

    about = {"over": whole, **({} if unit == "%" else {"most": math.inf}), **about}
    return Measure(name or columns[0], heading, counted, value, unit=unit, **about)


def in_unit(heading: str, unit: str) -> str:
    """A heading with the unit of the values below it in brackets, where they have one."""
    return f"{heading} ({unit})" if unit else heading


class ListedScore(NamedTuple):
    """The counts behind F1 of a sample, and the types of its wrong steps."""

    tp: float
    fp: float
    fn: float
    errors: Collection[str] = ()


@dataclass(frozen=True)
class Listing:
    """A score that samples of a track can be listed by.

    `name` is what people choose, as the name of a setting. `errors` are the types that its wrong
    steps may have. `score` is of a record, None where it was not scored so. Its parts are counts of
    steps that people read, unless it is not `is_counted`.
    """

    name: str
    errors: tuple[str, ...]
    score: Callable[[Record], ListedScore | None]
    is_counted: bool = True


def by_settings(design: Design) -> tuple[Listing, ...]:
    """The settings of a suite, the headline's first, each by the headline matcher."""
    return tuple(
        Listing(setting, ERROR_TYPES, partial(_scored, setting, design.matcher))
        for setting in design.suite.settings
    )


def _scored(setting: str, matcher: str, record: Record) -> ListedScore | None:
    scores = [score for score in record.scores if score.setting == setting]
    headline = [score for score in scores if score.matcher == matcher]
    for score in headline or scores:
        errors = [name for name, count in (score.errors or {}).items() if count]
        return ListedScore(score.tp, score.fp, score.fn, errors)
    return None


@dataclass(frozen=True)
class HeadlineColumn:
    """A measure in a cell, as a column of a headline table.

    `criterion` says how it is counted, where one measure is counted in several ways.
    """

    measure: str
    cell: str
    heading: str
    criterion: str = ""


@dataclass(frozen=True)
class EpisodeView:
    """The views of a record step by step: as a table, and as frames of a film."""

    table: Callable[[Any], TextTable]
    frames: Callable[[Any, AssemblyTask], Iterable[FilmStep]]


WHOLE = Cell("overall", "Overall")
"""The one cell of a track that has no parts."""


def _in_whole(rows: pd.DataFrame, _: Run) -> Mapping[str, NDArray[np.bool_]]:
    """All samples in one cell."""
    return {WHOLE.name: np.ones(len(rows), dtype=bool)}


@dataclass(frozen=True)
class TrackReport:
    """The measures of a track, and what is shown of them.

    `cells` are those of a run, the last of which stands for all; `in_cells` says by
    pooled cell which rows of counts are in it. `headline` chooses
    the columns of the headline table, the first measure in every cell where it is left out; the
    column headed `main`, else the last, is the one that models are ranked by. `notes` say how its
    values are counted. `short` is the name of the column that stands for the track in a summary.

    `check_alike` raises SpecError where the first run cannot be compared with the second in these
    cells by a measure.
    `part_names` say what `Record.part` stands for. `items` opens, for the page of a run, what was
    asked about where that is more than scenes, and gives of a record what has a `question` as it
    was shown; it raises DataError where that is not what the run was made on.
    `episodes` shows records that are episodes. `listings` are the scores that the page of a run
    lists samples by, the one that the headline leads with first.
    `showing` says, in words that end every caption, what is unusual about how items were shown.
    """

    measures: tuple[Measure, ...]
    cells: Callable[[Run], tuple[Cell, ...]] = lambda _: (WHOLE,)
    in_cells: Callable[[pd.DataFrame, Run], Mapping[str, NDArray[np.bool_]]] = _in_whole
    headline: Callable[[Run], tuple[HeadlineColumn, ...]] | None = None
    main: str = ""
    short: str = ""
    notes: Callable[[Run], Sequence[str]] = lambda _: ()
    check_alike: Callable[[Run, Run, Sequence[str], Measure], None] | None = None
    part_names: Mapping[str, str] = field(default_factory=dict)
    items: Callable[[Run, Dataset], Callable[[Record], Any | None]] | None = None
    episodes: EpisodeView | None = None
    listings: Callable[[Design], tuple[Listing, ...]] = by_settings
    showing: Callable[[Run], tuple[str, ...]] = lambda _: ()
