"""The paper's Table 2, with the published numbers beside, and which letters were given."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from phyblock.domain import CATEGORIES, LETTERS, SUBTASKS
from phyblock.tables.estimates import pooled_in
from phyblock.tables.headline import (
    interval_frame,
    interval_view,
    narrower,
    seeds_notes,
    uncertainty_cells,
    uncertainty_columns,
)
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL
from phyblock.tables.paper_numbers import (
    NOTHING,
    OURS,
    PUBLISHED,
    beside_view,
    interleaved,
    published_table,
    row_name,
)
from phyblock.tables.text_table import NO_VALUE, Column, TextTable, number, with_interval
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.vqa.accuracy import questions_frame
from phyblock.tracks.vqa.answers import CELLS, OVERALL_CELL, showing
from phyblock.tracks.vqa.measures import ACCURACY, ALL_CELLS, NAME, is_asked, subtask_cells

__all__ = [
    "letters_view",
    "paper_table2_frame",
    "paper_table2_view",
    "published_cells",
    "table2_frame",
    "table2_in_terminal",
    "table2_view",
    "vqa_intervals",
    "vqa_intervals_view",
]

_MODEL = Column("Model", is_text=True)
_GROUPS = {
    "object_property": "Object Property",
    "object_relationship": "Object Relationship",
    "scene_understanding": "Scene Understanding",
    "dynamic_reasoning": "Dynamic Reasoning",
}
_AVERAGES_NOTE = (
    "Avg and Overall are unweighted means of the columns they stand for, as the published category "
    "averages are. Of the published overall numbers five of 14 are not: those of Claude-3.7 "
    "Sonnet, Gemini-1.5-flash, Qwen-VL-Max, Qwen2.5-VL-72B-Instruct and Random."
)


def table2_frame(run: Run) -> pd.DataFrame:
    """The paper's Table 2 [%], unrounded: one row a model, and one as published where it has one.

    Columns are `model`, `source` (run or published), `published_name`, then `CELLS`, pooled over
    seeds, `overall_lo` and `overall_hi`, the ends of an interval, and, with more than one seed,
    `<cell>_mean` and `<cell>_sd` over single seeds.
    """
    design = run.design
    frame = questions_frame(run)
    wanted = [*((cell, "") for cell in CELLS), (OVERALL_CELL, "_lo"), (OVERALL_CELL, "_hi")]
    if len(design.suite.seeds) > 1:
        wanted += [(cell, end) for cell in CELLS for end in ("_mean", "_sd")]
    rows: list[dict[str, Any]] = []
    for model in design.model_names:
        mine = frame[frame["model"] == model].set_index("cell").to_dict("index")
        row: dict[str, Any] = {"model": model, "source": OURS, "published_name": ""}
        row |= {f"{cell}{end}": 100 * mine[cell][f"accuracy{end}"] for cell, end in wanted}
        rows.append(row)
        printed = published_cells(design.published.get(model, ""))
        if printed:
            about = {"model": model, "source": PUBLISHED}
            rows.append({**about, "published_name": design.published[model], **printed})
    names = [f"{cell}{end}" for cell, end in wanted]
    return pd.DataFrame(rows, columns=["model", "source", "published_name", *names])


def published_cells(model: str) -> dict[str, float]:
    """What Table 2 prints for a model [%], by cell; empty where it has no such row."""
    table = published_table(2)
    rows = table[table["model"] == model]
    averages = rows["subtask"] == "average"
    names = rows["subtask"].where(~averages, rows["category"])
    return {str(name): float(value) for name, value in zip(names, rows["value"], strict=True)}


def table2_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Table 2 in the paper's layout out of `table2_frame`."""
    columns = [
        Column("Avg" if name == category else name, _GROUPS[category])
        for category, subtasks in CATEGORIES.items()
        for name in (*subtasks, category)
    ]
    rows = tuple(
        (
            row_name(row),
            *(number(row[cell]) for cell in CELLS),
            *uncertainty_cells(row, OVERALL_CELL, run.design),
        )
        for row in table.to_dict("records")
    )
    return TextTable(
        f"Physical-understanding VQA (%){run.design.of_suite}",
        (_MODEL, *columns, Column("Avg", "Overall"), *uncertainty_columns(run.design, "Overall")),
        rows,
        tuple(_notes(table, run)),
    )


def letters_view(table: pd.DataFrame, _: Run) -> TextTable:
    """Rates of letters out of `letters_frame`."""
    kinds = ("right", "given", "95 % CI")
    columns = [Column(kind, letter) for letter in LETTERS for kind in kinds]
    rows = tuple(
        (
            row["model"],
            str(row["n"]),
            str(row["unread"]),
            *(
                text
                for name in map(str.lower, LETTERS)
                for text in (number(row[f"right_{name}"]), *with_interval(row, f"given_{name}"))
            ),
        )
        for row in table.to_dict("records")
    )
    return TextTable(
        "Letters that are right and letters given (%)",
        (_MODEL, Column("n"), Column("No letter"), *columns),
        rows,
        ("Shares of all scored answers; questions of ordering have no one letter.",),
    )


def _notes(table: pd.DataFrame, run: Run) -> list[str]:
    shown, design = showing(run), run.design
    frame = questions_frame(run)
    whole = frame[frame["cell"] == OVERALL_CELL]
    notes = []
    if shown.circular:
        notes.append(
            "Circular: a question counts as right only if every rotation of its options was "
            "answered right; questions.csv has the accuracy over single rotations."
        )
    if shown.blind:
        notes.append("Blind: no picture was sent.")
    if shown.wrong_image:
        notes.append("The pictures shown are those of a question about another scene.")
    notes += seeds_notes(design)
    notes.append(_counts_note(whole))
    unread = whole[whole["parse_failure"] > 0]
    if len(unread):
        counts = zip(unread["model"], unread["parse_failure"], unread["n"], strict=True)
        listed = ", ".join(f"{model} {count} of {n}" for model, count, n in counts)
        notes.append(f"No answer could be read, which counts as wrong: {listed}.")
    if design.suite.scoring.missing == "count":
        notes += _unanswered_notes(whole)
    asked = frame[(frame["cell"].isin(SUBTASKS)) & (frame["expected"] > 0)]
    if asked["cell"].nunique() < len(SUBTASKS):
        notes.append("Means are over the subtasks that were asked.")
    if (table["source"] == PUBLISHED).any():
        notes.append("The published numbers are of the paper's own questions, which differ.")
    return [*notes, _AVERAGES_NOTE]


def _counts_note(whole: pd.DataFrame) -> str:
    counts = {(n, expected) for n, expected in zip(whole["n"], whole["expected"], strict=True)}
    if len(counts) == 1:
        n, expected = counts.pop()
        return f"n = {n} answers a model" + (f" of {expected}." if n != expected else ".")
    each = zip(whole["model"], whole["n"], whole["expected"], strict=True)
    return "Answers: " + ", ".join(f"{model} {n} of {all_}" for model, n, all_ in each) + "."


def _unanswered_notes(whole: pd.DataFrame) -> list[str]:
    unanswered = whole["api_error"] + whole["missing"]
    listed = [
        f"{model} {count}" for model, count in zip(whole["model"], unanswered, strict=True) if count
    ]
    return [f"Without a reply, counted as wrong: {', '.join(listed)}."] if listed else []


def paper_table2_frame(run: Run) -> pd.DataFrame:
    """Accuracies by subtask, category and overall beside the paper's Table 2."""
    if not is_asked(run):
        return NOTHING
    table = interleaved(table2_frame(run), CELLS)
    cells = subtask_cells(run)
    asked = {cell.name: pooled_in(cell, cells) for cell in cells}
    whole = {cell.name: pooled_in(cell, ALL_CELLS) for cell in ALL_CELLS}
    # A mean over a part of what the paper averages is not the same number.
    partly = table["cell"].map(asked) != table["cell"].map(whole)
    table.loc[partly, ["ours", "difference"]] = np.nan
    return table


def paper_table2_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Shows the table of `paper_table2_frame`."""
    note = (
        "Averages are unweighted means. The questions are our own: the paper's are not published."
    )
    names: dict[str, str] = {**dict.fromkeys(CATEGORIES, "Avg"), OVERALL_CELL: "Overall"}
    return beside_view(table, run, number_in_paper=2, names=names, note=note)


def vqa_intervals(run: Run) -> pd.DataFrame:
    """One row a model and cell of Table 2: value, lo, hi, se [%], n, n_scenes, n_clusters."""
    estimates = track_estimates(run, NAME)
    estimates = estimates[estimates["measure"] == ACCURACY.name]
    table = interval_frame(estimates, run.design, ACCURACY.scale, [CELL])
    place = {name: number for number, name in enumerate(CELLS)}
    order = table.assign(m=pd.factorize(table["model"])[0], c=table[CELL].map(place))
    table = table.loc[order.sort_values(["m", "c"], kind="stable").index]
    return table.drop(columns="seeds").reset_index(drop=True)


def vqa_intervals_view(table: pd.DataFrame, run: Run) -> TextTable:
    """The averages of `vqa_intervals`."""
    wanted = [cell for cell in (*CATEGORIES, OVERALL_CELL) if cell in set(table[CELL])]
    return interval_view(table, run, wanted, "Right answers")


def table2_in_terminal(view: TextTable, _: pd.DataFrame) -> tuple[TextTable, ...]:
    """The columns that were asked, or averages alone where those do not fit."""
    asked = [
        place
        for place in range(len(view.columns))
        if any(row[place] != NO_VALUE for row in view.rows if not row[0].startswith(" "))
    ]
    notes = view.notes[:-1]
    whole = replace(view.with_columns(asked), notes=notes)
    subtasks = [column.name for column in whole.columns if column.name in SUBTASKS]
    note = "Averages alone, to fit; every subtask is in tables/table2.md."
    return whole, *narrower(replace(whole.without(subtasks), notes=(note, *notes)))
