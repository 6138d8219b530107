"""The first tables of the page: headlines with intervals, and what to hold them against."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Literal
from urllib.parse import urlencode

from phyblock.report.html.leads import samples_query
from phyblock.report.html.ranked import kinds_of, rank_texts
from phyblock.report.html.standing import shortfalls
from phyblock.results.estimates import (
    Floor,
    Value,
    blind_baselines,
    headline_columns,
    headline_floors,
    headline_of,
    main_column,
    main_measure,
    track_measures,
)
from phyblock.results.load import Run
from phyblock.results.text import NO_VALUE, captioned, number, spread
from phyblock.tracks.kind import kind_of
from phyblock.tracks.measures import Better, HeadlineColumn

__all__ = ["Cell", "Headline", "Row", "headlines"]

Kind = Literal["model", "baseline", "reference"]


@dataclass(frozen=True)
class Cell:
    """A number as shown, with the lines under it; `value` sorts, None where there is none.

    `query` is the address of the samples that it was made from, as the page reads it.
    """

    text: str
    value: float | None = None
    below: tuple[str, ...] = ()
    query: str = ""


@dataclass(frozen=True)
class Row:
    """A model, or a value to hold models against; `strip` is its main value and interval [%].

    There is none without a value, and for a main measure that is no share.
    `rank` is the place that a model may have (`2`, or `1 to 3` where tests cannot tell), `lacking`
    says how many samples have no reply and why.
    """

    name: str
    kind: Kind
    cells: tuple[Cell, ...]
    strip: tuple[float, float, float] | None = None
    rank: str = ""
    lacking: str = ""
    query: str = ""


@dataclass(frozen=True)
class Headline:
    """A headline table: `columns` head the cells, `references` are marked in every strip.

    The first column is what models are ranked by; it is called `strip_name`. Where it `has_strips`,
    as a share has, they draw it from 0 to 100 %. Models stand in the order of their rank.
    """

    track: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...]
    strip_name: str
    has_strips: bool
    references: dict[str, float] = field(default_factory=dict)

    @property
    def ranked(self) -> bool:
        """Whether there are ranks at all."""
        return any(row.rank for row in self.rows)


_BELOW = "Below each value stands its 95 % interval, from leaving out each base scene in turn."
_SEEDS = (
    "Values pool {} seeds; mean ± standard deviation over single seeds stands below the main one."
)
_RANKS = (
    "Rank: the places that a model may have, by paired tests of all models with Holm's correction."
)
_NOT_BETTER = "†"
_FLOOR = (
    "The floor is the best that is reached without seeing the goal; "
    f"{_NOT_BETTER} marks intervals that are not wholly better than it."
)


def headlines(run: Run) -> list[Headline]:
    """The headline of every track of the run, in its order."""
    return [_headline(run, track) for track in run.design.suite.tracks]


def _headline(run: Run, track: str) -> Headline:
    kind = kind_of(track)
    report = kind.report()
    main = main_column(run, track).heading
    columns = sorted(headline_columns(run, track), key=lambda column: column.heading != main)
    headings = [column.heading for column in columns]
    floors = headline_floors(run, track)
    references = report.references(run)
    rows = [
        *_model_rows(run, track, columns, floors),
        *_reference_rows(headings, floors, references, is_wider=bool(report.published(run))),
    ]
    marked = {name: numbers.get(main) for name, numbers in references.items()}
    return Headline(
        track,
        captioned(kind.title, (*report.showing(run), *run.varied_words)),
        (*headings, *(["Published"] if report.published(run) else [])),
        tuple(rows),
        (" ".join(_notes(run, track, rows, has_floors=bool(floors))),),
        main,
        main_measure(run, track).is_share,
        {
            name.partition(" ")[0].rstrip(","): value
            for name, value in marked.items()
            if value is not None
        },
    )


def _model_rows(
    run: Run, track: str, columns: Sequence[HeadlineColumn], floors: Mapping[str, Floor]
) -> list[Row]:
    """Models and baselines by rank; the first column is the main one."""
    values, published = headline_of(run, track), kind_of(track).report().published(run)
    headings = [column.heading for column in columns]
    main = headings[0]
    measures = {measure.name: measure for measure in track_measures(track)}
    better = [measures[column.measure].better for column in columns]
    is_share = measures[columns[0].measure].is_share
    queries = {column.heading: samples_query(run, track, column.cell) for column in columns}
    own_floors = blind_baselines(run, track)
    ranks, lacking = rank_texts(run, track), shortfalls(run, track)
    rows = []
    for name, sort in kinds_of(run).items():
        of_name = [values.get((name, heading)) for heading in headings]
        held = {} if name in own_floors else floors
        of_model = urlencode({"model": name})
        cells = [
            *(
                _cell(value, held.get(head), way, f"{queries[head]}&{of_model}", seeds=head == main)
                for value, head, way in zip(of_name, headings, better, strict=True)
            ),
            *([_plain(published.get(name), NO_VALUE)] if published else []),
        ]
        rows.append(
            Row(
                name,
                sort,
                tuple(cells),
                _strip(of_name[0]) if is_share else None,
                ranks.get(name, ""),
                lacking.get(name, ""),
                f"{urlencode({'track': track})}&{of_model}",
            )
        )
    return sorted(rows, key=partial(_place, is_ascending=better[0] == "lower"))


def _reference_rows(
    headings: Sequence[str],
    floors: Mapping[str, Floor],
    references: Mapping[str, Mapping[str, float]],
    *,
    is_wider: bool,
) -> Iterator[Row]:
    """What models are held against; `is_wider` where the table has published values as well."""
    empty = [Cell("")] if is_wider else []
    numbers_of: dict[str, Mapping[str, float]] = {}
    if floors:
        names = ", ".join(dict.fromkeys(floor.name for floor in floors.values()))
        own = {heading: floor.value for heading, floor in floors.items()}
        numbers_of[f"Floor: {names}"] = own
    for name, numbers in {**numbers_of, **references}.items():
        cells = [_plain(numbers.get(heading)) for heading in headings]
        yield Row(name, "reference", (*cells, *empty))


def _place(row: Row, *, is_ascending: bool) -> tuple[bool, bool, float]:
    value = row.cells[0].value
    number = 0.0 if value is None else value
    return row.kind != "model", value is None, number if is_ascending else -number


def _notes(run: Run, track: str, rows: Sequence[Row], *, has_floors: bool) -> list[str]:
    report, seeds = kind_of(track).report(), len(run.design.suite.seeds)
    return [
        *report.notes(run),
        *([report.reference_note] if report.reference_note else []),
        *([_RANKS] if any(row.rank for row in rows) else []),
        *([_SEEDS.format(seeds)] if seeds > 1 else []),
        *([_FLOOR] if has_floors else []),
        *([_BELOW] if any(cell.below for row in rows for cell in row.cells) else []),
    ]


def _cell(
    value: Value | None, floor: Floor | None, better: Better, query: str, *, seeds: bool
) -> Cell:
    if value is None or math.isnan(value.value):
        return Cell(NO_VALUE, query=query)
    below = [] if math.isnan(value.lo) else [f"{number(value.lo)} to {number(value.hi)}"]
    if below and floor is not None and not floor.is_below(value, better):
        below[0] += f" {_NOT_BETTER}"
    if seeds and not math.isnan(value.sd):
        below.append(f"seeds {spread(value.mean, value.sd)}")
    return Cell(number(value.value), value.value, tuple(below), query)


def _strip(value: Value | None) -> tuple[float, float, float] | None:
    if value is None or math.isnan(value.value):
        return None
    ends = (value.value, value.value) if math.isnan(value.lo) else (value.lo, value.hi)
    return (value.value, *ends)


def _plain(value: float | None, blank: str = "") -> Cell:
    """A number with nothing under it."""
    return Cell(blank) if value is None else Cell(number(value), value)
