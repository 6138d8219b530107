"""Our numbers beside those of the paper's Table 1, cell by cell."""

from __future__ import annotations

from importlib.resources import files

import pandas as pd

from phyblock.report.assembly import assembly_frame, headline_cells
from phyblock.report.cells import METRICS
from phyblock.report.load import Run

__all__ = ["PUBLISHED_LEVELS", "largest_differences", "published_frame", "published_table"]

PUBLISHED_LEVELS = ("1", "2", "3", "4", "overall")
"""Levels of the paper's Table 1, in its order."""

_COLUMNS = (
    "model",
    "published_name",
    "level",
    "metric",
    "published",
    "ours",
    "difference",
    "criterion",
    "matcher",
    "n",
)


def published_table(number: int) -> pd.DataFrame:
    """A results table of the paper (1, 2, 3 or 5), one printed value [%] a row.

    `published/README.md` says what the columns are and where the numbers come from.
    """
    with (files("phyblock.report") / "published" / f"table{number}.csv").open("rb") as file:
        return pd.read_csv(file, dtype={"level": "object"})


def published_frame(run: Run) -> pd.DataFrame:
    """15 rows for each model with a row in Table 1: published, ours, ours minus published [%].

    Ours is not rounded; it is NaN for a level that the suite does not run. The `paper` matcher is
    compared where the run has it, else the headline one; `n` samples are behind our number.
    """
    matcher = "paper" if "paper" in run.design.suite.scoring.matchers else run.design.matcher
    ours = headline_cells(assembly_frame(run), run.design, matcher).melt(
        id_vars=["model", "level", "criterion", "matcher", "n"],
        value_vars=list(METRICS),
        var_name="metric",
        value_name="ours",
    )
    cells = pd.DataFrame(
        [
            (model, name, level, metric)
            for model, name in run.design.published.items()
            for level in PUBLISHED_LEVELS
            for metric in METRICS
        ],
        columns=["model", "published_name", "level", "metric"],
    )
    printed = published_table(1).rename(columns={"model": "published_name", "value": "published"})
    table = cells.merge(printed, on=["published_name", "level", "metric"], how="left")
    table = table.merge(ours, on=["model", "level", "metric"], how="left")
    table["ours"] = 100 * table["ours"]
    table["difference"] = table["ours"] - table["published"]
    table["n"] = table["n"].fillna(0).astype("int64")
    for name in ("criterion", "matcher"):
        table[name] = table[name].astype("object").fillna("")
    return table[list(_COLUMNS)]


def largest_differences(published: pd.DataFrame) -> pd.Series[float]:
    """Largest absolute difference of each model [percentage points], in the frame's order.

    NaN for a model of which no cell can be compared; `.max()` is the largest of all.
    """
    return published["difference"].abs().groupby(published["model"], sort=False).max()
