"""The numbers that the paper prints, and ours beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
import pandas as pd

from phyblock.results.estimates import headline_rows, pooled_in, track_estimates
from phyblock.results.load import Run
from phyblock.results.text import Column, Table, TextTable, number
from phyblock.tracks.measures import CELL, OVERALL

_SETTING = "A"
"""The setting of every number in Table 1."""
_OVERALL_LEVELS = frozenset({2, 3, 4})
"""Levels whose scenes the paper's overall numbers pool."""


@dataclass(frozen=True)
class _Published:
    """A table of the paper: the track and way of counting that is ours, decimals, a note.

    `columns` are those of estimates, by metric as it is printed, with their headings.
    """

    track: str
    columns: Mapping[str, tuple[str, str, str]]
    note: str
    criterion: str = ""
    digits: int = 1


_TABLES = {
    1: _Published(
        "full_planning",
        {
            "precision": ("precision", "value", "Prec"),
            "recall": ("recall", "value", "Rec"),
            "f1": ("f1", "value", "F1"),
        },
        "Ours: setting A, micro averages. Published: micro averages of one run.",
    ),
    2: _Published(
        "vqa",
        {"accuracy": ("accuracy", "value", "Accuracy")},
        "Averages are unweighted means. The questions are our own: the paper's are not published.",
    ),
    3: _Published(
        "step_planning",
        {"recall": ("recall", "value", "Rec")},
        "Of the published numbers, of the paper's own scenes, recall alone stands beside ours: it "
        "is of the goal's blocks, whatever was tried. Precision depends on which wrong blocks a "
        "simulator lets stand, which the paper does not say.",
        "placed",
    ),
    5: _Published(
        "full_planning",
        {"f1_mean": ("f1", "mean", "F1 mean"), "f1_sd": ("f1", "sd", "F1 sd")},
        "Both: means over single seeds, sd with ddof = 1; all other tables pool the seeds.",
        digits=2,
    ),
}
PAPER_TABLES = tuple(_TABLES)
"""Numbers of the paper's tables of results."""


def published_table(table: int) -> pd.DataFrame:
    """Return a results table of the paper (1, 2, 3 or 5), one printed value [%] a row.

    `published/README.md` says what the columns are and where the numbers come from.
    """
    with (files("phyblock.results") / "published" / f"table{table}.csv").open("rb") as file:
        return pd.read_csv(file, dtype={"level": "object"})


def published_frame(run: Run, table: int) -> pd.DataFrame:
    """Return one row for each printed value of a model of the run, with ours [%].

    Columns are model, published_name, cell, metric, published, ours, difference (ours less
    published) and n, the samples behind ours. Ours is not rounded, and NaN for what the run does
    not measure. Table 1 is compared in setting A by the `paper` matcher where the run has it.
    """
    paper, design = _TABLES[table], run.design
    printed = published_table(table)
    if table == 2:
        is_average = printed["subtask"] == "average"
        printed["level"] = printed["subtask"].where(~is_average, printed["category"])
        printed["metric"] = "accuracy"
    printed = printed[printed["metric"].isin(list(paper.columns))]
    printed = printed.rename(
        columns={"model": "published_name", "value": "published", "level": CELL}
    )
    names = pd.DataFrame(
        [(m.name, m.published) for m in design.models if m.published],
        columns=["model", "published_name"],
    )
    cells = names.astype("object").merge(printed, on="published_name")
    rows = pd.DataFrame(columns=["model", CELL, "metric", "ours", "n"])
    if paper.track in design.suite.tracks and (table != 5 or len(design.suite.seeds) > 1):
        rows = _ours(run, table)
    elif paper.track not in design.suite.tracks or table == 5:
        cells = cells.iloc[:0]
    found = cells.merge(rows, on=["model", CELL, "metric"], how="left")
    found["ours"] = found["ours"].astype("float64")
    found["difference"] = found["ours"] - found["published"]
    found["n"] = found["n"].astype("float64").fillna(0).astype("int64")
    columns = ["model", "published_name", CELL, "metric", "published", "ours", "difference", "n"]
    return found[columns]


def is_as_published(run: Run) -> bool:
    """True if a run counts official scenes as the paper's Table 1 does."""
    suite = run.design.suite
    return (
        suite.dataset.format == "official"
        and "paper" in suite.scoring.matchers
        and (1 not in suite.levels or suite.scoring.level1 == "membership")
        and _SETTING in suite.settings
    )


def _ours(run: Run, table: int) -> pd.DataFrame:
    paper, design = _TABLES[table], run.design
    estimates = track_estimates(run, paper.track)
    found = headline_rows(estimates, design)
    if table == 1:
        matcher = "paper" if "paper" in design.suite.scoring.matchers else design.matcher
        is_a = estimates["setting"] == (_SETTING if _SETTING in design.suite.settings else None)
        found = estimates[is_a & estimates["matcher"].isin(["", matcher])]
        if not set(design.suite.levels) >= _OVERALL_LEVELS:
            found = found[found[CELL] != OVERALL]
    if paper.criterion:
        found = found[found["criterion"] == paper.criterion]
    parts = []
    for metric, (measure, column, _) in paper.columns.items():
        mine = found[found["measure"] == measure]
        ours = 100 * mine[column].astype("float64")
        parts.append(mine[["model", CELL, "n"]].assign(metric=metric, ours=ours))
    rows = pd.concat(parts)
    if table == 2:
        # A mean over a part of what the paper averages is not the same number.
        from phyblock.tracks.vqa_results import ALL_CELLS

        cells = run.cells(paper.track)
        asked = {cell.name: pooled_in(cell, cells) for cell in cells}
        whole = {cell.name: pooled_in(cell, ALL_CELLS) for cell in ALL_CELLS}
        rows.loc[rows[CELL].map(asked) != rows[CELL].map(whole), "ours"] = np.nan
    return rows


def beside_paper(run: Run, table: int) -> Table | None:
    """Return our numbers beside a table of the paper; None where it has no model of the run."""
    frame, paper = published_frame(run, table), _TABLES[table]
    if not len(frame):
        return None
    cells = list(dict.fromkeys(frame[CELL]))
    known = frame.set_index(["model", "metric", CELL]).to_dict("index")
    kinds = {"Paper": ("published", paper.digits), "Ours": ("ours", 2), "Diff": ("difference", 2)}
    rows = []
    for model, name in dict(zip(frame["model"], frame["published_name"], strict=True)).items():
        label = model if model == name else f"{model} ({name})"
        for place, (metric, (_, _, heading)) in enumerate(paper.columns.items()):
            found = [known.get((model, metric, cell), {}) for cell in cells]
            texts = [
                number(float(row.get(kind, np.nan)), digits, signed=kind == "difference")
                for row in found
                for kind, digits in kinds.values()
            ]
            rows.append((label if place == 0 else "", heading, *texts))
    compared = frame["difference"].dropna()
    notes = [paper.note]
    if len(compared):
        largest = number(compared.abs().max(), 3)
        notes.insert(0, f"Largest absolute difference of {len(compared)} cells: {largest}.")
    headings = {cell.name: cell.heading for cell in run.cells(paper.track)}
    columns = (Column(kind, headings.get(cell, cell)) for cell in cells for kind in kinds)
    head = (Column("Model", is_text=True), Column("", is_text=True), *columns)
    caption = f"Our numbers beside the paper's Table {table}{run.design.of_suite} (%)"
    return Table(frame, TextTable(caption, head, tuple(rows), tuple(notes)))
