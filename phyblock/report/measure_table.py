"""Tables that any track has: its headline measures, and measures that stand in no other table."""

from __future__ import annotations

import math
from dataclasses import asdict, fields

import pandas as pd

from phyblock.tables.headline import Value, headline_rows, headline_values
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL
from phyblock.tables.text_table import (
    Column,
    TextTable,
    between,
    number,
    track_column,
    track_text,
)
from phyblock.text import counted
from phyblock.tracks.estimates import (
    headline_columns,
    main_column,
    samples_lacking,
    track_estimates,
    track_measures,
)
from phyblock.tracks.kind import kind_of

__all__ = [
    "headline_frame",
    "headline_of",
    "headline_view",
    "main_heading",
    "measures_frame",
    "measures_view",
]

_NUMBERS = ("value", "lo", "hi", "se", "mean", "sd")


def main_heading(run: Run, track: str) -> str:
    """Heading of the column that models are ranked by."""
    return main_column(run, track).heading


def headline_of(run: Run, track: str) -> dict[tuple[str, str], Value]:
    """Values of a track's headline by model and heading."""
    found, measures = track_estimates(run, track), track_measures(track)
    return dict(headline_values(found, run.design, measures, headline_columns(run, track)))


def headline_frame(track: str, run: Run) -> pd.DataFrame:
    """One row a model and column of the headline, in the unit of its measure."""
    values = headline_of(run, track)
    rows = [
        {"model": model, "column": heading, **asdict(value)}
        for (model, heading), value in values.items()
    ]
    names = [field.name for field in fields(Value)]
    return pd.DataFrame(rows, columns=["model", "column", *names])


def headline_view(track: str, table: pd.DataFrame, run: Run) -> TextTable:
    """Values with their intervals out of `headline_frame`."""
    headings = [column.heading for column in headline_columns(run, track)]
    values = {(row["model"], row["column"]): row for row in table.to_dict("records")}
    rows = []
    for model in run.design.model_names:
        texts = [model]
        for heading in headings:
            row = values.get((model, heading), {"value": math.nan, "lo": math.nan, "hi": math.nan})
            texts += [number(row["value"]), between(row["lo"], row["hi"])]
        rows.append(tuple(texts))
    columns = [Column(name, heading) for heading in headings for name in ("Value", "95 % CI")]
    kind = kind_of(track)
    return TextTable(
        f"{kind.title}{run.design.of_suite}",
        (Column("Model", is_text=True), *columns),
        tuple(rows),
        tuple(kind.report().notes(run)),
    )


def measures_frame(run: Run) -> pd.DataFrame:
    """Measures that stand in no table of their track: a row a track, measure, model and cell.

    `n` is the number of samples behind each, whatever a measure counts of them.
    """
    parts = []
    for track in run.design.suite.tracks:
        found = headline_rows(track_estimates(run, track), run.design)
        shown = {column.measure for column in headline_columns(run, track)}
        for measure in track_measures(track):
            if measure.in_tables and measure.name not in shown:
                mine = found[found["measure"] == measure.name].copy()
                mine[list(_NUMBERS)] = measure.scale * mine[list(_NUMBERS)].astype("float64")
                parts.append(mine.assign(track=track, unit=measure.unit))
    columns = ["track", "measure", "unit", "model", CELL, "n", *_NUMBERS]
    return pd.concat(parts)[columns] if parts else pd.DataFrame(columns=columns)


def measures_view(table: pd.DataFrame, run: Run) -> TextTable:
    """A row a model and measure out of `measures_frame`, with its value over everything."""
    tracks = run.design.suite.tracks
    whole = {track: kind_of(track).report().cells(run)[-1].name for track in tracks}
    rows, notes = [], {}
    for row in table.to_dict("records"):
        if row[CELL] != whole[row["track"]]:
            continue
        (measure,) = (m for m in track_measures(row["track"]) if m.name == row["measure"])
        value, interval = number(row["value"], 2), between(row["lo"], row["hi"])
        named = (*track_text(row["track"], tracks), measure.heading_in_unit)
        rows.append((row["model"], *named, value, interval, str(row["n"])))
        key = row["track"], measure.name
        notes[key] = (
            f"{measure.heading}: {measure.meaning}; counted over {measure.over}; "
            f"{measure.better} is better."
        )
        if lacking := samples_lacking(run, row["track"], measure.counted):
            notes[key] += (
                f" Not in it: {counted(lacking, 'sample')} judged before it was there, which "
                "phyblock score counts."
            )
    columns = (
        Column("Model", is_text=True),
        *track_column(tracks),
        Column("Measure", is_text=True),
        Column("Value"),
        Column("95 % CI"),
        Column("Samples"),
    )
    return TextTable("Further measures", columns, tuple(rows), tuple(dict.fromkeys(notes.values())))
