"""What full planning brings to the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import pandas as pd

from phyblock.errors import Problem, SpecError
from phyblock.tables.cells import METRICS, in_levels, level_cells
from phyblock.tables.design import OVERALL
from phyblock.tables.load import Run
from phyblock.tables.measures import Measure
from phyblock.tables.paper_numbers import HUMAN_NOTE, published_table
from phyblock.tables.showing import planning_words
from phyblock.tables.text_table import level_name
from phyblock.tables.track_report import (
    FigureMaker,
    HeadlineColumn,
    PaperTable,
    SceneFigure,
    TableMaker,
    TrackReport,
)
from phyblock.tracks.full_planning.assembly import assembly_frame, table1_frame
from phyblock.tracks.full_planning.errors import errors_frame
from phyblock.tracks.full_planning.figures.errors import error_bars
from phyblock.tracks.full_planning.figures.levels import f1_radar, settings_dots
from phyblock.tracks.full_planning.figures.losses import loss_bars
from phyblock.tracks.full_planning.figures.scatter import f1_by_cost, f1_by_size
from phyblock.tracks.full_planning.film import PLAN_VIEW
from phyblock.tracks.full_planning.losses import losses_frame, losses_view
from phyblock.tracks.full_planning.measures import NAME, PLANNING_MEASURES
from phyblock.tracks.full_planning.published import (
    PUBLISHED_SETTING,
    published_frame,
    published_lines,
)
from phyblock.tracks.full_planning.seeds import (
    intervals_table,
    intervals_view,
    paper_table5_frame,
    paper_table5_view,
    table5_frame,
    table5_view,
)
from phyblock.tracks.full_planning.settings import settings_frame, settings_view
from phyblock.tracks.full_planning.views import (
    errors_in_terminal,
    errors_view,
    how_counted,
    published_view,
    table1_in_terminal,
    table1_view,
)
from phyblock.tracks.inference import inference
from phyblock.tracks.orders import order_frame, order_in_terminal, order_view
from phyblock.tracks.scenes import scenes_frame, scenes_view

__all__ = ["REPORT"]

_MAIN = "Overall F1"


def _headline(run: Run) -> tuple[HeadlineColumn, ...]:
    levels = [
        HeadlineColumn("f1", level, _MAIN if level == OVERALL else level_name(level), "")
        for level in run.design.levels
    ]
    sides = [HeadlineColumn(name, OVERALL, name.capitalize()) for name in METRICS[:2]]
    return (*levels, *sides)


def _references(run: Run) -> Mapping[str, Mapping[str, float]]:
    printed = published_table(1)
    printed = printed[printed["model"] == "Random"].set_index(["level", "metric"])
    values = printed["value"].to_dict()
    random = {
        column.heading: float(values.get((column.cell, column.measure), float("nan")))
        for column in _headline(run)
    }
    return {"Random, published": random}


def _published(run: Run) -> Mapping[str, float]:
    """What the paper's Table 1 prints as overall F1."""
    if run.design.setting != PUBLISHED_SETTING:
        return {}
    frame = published_frame(run)
    frame = frame[(frame["level"] == OVERALL) & (frame["metric"] == "f1")]
    return dict(zip(frame["model"], frame["published"], strict=True))


def _orders(run: Run) -> pd.DataFrame:
    return order_frame(NAME, run.design.criterion(OVERALL), run)


def _notes(run: Run) -> Sequence[str]:
    return (f"F1 in percent. {how_counted(run.design)}",)


def _check_alike(run: Run, first: Run, levels: Sequence[str], _: Measure) -> None:
    suite, wanted = run.design.suite, first.design
    needed: list[tuple[str, Sequence[str], str]] = [
        ("settings", suite.settings, wanted.setting),
        ("scoring.matchers", suite.scoring.matchers, wanted.matcher),
    ]
    known = ("aov", suite.scoring.level1)
    needed += [("scoring.level1", known, wanted.criterion(level)) for level in levels]
    for what, names, name in needed:
        if name not in names:
            hint = "phyblock score reads stored replies again under other rules"
            message = f"was not scored as {first.path} was, by {name}"
            raise SpecError(Problem(str(run.path), message, what, ", ".join(names), hint=hint))


REPORT = TrackReport(
    measures=PLANNING_MEASURES,
    cells=level_cells,
    in_cells=in_levels,
    headline=_headline,
    main=_MAIN,
    short="f1",
    published=_published,
    references=_references,
    notes=_notes,
    reference_note=HUMAN_NOTE,
    tables={
        "assembly": TableMaker(assembly_frame),
        "table1": TableMaker(table1_frame, table1_view, in_terminal=table1_in_terminal),
        "intervals": TableMaker(intervals_table, intervals_view, "table1"),
        "table5": TableMaker(table5_frame, table5_view, "table1"),
        "settings": TableMaker(settings_frame, settings_view, "table1"),
        "errors": TableMaker(errors_frame, errors_view, in_terminal=errors_in_terminal),
        "losses": TableMaker(losses_frame, losses_view, "errors"),
        "orders": TableMaker(_orders, order_view, "table1", in_terminal=order_in_terminal),
        "scenes": TableMaker(partial(scenes_frame, NAME), scenes_view, "table1"),
        "published": TableMaker(published_frame, published_view, lines=published_lines),
    },
    main_figure="f1-levels",
    figures={
        "f1-radar": FigureMaker("F1 by level, as in the paper", f1_radar),
        "settings": FigureMaker("Setting A against setting B", settings_dots),
        "losses": FigureMaker("What became of the goals' blocks", loss_bars),
        "error-types": FigureMaker("Wrong steps by type", error_bars),
        "f1-size": FigureMaker("F1 by model size", f1_by_size),
        "f1-cost": FigureMaker("F1 by cost", f1_by_cost),
        "inference": SceneFigure("A plan and what it built", partial(inference, view=PLAN_VIEW)),
    },
    paper_tables={
        1: PaperTable(published_frame, published_view),
        5: PaperTable(paper_table5_frame, paper_table5_view),
    },
    check_alike=_check_alike,
    showing=lambda run: planning_words(run, NAME),
)
