"""What pose planning brings to the report."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from phyblock.errors import Problem, SpecError
from phyblock.tables.cells import in_levels, level_cells
from phyblock.tables.design import OVERALL, Design
from phyblock.tables.listing import Listing, by_settings
from phyblock.tables.load import Run
from phyblock.tables.measures import Measure
from phyblock.tables.showing import planning_words
from phyblock.tables.text_table import level_name
from phyblock.tables.track_report import (
    EpisodeView,
    FigureMaker,
    HeadlineColumn,
    SceneFigure,
    TableMaker,
    TrackReport,
)
from phyblock.tracks.base import CARRYING, ENGINE, FIRST_CARRYING
from phyblock.tracks.inference import inference
from phyblock.tracks.pose_planning.counts import CARRIED, ERRORS
from phyblock.tracks.pose_planning.figures import f1_by_tolerance, pose_error_bars
from phyblock.tracks.pose_planning.film import pose_film, pose_table
from phyblock.tracks.pose_planning.listing import LISTED_IN_C
from phyblock.tracks.pose_planning.measures import NAME, POSE_PLANNING_MEASURES
from phyblock.tracks.pose_planning.tables import (
    pose_errors_frame,
    pose_errors_view,
    table_c_frame,
    table_c_in_terminal,
    table_c_view,
)

__all__ = ["REPORT"]

_MAIN = "Overall F1 in C"
_VIEW = EpisodeView(NAME, pose_table, pose_film)


def _headline(run: Run) -> tuple[HeadlineColumn, ...]:
    levels = [
        HeadlineColumn("f1_c", cell.name, _MAIN if cell.name == OVERALL else level_name(cell.name))
        for cell in level_cells(run)
    ]
    sides = [
        HeadlineColumn(name, OVERALL, heading)
        for name, heading in (("f1_a", "F1 in A"), ("stands", "Stand"), ("completed", "Completed"))
    ]
    return (*levels, *sides)


def _notes(run: Run) -> Sequence[str]:
    return (
        "F1 in setting C in percent: steps right in kind, rotation and order, and in place, mean "
        f"over 0.5, 1, 2 and 4 cm; F1 in A leaves out the poses, matcher {run.design.matcher}.",
    )


def _check_alike(run: Run, first: Run, _: Sequence[str], measure: Measure) -> None:
    """What is counted of the world depends on how plans are carried out, F1 does not."""
    if measure.counted not in (CARRIED, ERRORS):
        return
    for key, unsaid in ((CARRYING, FIRST_CARRYING), (ENGINE, None)):
        found, wanted = (one.manifest.tracks.get(NAME, {}).get(key, unsaid) for one in (run, first))
        if found != wanted:
            message = f"carried plans out otherwise than {first.path}, which decides {measure.name}"
            hint = "run the older one again, or compare by f1_c"
            field = f"tracks.{NAME}.{key}"
            raise SpecError(Problem(str(run.path), message, field, str(found), str(wanted), hint))


def _listings(design: Design) -> tuple[Listing, ...]:
    return (LISTED_IN_C, *by_settings(design))


REPORT = TrackReport(
    measures=POSE_PLANNING_MEASURES,
    cells=level_cells,
    in_cells=in_levels,
    headline=_headline,
    main=_MAIN,
    short="f1_c",
    notes=_notes,
    tables={
        "table_c": TableMaker(table_c_frame, table_c_view, in_terminal=table_c_in_terminal),
        "pose_errors": TableMaker(pose_errors_frame, pose_errors_view),
    },
    main_figure="f1-poses",
    figures={
        "f1-tolerance": FigureMaker("F1 with poses, by tolerance", f1_by_tolerance),
        "pose-errors": FigureMaker(
            "Steps with poses that were wrong, by what was wrong first", pose_error_bars
        ),
        "inference-poses": SceneFigure(
            "A plan with poses and what it built", partial(inference, view=_VIEW)
        ),
    },
    check_alike=_check_alike,
    episodes=_VIEW,
    listings=_listings,
    showing=lambda run: planning_words(run, "pose"),
)
