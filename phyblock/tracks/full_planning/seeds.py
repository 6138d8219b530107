"""F1 over seeds in the layout of the paper's Table 5, and F1 with its intervals."""

from __future__ import annotations

import pandas as pd

from phyblock.tables.design import OVERALL
from phyblock.tables.load import Run
from phyblock.tables.paper_numbers import beside, beside_by_level, published_table
from phyblock.tables.text_table import (
    NO_VALUE,
    SPREAD,
    Column,
    TextTable,
    level_name,
    number,
    with_interval,
)
from phyblock.text import counted
from phyblock.tracks.full_planning.assembly import assembly_frame, headline_cells
from phyblock.tracks.full_planning.measures import is_asked

__all__ = [
    "intervals_table",
    "intervals_view",
    "paper_table5_frame",
    "paper_table5_view",
    "table5_frame",
    "table5_view",
]

_PAPER_LEVELS = ("1", "2", "3", "4", OVERALL)


def table5_frame(run: Run) -> pd.DataFrame:
    """One row a model: `level1_mean`, `level1_sd`, ... `overall_sd` of F1 over seeds [%].

    Headline matcher and setting; sd with ddof = 1. Empty for a run of one seed or
    without full planning.
    """
    design = run.design
    cells = headline_cells(assembly_frame(run), design)
    names = design.model_names if is_asked(run) and len(design.suite.seeds) > 1 else ()
    table = pd.DataFrame({"model": list(names)})
    for level in design.levels:
        name = level if level == OVERALL else f"level{level}"
        of_level = cells[cells["level"] == level].set_index("model")
        for kind in ("mean", "sd"):
            table[f"{name}_{kind}"] = 100 * table["model"].map(of_level[f"f1_{kind}"])
    return table


def table5_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Mean and standard deviation of F1 a level out of `table5_frame`."""
    design = run.design
    rows = []
    for row in table.to_dict("records"):
        names = [level if level == OVERALL else f"level{level}" for level in design.levels]
        cells = [(row[f"{name}_mean"], row[f"{name}_sd"]) for name in names]
        rows.append((row["model"], *(_with_spread(mean, sd) for mean, sd in cells)))
    return TextTable(
        f"F1 as the paper's Table 5: means over {len(design.suite.seeds)} seeds (%)",
        (Column("Model", is_text=True), *(Column(level_name(level)) for level in design.levels)),
        tuple(rows),
        (
            f"Setting {design.setting}, matcher {design.matcher}; mean ± standard deviation over "
            "single seeds. All other tables pool the seeds.",
        ),
    )


def _with_spread(mean: float, sd: float) -> str:
    return number(mean, 2) if pd.isna(sd) else f"{number(mean, 2)}{SPREAD}{number(sd)}"


def intervals_table(run: Run) -> pd.DataFrame:
    """One row a model and level: f1, lo, hi, se [%], n, seeds, n_scenes, n_clusters.

    F1 is pooled over seeds, of the headline matcher and setting.
    """
    cells = headline_cells(assembly_frame(run), run.design)
    table = cells[["model", "level"]].copy()
    for name, column in {"f1": "f1", "lo": "f1_lo", "hi": "f1_hi", "se": "f1_se"}.items():
        table[name] = 100 * cells[column]
    kept = ["n", "seeds", "n_scenes", "n_clusters"]
    return pd.concat([table, cells[kept]], axis=1).reset_index(drop=True)


def intervals_view(table: pd.DataFrame, run: Run) -> TextTable:
    """F1 with its interval a level out of `intervals_table`."""
    design = run.design
    named = table.rename(columns={"f1": "value"}).to_dict("records")
    cells = {(row["model"], row["level"]): row for row in named}
    rows = [
        (
            model,
            *(text for level in design.levels for text in with_interval(cells[model, level])),
        )
        for model in design.model_names
    ]
    return TextTable(
        f"F1 with 95 % intervals (%){design.of_suite}",
        (
            Column("Model", is_text=True),
            *(
                Column(name, level_name(level))
                for level in design.levels
                for name in ("F1", "95 % CI")
            ),
        ),
        tuple(rows),
        (
            f"Setting {design.setting}, matcher {design.matcher}; F1 is pooled over "
            f"{counted(len(design.suite.seeds), 'seed')}.",
            *_sizes(table, run),
            "Intervals: each base scene left out in turn, micro averages taken anew.",
        ),
    )


def _sizes(table: pd.DataFrame, run: Run) -> list[str]:
    """How many scenes and base scenes are behind each level, at most over models."""
    most = table.groupby("level")[["n_scenes", "n_clusters"]].max()
    parts = [
        f"{level_name(level)} {most.loc[level, 'n_scenes']} ({most.loc[level, 'n_clusters']})"
        for level in run.design.levels
    ]
    return (
        [f"Scenes (base scenes): {', '.join(parts)}."] if len(table) else [f"No cell: {NO_VALUE}"]
    )


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
    printed = published_table(5) if is_asked(run) else published_table(5).iloc[:0]
    return beside(printed, ours.astype({"ours": "float64"}), run, ["level", "metric"])


def paper_table5_view(table: pd.DataFrame, run: Run) -> TextTable:
    """A row a model and statistic out of `paper_table5_frame`."""
    kinds = {"f1_mean": "F1 mean", "f1_sd": "F1 sd"}
    columns, rows = beside_by_level(table, _PAPER_LEVELS, "Statistic", kinds, 2)
    note = (
        f"Ours: setting {run.design.setting}, matcher {run.design.matcher}. Both: means over "
        "single seeds, sd with ddof = 1; all other tables pool the seeds."
    )
    return TextTable("Our numbers beside the paper's Table 5 (%)", columns, rows, (note,))
