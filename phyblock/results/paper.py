"""The published numbers of the paper, and ours beside them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.resources import files

import numpy as np
import pandas as pd
import yaml

from phyblock.results.estimates import headline_rows, pooled_in, track_estimates
from phyblock.results.load import Run
from phyblock.results.text import TextTable, number, texts, values
from phyblock.tracks.measures import CELL, OVERALL

_FOLDER = files("phyblock.results") / "published"
_SETTING = "A"
"""The setting of every number in Table 1."""
_OVERALL_LEVELS = frozenset({2, 3, 4})
"""Levels whose scenes the paper's overall numbers pool."""
_COLUMNS = ["model", "published_name", CELL, "metric", "published", "ours", "difference", "n"]


@dataclass(frozen=True)
class _Published:
    """A table of the paper, as `published/tables.yaml` describes it."""

    track: str
    columns: Mapping[str, tuple[str, str, str]]
    note: str
    criterion: str = ""
    digits: int = 1


_TABLES = {
    n: _Published(**table)
    for n, table in yaml.safe_load((_FOLDER / "tables.yaml").read_text(encoding="utf-8")).items()
}
PAPER_TABLES = tuple(_TABLES)
"""Numbers of the paper's results tables."""


def published_table(table: int) -> pd.DataFrame:
    """Return a results table of the paper (1, 2, 3 or 5), with one printed value [%] per row.

    `published/README.md` explains the columns and the sources of the numbers.
    """
    with (_FOLDER / f"table{table}.csv").open("rb") as file:
        return pd.read_csv(file, dtype={"level": "object"})


def published_frame(run: Run, table: int) -> pd.DataFrame:
    """Return one row for each printed value of a model of the run, with ours [%].

    Columns are model, published_name, cell, metric, published, ours, difference (ours minus
    published) and n, the samples behind ours. Ours is not rounded, and NaN if the run does not
    measure it. Table 1 is compared in setting A by the `paper` matcher if the run has it.
    """
    paper, design = _TABLES[table], run.design
    if paper.track not in design.suite.tracks or (table == 5 and len(design.suite.seeds) < 2):
        return pd.DataFrame(columns=_COLUMNS)
    printed = published_table(table)
    if table == 2:
        is_average = printed["subtask"] == "average"
        printed["level"] = printed["subtask"].where(~is_average, printed["category"])
        printed["metric"] = "accuracy"
    printed = printed[printed["metric"].isin(list(paper.columns))]
    printed = printed.rename(
        columns={"model": "published_name", "value": "published", "level": CELL}
    )
    known = [(model.name, model.published) for model in design.models if model.published]
    names = pd.DataFrame(known, columns=["model", "published_name"], dtype="object")
    found = names.merge(printed, on="published_name")
    found = found.merge(_ours(run, table), on=["model", CELL, "metric"], how="left")
    found["ours"] = found["ours"].astype("float64")
    found["difference"] = found["ours"] - found["published"]
    found["n"] = found["n"].astype("float64").fillna(0).astype("int64")
    return found[_COLUMNS]


def is_as_published(run: Run) -> bool:
    """True if a run is scored as in the paper's Table 1."""
    suite = run.design.suite
    return (
        "paper" in suite.scoring.matchers
        and (1 not in suite.levels or suite.scoring.level1 == "membership")
        and _SETTING in suite.settings
    )


def _ours(run: Run, table: int) -> pd.DataFrame:
    """Return our numbers [%] by model, cell and metric, with the samples behind them."""
    paper, suite = _TABLES[table], run.design.suite
    estimates = track_estimates(run, paper.track)
    found = headline_rows(estimates, run.design)
    if table == 1:
        matcher = "paper" if "paper" in suite.scoring.matchers else run.design.matcher
        is_a = (estimates["setting"] == _SETTING) & (_SETTING in suite.settings)
        found = estimates[is_a & estimates["matcher"].isin(["", matcher])]
        if not set(suite.levels) >= _OVERALL_LEVELS:
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
        # A mean over fewer parts than in the paper is not the same number.
        from phyblock.tracks.questions import ALL_CELLS

        asked, whole = (
            rows[CELL].map({cell.name: pooled_in(cell, cells) for cell in cells})
            for cells in (run.cells(paper.track), ALL_CELLS)
        )
        rows.loc[asked != whole, "ours"] = np.nan
    return rows


def beside_paper(run: Run, table: int) -> TextTable | None:
    """Return our numbers beside a table of the paper; None if it has no model of the run, or the
    run is not on the official scenes.
    """
    frame, paper = published_frame(run, table), _TABLES[table]
    if frame.empty or run.design.suite.dataset.format != "official":
        return None
    rows: dict[tuple[str, str], dict[str, object]] = {}
    for model in dict.fromkeys(frame["model"]):
        for metric, (_, _, heading) in paper.columns.items():
            rows[model, metric] = {"model": model, "metric": heading}
    for row in frame.to_dict("records"):
        shown = rows[row["model"], row["metric"]]
        if row["published_name"] != row["model"]:
            shown["model"] = f"{row['model']} ({row['published_name']})"
        shown |= {f"{row[CELL]} {name}": row[name] for name in ("published", "ours", "difference")}
    headings = {cell.name: cell.heading for cell in run.cells(paper.track)}
    columns = [texts("model", "Model", once=True), texts("metric", "")]
    for cell in dict.fromkeys(frame[CELL]):
        group = headings.get(cell, cell)
        columns += [
            values(f"{cell} published", "Paper", group, paper.digits),
            values(f"{cell} ours", "Ours", group, 2),
            values(f"{cell} difference", "Diff", group, 2, signed=True),
        ]
    compared, notes = frame["difference"].dropna(), [paper.note]
    if len(compared):
        largest = number(compared.abs().max(), 3)
        notes.insert(0, f"Largest absolute difference of {len(compared)} cells: {largest}.")
    caption = f"Our numbers beside the paper's Table {table}{run.design.of_suite} (%)"
    made = TextTable.of(pd.DataFrame([*rows.values()]), caption, columns, notes)
    return replace(made, frame=frame)
