"""The paper's results tables beside ours: published, ours, difference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd

from phyblock.report.comparison import published_frame, published_table
from phyblock.report.design import OVERALL
from phyblock.report.load import Run
from phyblock.report.seeds import table5_frame
from phyblock.report.text_table import Column, TextTable, level_name, number
from phyblock.report.views import published_view

__all__ = ["PAPER_TABLES", "PaperTable", "beside", "paper_table5_frame", "paper_table5_view"]

_LEVELS = ("1", "2", "3", "4", OVERALL)


@dataclass(frozen=True)
class PaperTable:
    """How one table of the paper is compared.

    `frame` has a row a cell with columns model, published_name, published, ours, difference; it is
    empty where no model of the run has a row in that table.
    """

    frame: Callable[[Run], pd.DataFrame]
    view: Callable[[pd.DataFrame, Run], TextTable]


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


def paper_table5_frame(run: Run) -> pd.DataFrame:
    """Mean and sd of F1 over seeds by level beside the paper's Table 5."""
    table = table5_frame(run)
    rows = [
        (row["model"], level, f"f1_{kind}", row[f"{name}_{kind}"])
        for row in table.to_dict("records")
        for level in run.design.levels
        for name in (level if level == OVERALL else f"level{level}",)
        for kind in ("mean", "sd")
    ]
    ours = pd.DataFrame(rows, columns=["model", "level", "metric", "ours"])
    return beside(published_table(5), ours.astype({"ours": "float64"}), run, ["level", "metric"])


def paper_table5_view(table: pd.DataFrame, run: Run) -> TextTable:
    """A row a model and statistic out of `paper_table5_frame`."""
    cells = {
        (row["model"], row["metric"], row["level"]): (
            number(row["published"], 2),
            number(row["ours"], 2),
            number(row["difference"], 2, signed=True),
        )
        for row in table.to_dict("records")
    }
    kinds = {"f1_mean": "F1 mean", "f1_sd": "F1 sd"}
    rows = [
        (
            label,
            kinds[metric],
            *(cell for level in _LEVELS for cell in cells[model, metric, level]),
        )
        for model, name in dict(zip(table["model"], table["published_name"], strict=True)).items()
        for label, metric in zip((model, f"({name})"), kinds, strict=True)
    ]
    columns = (
        Column("Model", is_text=True),
        Column("Statistic", is_text=True),
        *(
            Column(name, level_name(level))
            for level in _LEVELS
            for name in ("Paper", "Ours", "Diff")
        ),
    )
    note = f"Ours: setting {run.design.setting}, matcher {run.design.matcher}; sd with ddof = 1."
    return TextTable("Our numbers beside the paper's Table 5 (%)", columns, tuple(rows), (note,))


PAPER_TABLES: dict[int, PaperTable] = {
    1: PaperTable(published_frame, published_view),
    5: PaperTable(paper_table5_frame, paper_table5_view),
}
"""By the number of the table in the paper."""
