"""The paper's results tables beside ours: published, ours, difference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import pandas as pd

from phyblock.domain import CATEGORIES
from phyblock.report.cells import METRICS
from phyblock.report.comparison import published_frame, published_table
from phyblock.report.design import OVERALL
from phyblock.report.load import Run
from phyblock.report.questions import CELLS
from phyblock.report.seeds import table5_frame
from phyblock.report.table3 import table3_frame
from phyblock.report.text_table import Column, TextTable, level_name, number
from phyblock.report.views import published_view
from phyblock.report.vqa import table2_frame

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


def paper_table1_frame(run: Run) -> pd.DataFrame:
    """`published_frame`; no rows for a run without full planning."""
    table = published_frame(run)
    return table if run.design.tracks else table.iloc[:0]


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
    printed = published_table(5) if run.design.tracks else published_table(5).iloc[:0]
    return beside(printed, ours.astype({"ours": "float64"}), run, ["level", "metric"])


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


def paper_table2_frame(run: Run) -> pd.DataFrame:
    """Accuracies by subtask, category and overall beside the paper's Table 2."""
    return _interleaved(table2_frame(run), CELLS) if "vqa" in run.design.suite.tracks else _NOTHING


def paper_table3_frame(run: Run) -> pd.DataFrame:
    """Precision, recall and F1 of step planning beside the paper's Table 3."""
    cells = [f"placed_{metric}" for metric in METRICS]
    asked = "step_planning" in run.design.suite.tracks
    return _interleaved(table3_frame(run), cells) if asked else _NOTHING


def _interleaved(table: pd.DataFrame, cells: Sequence[str]) -> pd.DataFrame:
    """Cells of a table in which a published row may follow that of a model."""
    sources = table.to_dict("records")
    ours = {row["model"]: row for row in sources if row["source"] == "run"}
    rows = [
        (row["model"], row["published_name"], cell, row[cell], ours[row["model"]][cell])
        for row in sources
        if row["source"] == "published"
        for cell in cells
    ]
    names = ["model", "published_name", "cell", "published", "ours"]
    found = pd.DataFrame(rows, columns=names).astype({"published": "float64", "ours": "float64"})
    return found.assign(difference=found["ours"] - found["published"])


def _cells_view(table: pd.DataFrame, run: Run, *, number_in_paper: int, note: str) -> TextTable:
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
    columns = [Column(_CELL_NAMES.get(cell, cell)) for cell in cells]
    suite = f", suite {run.design.suite.name}" if run.design.suite.name else ""
    return TextTable(
        f"Our numbers beside the paper's Table {number_in_paper}{suite} (%)",
        (Column("Model", is_text=True), Column("", is_text=True), *columns),
        tuple(rows),
        (note,),
    )


def paper_table2_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Out of `paper_table2_frame`."""
    note = (
        "Averages are unweighted means. The questions are our own: the paper's are not published."
    )
    return _cells_view(table, run, number_in_paper=2, note=note)


def paper_table3_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Out of `paper_table3_frame`."""
    note = f"Setting {run.design.setting}; precision is over the blocks that were placed."
    return _cells_view(table, run, number_in_paper=3, note=note)


_KINDS = {"published": "paper", "ours": "ours", "difference": "difference"}
_CELL_NAMES: dict[str, str] = {**dict.fromkeys(CATEGORIES, "Avg"), "overall": "Overall"}
_CELL_NAMES |= {"placed_precision": "Prec", "placed_recall": "Rec", "placed_f1": "F1"}
_NOTHING = pd.DataFrame(
    columns=["model", "published_name", "cell", "published", "ours", "difference"]
)

PAPER_TABLES: dict[int, PaperTable] = {
    1: PaperTable(paper_table1_frame, published_view),
    2: PaperTable(paper_table2_frame, paper_table2_view),
    3: PaperTable(paper_table3_frame, paper_table3_view),
    5: PaperTable(paper_table5_frame, paper_table5_view),
}
"""By the number of the table in the paper."""
