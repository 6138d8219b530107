"""What step planning brings to the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from phyblock.errors import Problem, SpecError
from phyblock.sim.engine import PHYSICS_VARIABLE, REFERENCE_ENGINE
from phyblock.tables.load import Run
from phyblock.tables.measures import Measure
from phyblock.tables.showing import planning_words
from phyblock.tables.track_report import (
    WHOLE,
    EpisodeView,
    FigureMaker,
    HeadlineColumn,
    PaperTable,
    SceneFigure,
    TableMaker,
    TrackReport,
)
from phyblock.tracks.base import ENGINE
from phyblock.tracks.inference import inference
from phyblock.tracks.orders import order_frame, order_in_terminal, order_view
from phyblock.tracks.scenes import scenes_frame, scenes_view
from phyblock.tracks.step_planning.episode_views import (
    endings_in_terminal,
    endings_view,
    moves_view,
    progress_view,
)
from phyblock.tracks.step_planning.episodes import (
    NAME,
    endings_frame,
    moves_frame,
    progress_frame,
)
from phyblock.tracks.step_planning.figure import progress_by_turn
from phyblock.tracks.step_planning.film import episode_film, episode_table
from phyblock.tracks.step_planning.measures import STEP_MEASURES
from phyblock.tracks.step_planning.states import state_keys
from phyblock.tracks.step_planning.table3 import (
    paper_table3_frame,
    paper_table3_view,
    published_recall,
    step_intervals,
    step_intervals_view,
    step_scores_frame,
    table3_frame,
    table3_in_terminal,
    table3_view,
)

__all__ = ["REPORT"]

_VIEW = EpisodeView(NAME, episode_table, episode_film, state_keys)
_MAIN, _RECALL = "F1 of attempts", "Recall"
_COLUMNS = (
    HeadlineColumn("completion", WHOLE.name, "Completed"),
    HeadlineColumn("f1", WHOLE.name, _MAIN, "attempted"),
    HeadlineColumn("precision", WHOLE.name, "Precision of attempts", "attempted"),
    HeadlineColumn("recall", WHOLE.name, _RECALL, "placed"),
    HeadlineColumn("f1", WHOLE.name, "F1 of placed blocks", "placed"),
)


def _references(run: Run) -> Mapping[str, Mapping[str, float]]:
    printed = {name: published_recall(name) for name in run.design.published.values()}
    return {
        f"{name}, published": {_RECALL: value}
        for name, value in printed.items()
        if value is not None
    }


def _notes(run: Run) -> Sequence[str]:
    return (
        f"Percent, setting {run.design.setting}. Completed are episodes that placed the whole "
        "goal; F1 and precision of attempts count every move that placed nothing as wrong; recall "
        "is of the goal's blocks; F1 of placed blocks leaves out what placed nothing.",
    )


def _check_alike(run: Run, first: Run, _: Sequence[str], __: Measure) -> None:
    settings, wanted = run.design.suite.settings, first.design.setting
    if wanted not in settings:
        hint = "phyblock score reads stored replies again under other rules"
        message = f"was not scored as {first.path} was, by {wanted}"
        raise SpecError(Problem(str(run.path), message, "settings", ", ".join(settings), hint=hint))
    engine, other = (one.manifest.tracks.get(NAME, {}).get(ENGINE) for one in (run, first))
    if engine != other:
        found, wanted = (one.manifest.engine or REFERENCE_ENGINE for one in (run, first))
        message = f"let blocks go in another physics engine than {first.path}"
        hint = f"run one of them again with {PHYSICS_VARIABLE}"
        raise SpecError(Problem(str(run.path), message, "engine", found, wanted, hint))


REPORT = TrackReport(
    measures=STEP_MEASURES,
    headline=lambda _: _COLUMNS,
    main=_MAIN,
    short="steps_f1",
    references=_references,
    notes=_notes,
    tables={
        "table3": TableMaker(table3_frame, table3_view, in_terminal=table3_in_terminal),
        "step_intervals": TableMaker(step_intervals, step_intervals_view, "table3"),
        "step_scores": TableMaker(step_scores_frame, None, "table3"),
        "endings": TableMaker(endings_frame, endings_view, in_terminal=endings_in_terminal),
        "moves": TableMaker(moves_frame, moves_view, "endings"),
        "progress": TableMaker(progress_frame, progress_view),
        "step_orders": TableMaker(
            partial(order_frame, NAME, "placed"),
            order_view,
            "table3",
            in_terminal=order_in_terminal,
        ),
        "step_scenes": TableMaker(partial(scenes_frame, NAME), scenes_view, "table3"),
    },
    main_figure="step-planning-f1",
    figures={
        "step-progress": FigureMaker("Blocks placed, turn by turn", progress_by_turn),
        "inference-steps": SceneFigure(
            "An episode and what it built", partial(inference, view=_VIEW)
        ),
    },
    paper_tables={3: PaperTable(paper_table3_frame, paper_table3_view)},
    check_alike=_check_alike,
    showing=lambda run: planning_words(run, "steps"),
    episodes=_VIEW,
)
