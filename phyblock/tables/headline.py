"""The estimates that stand for a track: its headline columns, with their intervals."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from phyblock.tables.design import Design
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, Measure
from phyblock.tables.text_table import Column, TextTable, between, spread, with_interval
from phyblock.tables.track_report import HeadlineColumn

__all__ = [
    "Value",
    "headline_rows",
    "headline_values",
    "interval_frame",
    "interval_view",
    "rows_of",
    "seeds_notes",
    "uncertainty_cells",
    "uncertainty_columns",
]

_INTERVAL, _SEEDS = "95 % CI", "Seeds"
_SEEDS_NOTE = "Seeds: mean ± standard deviation over the values of single seeds."
_ENDS = ("lo", "hi", "mean", "sd")


@dataclass(frozen=True)
class Value:
    """An estimate as tables show it, in the unit of its measure (percent for shares).

    `value` is of all samples, pooled over seeds; `mean` and `sd` are over the values of single
    seeds, `sd` NaN where one alone has a value; `lo` and `hi` are NaN where there is no interval.
    """

    value: float
    mean: float
    sd: float
    lo: float
    hi: float


def headline_rows(estimates: pd.DataFrame, design: Design) -> pd.DataFrame:
    """The rows of a frame of estimates in the headline setting and matcher."""
    return estimates[
        estimates["setting"].isin(["", design.setting])
        & estimates["matcher"].isin(["", design.matcher])
    ]


def rows_of(rows: pd.DataFrame, column: HeadlineColumn) -> pd.DataFrame:
    """The rows of a frame of estimates that stand in a headline column."""
    mine = rows[(rows["measure"] == column.measure) & (rows[CELL] == column.cell)]
    return mine[mine["criterion"] == column.criterion] if column.criterion else mine


def headline_values(
    estimates: pd.DataFrame,
    design: Design,
    measures: Sequence[Measure],
    columns: Sequence[HeadlineColumn],
) -> Mapping[tuple[str, str], Value]:
    """Values by model and heading."""
    scale = {measure.name: measure.scale for measure in measures}
    rows = headline_rows(estimates, design)
    values = {}
    for column in columns:
        for row in rows_of(rows, column).to_dict("records"):
            names = ("value", "mean", "sd", "lo", "hi")
            numbers = (scale[column.measure] * float(row[name]) for name in names)
            values[str(row["model"]), column.heading] = Value(*numbers)
    return values


def uncertainty_columns(design: Design, group: str) -> tuple[Column, ...]:
    """Columns for the interval of a value and, where there are several seeds, what they say."""
    names = (_INTERVAL, _SEEDS) if len(design.suite.seeds) > 1 else (_INTERVAL,)
    return tuple(Column(name, group) for name in names)


def uncertainty_cells(row: Mapping[Hashable, Any], cell: str, design: Design) -> tuple[str, ...]:
    """Texts of `uncertainty_columns` out of the columns `<cell>_lo`, `_hi`, `_mean` and `_sd`."""
    lo, hi, mean, sd = (float(row.get(f"{cell}_{end}", math.nan)) for end in _ENDS)
    return (between(lo, hi), spread(mean, sd))[: len(uncertainty_columns(design, ""))]


def seeds_notes(design: Design) -> tuple[str, ...]:
    """What a table says of several seeds; () for one."""
    seeds = len(design.suite.seeds)
    return (f"Values pool the samples of {seeds} seeds.", _SEEDS_NOTE) if seeds > 1 else ()


def interval_frame(
    estimates: pd.DataFrame, design: Design, scale: float, by: Sequence[str]
) -> pd.DataFrame:
    """Pooled values with intervals, a row an estimate, models in the order of the suite.

    Columns are `model`, those of `by`, value, lo, hi, se (times `scale`), n, seeds, n_scenes,
    n_clusters.
    """
    place = {name: number for number, name in enumerate(design.model_names)}
    rows = headline_rows(estimates, design)
    rows = rows[rows["model"].isin(place)]
    rows = rows.sort_values("model", key=lambda names: names.map(place), kind="stable")
    numbers = ["value", "lo", "hi", "se"]
    table = rows[["model", *by, *numbers, "n", "seeds", "n_scenes", "n_clusters"]].copy()
    table[numbers] = scale * table[numbers].astype("float64")
    return table.reset_index(drop=True)


def interval_view(table: pd.DataFrame, run: Run, cells: Sequence[str], caption: str) -> TextTable:
    """Values with intervals out of `interval_frame`: a row a model, a pair of columns a cell."""
    rows = []
    for model, part in table.groupby("model", sort=False):
        of_cell = part.set_index(CELL).to_dict("index")
        texts = (text for cell in cells for text in with_interval(of_cell[cell]))
        rows.append((str(model), *texts))
    columns = [
        Column(name, cell.replace("_", " ").capitalize())
        for cell in cells
        for name in ("%", "95 % CI")
    ]
    most = f", at most {table['n_clusters'].max()} of them" if len(table) else ""
    return TextTable(
        f"{caption} with 95 % intervals{run.design.of_suite}",
        (Column("Model", is_text=True), *columns),
        tuple(rows),
        (f"Intervals: base scenes left out in turn{most}.",),
    )
