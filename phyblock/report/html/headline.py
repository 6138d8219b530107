"""The first table of the page: F1 by level with intervals, and what to hold it against."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import pandas as pd

from phyblock.tables.cells import METRICS
from phyblock.tables.design import OVERALL
from phyblock.tables.load import Run
from phyblock.tables.paper_numbers import published_table
from phyblock.tables.text_table import NO_VALUE, number
from phyblock.tracks.full_planning.assembly import assembly_frame, headline_cells
from phyblock.tracks.full_planning.published import PUBLISHED_SETTING, published_frame

__all__ = [
    "HUMAN_ACCURACY",
    "HUMAN_NOTE",
    "Cell",
    "Headline",
    "Kind",
    "Row",
    "assembly_headline",
    "kinds_of",
    "plain",
]

HUMAN_ACCURACY = 94.7
"""Human experts [%]: 378.83 points on 400 tasks of planning and VQA (paper, appendix)."""

HUMAN_NOTE = (
    "Human experts scored 378.83 of 400 tasks drawn from planning and VQA together (paper, "
    "appendix): an accuracy, shown for scale."
)
"""What stands under every table that shows it."""
Kind = Literal["model", "baseline", "reference"]


@dataclass(frozen=True)
class Cell:
    """A number as shown, with what stands under it; `value` sorts, None where there is none."""

    text: str
    value: float | None = None
    below: str = ""


@dataclass(frozen=True)
class Row:
    """A model, or a value to hold models against; `strip` is its overall value and interval [%]."""

    name: str
    kind: Kind
    cells: tuple[Cell, ...]
    strip: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Headline:
    """A headline table: `columns` head the cells, `references` [%] are marked in every strip.

    The column with number `main`, from 0, is what the strips draw and is called `strip_name`.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...]
    main: int
    strip_name: str
    references: dict[str, float] = field(default_factory=dict)


def assembly_headline(run: Run) -> Headline | None:
    """F1 by level, and precision and recall overall, in the headline setting and matcher.

    None for a run without an assembly track.
    """
    design = run.design
    if not design.tracks:
        return None
    cells = headline_cells(assembly_frame(run), design)
    published = _published_f1(run)
    rows = [
        _row(name, kind, cells[cells["model"] == name], run, published)
        for name, kind in kinds_of(run).items()
    ]
    names = [_level_name(level) for level in design.levels]
    columns = (*names, "Precision", "Recall", *(("Published",) if published else ()))
    return Headline(
        "Full planning" if design.tracks[0] == "full_planning" else design.tracks[0],
        columns,
        (*rows, *_references(run, has_published=bool(published))),
        (_how(run), HUMAN_NOTE),
        len(names) - 1,
        names[-1],
        {"Random": _published_random(OVERALL), "Human": HUMAN_ACCURACY},
    )


def kinds_of(run: Run) -> dict[str, Kind]:
    """Which models are baselines; these come last."""
    kinds = {model["name"]: model.get("kind") for model in run.manifest["models"]}
    baselines = [name for name in run.design.model_names if kinds.get(name) == "baseline"]
    models = [name for name in run.design.model_names if name not in baselines]
    return {**dict.fromkeys(models, "model"), **dict.fromkeys(baselines, "baseline")}


def _row(name: str, kind: Kind, cells: pd.DataFrame, run: Run, published: dict[str, float]) -> Row:
    by_level = {str(row["level"]): row for row in cells.to_dict("records")}
    several = len(run.design.suite.seeds) > 1
    shown = [_cell(by_level[level], "f1", several) for level in run.design.levels]
    overall = by_level[OVERALL]
    shown += [_cell(overall, metric, several) for metric in METRICS[:2]]
    if published:
        shown.append(plain(published.get(name, math.nan)))
    f1, low, high = (100 * overall.get(f"f1{end}", math.nan) for end in ("", "_lo", "_hi"))
    strip = None if math.isnan(f1) else (f1, *_bounds(f1, low, high))
    return Row(name, kind, tuple(shown), strip)


def _cell(row: Mapping[Hashable, float], metric: str, several: bool) -> Cell:
    name = f"{metric}_mean" if several else metric
    value = 100 * row[name]
    if math.isnan(value):
        return Cell(NO_VALUE)
    low, high = (100 * row.get(f"{metric}_{end}", math.nan) for end in ("lo", "hi"))
    below = "" if math.isnan(low) else f"{number(low)} to {number(high)}"
    return Cell(number(value), value, below)


def plain(value: float) -> Cell:
    """A percentage with nothing under it."""
    return Cell(NO_VALUE) if math.isnan(value) else Cell(number(value), value)


def _bounds(value: float, low: float, high: float) -> tuple[float, float]:
    return (value, value) if math.isnan(low) else (low, high)


def _published_f1(run: Run) -> dict[str, float]:
    """What the paper's Table 1 prints as overall F1 of the run's models [%]."""
    if run.design.setting != PUBLISHED_SETTING:
        return {}
    frame = published_frame(run)
    frame = frame[(frame["level"] == OVERALL) & (frame["metric"] == "f1")]
    return dict(zip(frame["model"], frame["published"], strict=True))


def _published_random(level: str, metric: str = "f1") -> float:
    table = published_table(1)
    chosen = (table["model"] == "Random") & (table["level"] == level) & (table["metric"] == metric)
    values = table.loc[chosen, "value"]
    return float(values.iloc[0]) if len(values) else math.nan


def _references(run: Run, *, has_published: bool) -> tuple[Row, ...]:
    levels = run.design.levels
    random = [plain(_published_random(level)) for level in levels]
    random += [plain(_published_random(OVERALL, metric)) for metric in METRICS[:2]]
    human = [Cell("") for _ in random]
    human[len(levels) - 1] = Cell(number(HUMAN_ACCURACY), HUMAN_ACCURACY)
    blank = [Cell("")] if has_published else []
    return (
        Row("Random, published", "reference", (*random, *blank), None),
        Row("Human experts, published", "reference", (*human, *blank), None),
    )


def _level_name(level: str) -> str:
    return "Overall F1" if level == OVERALL else f"Level {level}"


def _how(run: Run) -> str:
    design = run.design
    seeds = len(design.suite.seeds)
    mean = f"; mean of {seeds} seeds" if seeds > 1 else ""
    return (
        f"F1 in percent, setting {design.setting}, matcher {design.matcher}{mean}. Below each "
        "value stands its 95 % interval, from resampling the base scenes."
    )
