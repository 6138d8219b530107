"""The numbers that the paper prints."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from importlib.resources import files
from typing import Any

import pandas as pd

from phyblock.tables.load import Run
from phyblock.tables.text_table import Column, TextTable, level_name, number

__all__ = [
    "HUMAN_NOTE",
    "NOTHING",
    "OURS",
    "PUBLISHED",
    "beside",
    "beside_by_level",
    "beside_view",
    "interleaved",
    "published_table",
    "row_name",
]

HUMAN_NOTE = (
    "Human experts, published: 94.7 % of 400 tasks drawn from planning and questions together "
    "(378.83 points). A mix of both, no F1 and no accuracy of questions: it stands in no column "
    "here."
)
"""What is said of people in words alone; the paper gives no number of theirs for one track."""

OURS, PUBLISHED = "run", "published"
"""Where a row is from, in a table in which published rows may follow those of models."""

_KINDS = {"published": "paper", "ours": "ours", "difference": "difference"}
NOTHING = pd.DataFrame(
    columns=["model", "published_name", "cell", "published", "ours", "difference"]
)
"""What a run that lacks the track of a table has beside it."""


def published_table(number: int) -> pd.DataFrame:
    """A results table of the paper (1, 2, 3 or 5), one printed value [%] a row.

    `published/README.md` says what the columns are and where the numbers come from.
    """
    with (files("phyblock.tables") / "published" / f"table{number}.csv").open("rb") as file:
        return pd.read_csv(file, dtype={"level": "object"})


def beside(printed: pd.DataFrame, ours: pd.DataFrame, run: Run, keys: list[str]) -> pd.DataFrame:
    """Published cells of the run's models with our value and ours minus published [%].

    `printed` is a `published_table`; `ours` has the columns model, `keys` and ours [%].
    """
    names = pd.DataFrame(
        list(run.design.published.items()), columns=["model", "published_name"], dtype="object"
    )
    cells = names.merge(
        printed.rename(columns={"model": "published_name", "value": "published"}),
        on="published_name",
    )
    table = cells.merge(ours, on=["model", *keys], how="left")
    table["difference"] = table["ours"] - table["published"]
    return table[["model", "published_name", *keys, "published", "ours", "difference"]]


def row_name(row: Mapping[Hashable, Any]) -> str:
    """What a row of a table is called in which published rows follow those of models."""
    published = f"  as published ({row['published_name']})"
    return str(row["model"]) if row["source"] == OURS else published


def interleaved(table: pd.DataFrame, cells: Sequence[str]) -> pd.DataFrame:
    """Cells of a table in which a published row may follow that of a model."""
    sources = table.to_dict("records")
    ours = {row["model"]: row for row in sources if row["source"] == OURS}
    rows = [
        (row["model"], row["published_name"], cell, row[cell], ours[row["model"]][cell])
        for row in sources
        if row["source"] == PUBLISHED
        for cell in cells
    ]
    names = ["model", "published_name", "cell", "published", "ours"]
    frame = pd.DataFrame(rows, columns=names).astype({"published": "float64", "ours": "float64"})
    return frame.assign(difference=frame["ours"] - frame["published"])


def beside_by_level(
    table: pd.DataFrame,
    levels: Sequence[str],
    heading: str,
    metrics: Mapping[str, str],
    digits: int,
) -> tuple[tuple[Column, ...], tuple[tuple[str, ...], ...]]:
    """Columns, three a level (Paper, Ours, Diff), and rows, one a model and metric, which has a
    name in `metrics`. Under the name of a model stands the name that it was published by.
    """
    cells = {
        (row["model"], row["metric"], row["level"]): (
            number(row["published"], digits),
            number(row["ours"], 2),
            number(row["difference"], 2, signed=True),
        )
        for row in table.to_dict("records")
    }
    rows = tuple(
        (label, name, *(cell for level in levels for cell in cells[model, metric, level]))
        for model, published in dict(
            zip(table["model"], table["published_name"], strict=True)
        ).items()
        for label, (metric, name) in zip(
            (model, f"({published})", ""), metrics.items(), strict=False
        )
    )
    parts = (Column(part, level_name(at)) for at in levels for part in ("Paper", "Ours", "Diff"))
    return (Column("Model", is_text=True), Column(heading, is_text=True), *parts), rows


def beside_view(
    table: pd.DataFrame, run: Run, *, number_in_paper: int, names: Mapping[str, str], note: str
) -> TextTable:
    """Three rows a model: published, ours, difference; a column a cell."""
    cells = list(dict.fromkeys(table["cell"]))
    rows = []
    for model, part in table.groupby("model", sort=False):
        by_cell = part.set_index("cell").to_dict()
        label = f"{model} ({part['published_name'].iloc[0]})"
        for head, kind, signed in (
            (label, "published", False),
            ("", "ours", False),
            ("", "difference", True),
        ):
            values = (number(by_cell[kind][cell], signed=signed) for cell in cells)
            rows.append((head, _KINDS[kind], *values))
    columns = [Column(names.get(cell, cell)) for cell in cells]
    return TextTable(
        f"Our numbers beside the paper's Table {number_in_paper}{run.design.of_suite} (%)",
        (Column("Model", is_text=True), Column("", is_text=True), *columns),
        tuple(rows),
        (note,),
    )
