"""Measures of a track: counts of samples, the cells that they are summed in, values of the sums.

The YAML file of a track declares headline, notes, measures and tables; `read_report` reads it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from phyblock.config.suite import Suite
from phyblock.files import read_own_yaml
from phyblock.records.files import Manifest
from phyblock.records.record import Record
from phyblock.scoring.plan import Metric, mean_of, ratio_of

SCORED_BY = ("setting", "matcher", "criterion")
"""Columns of the way in which a score was counted; "" where there is no choice."""
OVERALL = "overall"
"""The name of the cell of all samples."""
Better = Literal["higher", "lower"]
Unit = Literal["%", "cm", "degrees", "steps", "blocks", ""]


class Cell(NamedTuple):
    """A part of a track, such as a level or a subtask: a column of its tables.

    Its value comes from the sum of its samples, under its own criterion if there are several. If
    `of` names other cells, it is their unweighted mean instead, without a value if one has none.
    """

    name: str
    heading: str
    group: str = ""
    of: tuple[str, ...] = ()
    criterion: str = ""


WHOLE = Cell(OVERALL, "Overall")
"""The one cell of a track that has no parts."""


def level_cells(suite: Suite, _: Manifest) -> tuple[Cell, ...]:
    """Return the levels of a suite, then all scenes; Level 1 alone is scored without an order."""
    criteria = {n: suite.scoring.level1 if n == 1 else "aov" for n in sorted(suite.levels)}
    levels = [Cell(str(n), f"Level {n}", criterion=one) for n, one in criteria.items()]
    return (*levels, Cell(OVERALL, "Overall", criterion=levels[-1].criterion))


@dataclass(frozen=True)
class SampleCounts:
    """Counts of samples, one for each of the `columns`, from which measures are computed.

    `sample` counts when a reply is judged: it gets the item and the record, which stores its
    numbers. Instead, `record` counts a record when it is read, or `score` each of its scores. None
    means that the sample is not counted. `cells` replace those of the track.

    With `parts`, the samples of one group, such as the rotations of a question, count as one, right
    only if all `parts` are. Runs that differ in a field `same` of `run.yaml` cannot be compared.
    """

    name: str
    columns: tuple[str, ...]
    sample: Callable[[Any, Any], Sequence[float] | None] | None = None
    record: Callable[[Any], Sequence[float] | None] | None = None
    score: Callable[[Any], Sequence[float] | None] | None = None
    cells: tuple[Cell, ...] = ()
    parts: Callable[[Suite], int] | None = None
    same: tuple[str, ...] = ()

    def of(self, record: Record) -> Iterator[tuple[tuple[str, str, str], Sequence[float]]]:
        """Yield the counts of a record with the way in which each was scored."""
        if self.record is not None and (numbers := self.record(record)):
            yield ("", "", ""), numbers
        if (count := self.score) is None:
            return
        for score in record.scores:
            if (numbers := count(score)) is not None:
                yield (score.setting, score.matcher or "", score.criterion), numbers


@dataclass(frozen=True)
class Measure:
    """One number about a model.

    `value` computes it from summed counts, shape (..., columns of `counted`), NaN where undefined.
    `heading`, `meaning` and `over` (the noun of what is counted) are for people; `unit` "%" means
    values in [0, 1] that tables show times 100. A measure that `is_difference` of two shares may be
    below zero. Values in another unit are from 0 to `most` if given, infinity for no limit.
    """

    name: str
    heading: str
    counted: SampleCounts
    value: Metric
    meaning: str = ""
    unit: Unit = "%"
    better: Better = "higher"
    over: str = "samples"
    is_difference: bool = False
    most: float | None = None

    @property
    def heading_in_unit(self) -> str:
        """The heading, with the unit of values in brackets if they have one."""
        return in_unit(self.heading, self.unit)

    @property
    def end_of_range(self) -> float:
        """The end of the range of values, which begins at 0; NaN for no range."""
        if self.unit == "%" and not self.is_difference:
            return 1.0
        return math.nan if self.most is None else self.most

    @property
    def best(self) -> float:
        """The value of a perfect sample, as shown; NaN if no value is the best."""
        if self.better == "lower":
            return math.nan if math.isnan(self.end_of_range) else 0.0
        return self.scale * self.end_of_range if math.isfinite(self.end_of_range) else math.nan

    @property
    def scale(self) -> float:
        """The factor by which values are multiplied when shown."""
        return 100.0 if self.unit == "%" else 1.0

    @property
    def most_apart(self) -> float:
        """The most that two values can differ by, as shown; infinite without a bound."""
        return self.scale * (2 if self.is_difference else 1) if self.unit == "%" else math.inf


def in_unit(heading: str, unit: str) -> str:
    """Return a heading, with the unit of the values below it in brackets if they have one."""
    return f"{heading} ({unit})" if unit else heading


class LayoutColumn(NamedTuple):
    """Columns of a table: one per measure, in one cell or in several.

    `measures` are names, with headings where they differ from the measure's own. `cells` are `one`
    (`cell`, by default the last of the track), `each`, `parts` (each but the last) or `means`
    (parts that are means of others). `show` selects the value, the ends of the interval, or both.
    `group` is a heading over neighbors; in it, in headings and in `key`, the name in CSV files, the
    placeholders `{cell}`, `{group}`, `{level}`, `{measure}` and `{criterion}` are filled in. In a
    headline, models are ranked by the column that is `main`, else by the last.
    """

    measures: Mapping[str, str] | Sequence[str] = ()
    cells: Literal["one", "each", "parts", "means"] = "one"
    cell: str = ""
    criterion: str = ""
    group: str = ""
    show: Literal["value", "interval", "both"] = "value"
    key: str = "{measure}"
    digits: int = 1
    main: bool = False

    @property
    def headings(self) -> dict[str, str]:
        """The measures with their headings, "" for the measure's own."""
        if isinstance(self.measures, Mapping):
            return dict(self.measures)
        return dict.fromkeys(self.measures, "")

    def places(self, cells: Sequence[Cell]) -> list[Cell]:
        """Return the cells of a track that it has columns for."""
        if self.cells == "one":
            return [cell for cell in cells if cell.name == self.cell] or [cells[-1]]
        parts = cells if self.cells == "each" else cells[:-1]
        return [cell for cell in parts if self.cells != "means" or cell.of]


class Layout(NamedTuple):
    """A table by model or, by `rows`, by model and cell or measure; if `drawn`, also a figure."""

    caption: str
    columns: Sequence[LayoutColumn]
    rows: str | Sequence[str] = "model"
    notes: Sequence[str] = ()
    drawn: bool = False


@dataclass(frozen=True)
class TrackReport:
    """The measures of a track and their presentation.

    `cells` are those of a suite and its run; the last is the whole. `headline` are the columns that
    models are ranked by; if empty, the first measure in every cell. `notes` explain how values are
    counted: Jinja templates with the variables `suite`, `spec` (the track's section of it) and
    `manifest`; empty results are dropped. `floors` names baselines that never see the goal, `short`
    the column of `Run.summary`, `success` the measure that is 1 if all is right. `chance` is the
    main measure of guessing in a cell that is not a mean. `part_names` explain `Record.part`.
    """

    measures: tuple[Measure, ...]
    cells: Callable[[Suite, Manifest], tuple[Cell, ...]] = lambda *_: (WHOLE,)
    headline: tuple[LayoutColumn, ...] = ()
    tables: Mapping[str, Layout] = field(default_factory=dict)
    notes: Sequence[str] = ()
    floors: Sequence[str] = ()
    short: str = ""
    success: str = ""
    chance: Callable[[Suite, str], float] | None = None
    part_names: Mapping[str, str] = field(default_factory=dict)

    def heading(self, name: str) -> str:
        """Return the heading of the measure that counts an error or ending, or its name as words.

        The name of such a measure is `<kind>_<name>`.
        """
        plain = name.replace("_", " ").capitalize()
        return next((m.heading for m in self.measures if m.name.endswith(f"_{name}")), plain)


def read_report(track: str, counts: Iterable[SampleCounts], **code: Any) -> TrackReport:
    """Return the report of a track: its YAML file, joined with what is code.

    Measures are in groups that share fields. Each is the sum of the columns in `part` (by default
    the column of its name) over that of `whole`, a mean if its unit is not "%" or it says so; or
    the `mean_of` others of its counts, or the `difference_of` two.
    """
    declared = read_own_yaml(Path(__file__).with_name(f"{track}.yaml"))
    by_name, measures = {counted.name: counted for counted in counts}, dict[str, Measure]()
    for group in declared.pop("measures"):
        for name, own in group.pop("of").items():
            about = {"part": name, "whole": (), "mean": False, **group, **own}
            counted = by_name[about.pop("counts")]
            named = about.pop("part"), about.pop("whole")
            part, whole = ([one] if isinstance(one, str) else one for one in named)
            by = mean_of if about.pop("mean") else ratio_of
            about.setdefault("over", *whole[:1])
            if about.get("unit", "%") != "%":
                by, about = mean_of, {"most": math.inf, **about}
            if others := about.pop("mean_of", None):
                value = _combined(measures, others, lambda parts: np.mean(parts, axis=0))
            elif others := about.pop("difference_of", None):
                value = _combined(measures, others, lambda parts: parts[0] - parts[1])
                about["is_difference"] = True
            else:
                value = _divided(by, counted.columns, part, whole)
            measures[name] = Measure(name, counted=counted, value=value, **about)
    declared["headline"] = tuple(LayoutColumn(**column) for column in declared["headline"])
    declared["tables"] = {
        name: Layout(**{**one, "columns": [LayoutColumn(**column) for column in one["columns"]]})
        for name, one in declared["tables"].items()
    }
    return TrackReport(tuple(measures.values()), **declared, **code)


def _divided(by: Metric, columns: Sequence[str], *named: Sequence[str]) -> Metric:
    """Return the metric that divides the sum of some columns by that of others."""
    places = [[columns.index(name) for name in names] for names in named]
    return lambda sums: by(np.stack([sums[..., one].sum(axis=-1) for one in places], axis=-1))


def _combined(
    measures: Mapping[str, Measure], names: Sequence[str], join: Callable[[list[Any]], Any]
) -> Metric:
    """Return the metric that joins the values of measures, which may be declared later."""
    return lambda sums: np.asarray(join([measures[name].value(sums) for name in names]))
