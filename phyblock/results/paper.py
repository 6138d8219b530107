"""The published numbers of the paper, and ours beside those of its Table 1."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import pandas as pd

from phyblock.results.estimates import track_estimates
from phyblock.results.load import Run
from phyblock.results.text import Column, TextTable, number
from phyblock.tracks.measures import CELL, OVERALL

_SETTING = "A"
"""The setting of every number in Table 1."""
_OVERALL_LEVELS = frozenset({2, 3, 4})
"""Levels whose scenes the paper's overall numbers pool."""
_METRICS = {"precision": "Prec", "recall": "Rec", "f1": "F1"}
_COLUMNS = ["model", "published_name", CELL, "metric", "published", "ours", "difference", "n"]


def published_table(table: int) -> pd.DataFrame:
    """Return a results table of the paper (1, 2, 3 or 5), with one printed value [%] per row.

    `published/README.md` explains the columns and the sources of the numbers.
    """
    with (files("phyblock.results") / "published" / f"table{table}.csv").open("rb") as file:
        return pd.read_csv(file, dtype={"level": "object"})


def published_frame(run: Run) -> pd.DataFrame:
    """Return one row for each value of Table 1 of a model of the run, with ours [%].

    Columns are model, published_name, cell, metric, published, ours, difference (ours minus
    published) and n, the samples behind ours. Ours is not rounded, and NaN if the run does not
    measure it. It is in setting A, by the `paper` matcher if the run has it.
    """
    design, suite, estimates = run.design, run.design.suite, track_estimates(run, "full_planning")
    matcher = "paper" if "paper" in suite.scoring.matchers else design.matcher
    is_a = (estimates["setting"] == _SETTING) & (_SETTING in suite.settings)
    ours = estimates[is_a & estimates["matcher"].isin(["", matcher])]
    if not set(suite.levels) >= _OVERALL_LEVELS:
        ours = ours[ours[CELL] != OVERALL]
    ours = ours[["model", CELL, "n", "measure", "value"]]
    ours = ours.rename(columns={"measure": "metric", "value": "ours"})
    renamed = {"model": "published_name", "value": "published", "level": CELL}
    printed = published_table(1).rename(columns=renamed)
    known = [(model.name, model.published) for model in design.models if model.published]
    names = pd.DataFrame(known, columns=["model", "published_name"], dtype="object")
    found = names.merge(printed, on="published_name")
    found = found.merge(ours, on=["model", CELL, "metric"], how="left")
    found["ours"] = 100 * found["ours"].astype("float64")
    found["difference"] = found["ours"] - found["published"]
    found["n"] = found["n"].astype("float64").fillna(0).astype("int64")
    return found[_COLUMNS]


def beside_paper(run: Run) -> TextTable | None:
    """Return numbers beside the paper's Table 1; None without its models or official scenes."""
    suite = run.design.suite
    if "full_planning" not in suite.tracks or suite.dataset.format != "official":
        return None
    frame = published_frame(run)
    if frame.empty:
        return None
    rows: dict[tuple[str, str], dict[str, object]] = {}
    for row in frame.to_dict("records"):
        model, metric, name = row["model"], row["metric"], row["published_name"]
        about = {"model": model if name == model else f"{model} ({name})"}
        shown = rows.setdefault((model, metric), {**about, "metric": _METRICS[metric]})
        shown |= {f"{row[CELL]} {part}": row[part] for part in ("published", "ours", "difference")}
    headings = {cell.name: cell.heading for cell in run.cells("full_planning")}
    columns = [Column.text("model", "Model", once=True), Column.text("metric", "")]
    for cell in dict.fromkeys(frame[CELL]):
        group = headings.get(cell, cell)
        columns += [
            Column.value(f"{cell} published", "Paper", group),
            Column.value(f"{cell} ours", "Ours", group, 2),
            Column.value(f"{cell} difference", "Diff", group, 2, signed=True),
        ]
    compared = frame["difference"].dropna()
    notes = ["Ours: setting A, micro averages. Published: micro averages of one run."]
    if len(compared):
        largest = number(compared.abs().max(), 3)
        notes.insert(0, f"Largest absolute difference of {len(compared)} cells: {largest}.")
    caption = f"Our numbers beside the paper's Table 1{run.design.of_suite} (%)"
    made = TextTable.of(pd.DataFrame([*rows.values()]), caption, columns, notes)
    return replace(made, frame=frame)
