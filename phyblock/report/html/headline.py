"""The first tables of the page: headlines with intervals, and what to hold them against."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from phyblock.report.floors import Floor, floors_run, headline_floors
from phyblock.report.measure_table import headline_of, main_heading
from phyblock.tables.headline import Value
from phyblock.tables.load import Run
from phyblock.tables.showing import captioned, varied_words
from phyblock.tables.text_table import NO_VALUE, number, spread
from phyblock.tracks.headline import headline_columns
from phyblock.tracks.kind import kind_of

__all__ = ["Cell", "Headline", "Row", "headlines"]

Kind = Literal["model", "baseline", "reference"]


@dataclass(frozen=True)
class Cell:
    """A number as shown, with the lines under it; `value` sorts, None where there is none."""

    text: str
    value: float | None = None
    below: tuple[str, ...] = ()


@dataclass(frozen=True)
class Row:
    """A model, or a value to hold models against; `strip` is its overall value and interval [%]."""

    name: str
    kind: Kind
    cells: tuple[Cell, ...]
    strip: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Headline:
    """A headline table: `columns` head the cells, `references` [%] are marked in every strip.

    The column with number `main`, from 0, is what the strips draw and is called `strip_name`.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...]
    main: int
    strip_name: str
    references: dict[str, float] = field(default_factory=dict)


_BELOW = "Below each value stands its 95 % interval, from leaving out each base scene in turn."
_SEEDS = (
    "Values pool {} seeds; mean ± standard deviation over single seeds stands below the main one."
)
_FLOOR = "The floor is the most that is reached without seeing the goal."


def headlines(run: Run) -> list[Headline]:
    """The headline of every track of the run, in its order."""
    return [_headline(run, track) for track in run.design.suite.tracks]


def _headline(run: Run, track: str) -> Headline:
    kind = kind_of(track)
    report, columns = kind.report(), headline_columns(run, track)
    values = headline_of(run, track)
    headings = [column.heading for column in columns]
    published = report.published(run)
    floors = headline_floors(run, track)
    own_floors = floors_run(run, track)
    main = headings.index(main_heading(run, track))
    rows = []
    for name, sort in kinds_of(run).items():
        found = [values.get((name, heading)) for heading in headings]
        held = {} if name in own_floors else floors
        cells = [
            *(
                _cell(value, held.get(head), seeds=place == main)
                for place, (value, head) in enumerate(zip(found, headings, strict=True))
            ),
            *([_plain(published.get(name), NO_VALUE)] if published else []),
        ]
        rows.append(Row(name, sort, tuple(cells), _strip(found[main])))
    if floors:
        own = {heading: floor.value for heading, floor in floors.items()}
        names = ", ".join(dict.fromkeys(floor.name for floor in floors.values()))
        floor_cells = [_plain(own.get(heading)) for heading in headings]
        empty = [Cell("")] if published else []
        rows.append(Row(f"Floor: {names}", "reference", (*floor_cells, *empty)))
    references = report.references(run)
    for name, numbers in references.items():
        cells = [_plain(numbers.get(heading)) for heading in headings]
        rows.append(Row(name, "reference", (*cells, *([Cell("")] if published else []))))
    marked = {name: numbers.get(headings[main]) for name, numbers in references.items()}
    seeds = len(run.design.suite.seeds)
    mean = (_SEEDS.format(seeds),) if seeds > 1 else ()
    floor_note = (_FLOOR,) if floors else ()
    below = (_BELOW,) if any(cell.below for row in rows for cell in row.cells) else ()
    about = (report.reference_note,) if report.reference_note else ()
    return Headline(
        captioned(kind.title, (*report.showing(run), *varied_words(run))),
        (*headings, *(["Published"] if published else [])),
        tuple(rows),
        (" ".join((*report.notes(run), *about, *mean, *floor_note, *below)),),
        main,
        headings[main],
        {
            name.partition(" ")[0].rstrip(","): value
            for name, value in marked.items()
            if value is not None
        },
    )


def _cell(value: Value | None, floor: Floor | None, *, seeds: bool) -> Cell:
    if value is None or math.isnan(value.value):
        return Cell(NO_VALUE)
    below = [] if math.isnan(value.lo) else [f"{number(value.lo)} to {number(value.hi)}"]
    if below and floor is not None and not floor.is_below(value.lo, value.hi):
        below[0] += ", not above the floor"
    if seeds and not math.isnan(value.sd):
        below.append(f"seeds {spread(value.mean, value.sd)}")
    return Cell(number(value.value), value.value, tuple(below))


def _strip(value: Value | None) -> tuple[float, float, float] | None:
    if value is None or math.isnan(value.value):
        return None
    ends = (value.value, value.value) if math.isnan(value.lo) else (value.lo, value.hi)
    return (value.value, *ends)


def _plain(value: float | None, blank: str = "") -> Cell:
    """A percentage with nothing under it."""
    return Cell(blank) if value is None else Cell(number(value), value)


def kinds_of(run: Run) -> dict[str, Kind]:
    """Which models are baselines; these come last."""
    kinds = {model.name: model.kind for model in run.manifest.models}
    baselines = [name for name in run.design.model_names if kinds.get(name) == "baseline"]
    models = [name for name in run.design.model_names if name not in baselines]
    return {**dict.fromkeys(models, "model"), **dict.fromkeys(baselines, "baseline")}
