"""Our numbers beside those of the paper's Table 1, cell by cell."""

from __future__ import annotations

from collections import Counter

import pandas as pd

from phyblock.tables.cells import METRICS
from phyblock.tables.design import OVERALL, Design
from phyblock.tables.load import Run
from phyblock.tables.paper_numbers import published_table
from phyblock.tables.text_table import number
from phyblock.tracks.full_planning.assembly import assembly_frame, headline_cells

__all__ = [
    "PUBLISHED_LEVELS",
    "PUBLISHED_SETTING",
    "comparison_notes",
    "largest_differences",
    "published_frame",
    "published_lines",
]

PUBLISHED_LEVELS = ("1", "2", "3", "4", "overall")
"""Levels of the paper's Table 1, in its order."""
PUBLISHED_SETTING = "A"
"""The setting of every number in it."""

_MET = 0.06
"""Largest difference that rounding of the published numbers and of ours explains [points]."""
_OVERALL_LEVELS = frozenset({2, 3, 4})
"""Levels whose scenes the paper's overall numbers pool."""

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


def published_frame(run: Run) -> pd.DataFrame:
    """15 rows for each model with a row in Table 1: published, ours, ours minus published [%].

    Ours is in setting A and not rounded; it is NaN for what the suite does not run: a level,
    `overall` without one of the levels 2, 3 and 4, everything without setting A. The `paper`
    matcher is compared where the run has it, else the headline one; `n` samples are behind our
    number.
    """
    design = run.design
    printed = published_table(1).rename(columns={"model": "published_name", "value": "published"})
    rows = set(printed["published_name"])
    matcher = "paper" if "paper" in design.suite.scoring.matchers else design.matcher
    ours = headline_cells(
        assembly_frame(run), design, matcher=matcher, setting=PUBLISHED_SETTING
    ).melt(
        id_vars=["model", "level", "criterion", "matcher", "n"],
        value_vars=list(METRICS),
        var_name="metric",
        value_name="ours",
    )
    cells = pd.DataFrame(
        [
            (model, name, level, metric)
            for model, name in design.published.items()
            if name in rows
            for level in PUBLISHED_LEVELS
            for metric in METRICS
        ],
        columns=["model", "published_name", "level", "metric"],
    )
    if not set(design.suite.levels) >= _OVERALL_LEVELS:
        ours = ours[ours["level"] != OVERALL]
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


def comparison_notes(published: pd.DataFrame, design: Design) -> tuple[str, ...]:
    """The largest difference of all, and what of the run could not be compared, as sentences."""
    compared = int(published["difference"].notna().sum())
    largest = number(largest_differences(published).max(), 3)
    notes = [f"Largest absolute difference of {compared} cells: {largest}."]
    known = set(published["model"])
    if without := [name for name in design.model_names if name not in known]:
        notes.append(f"No published row: {', '.join(without)}.")
    if PUBLISHED_SETTING not in design.suite.settings:
        notes.append(f"The paper's setting, {PUBLISHED_SETTING}, was not run.")
    if not set(design.suite.levels) >= _OVERALL_LEVELS:
        notes.append("Overall is not compared: the paper's pools the levels 2, 3 and 4.")
    return tuple(notes)


def published_lines(published: pd.DataFrame, run: Run) -> tuple[str, ...]:
    """How near each model comes to its row, and what could not be compared."""
    largest = largest_differences(published)
    cells = Counter(published.dropna(subset=["difference"])["model"])
    width = max(map(len, largest.index), default=0)
    lines = ["Beside the paper's Table 1: largest difference in points"]
    for name, points in largest.items():
        # Where nothing was compared, there is no difference to judge.
        mark = ("as published" if points <= _MET else "differs") if cells[name] else "not compared"
        lines.append(f"{name:<{width}}  {number(points, 3):>7}  {cells[name]} cells, {mark}")
    return (*lines, *comparison_notes(published, run.design))
