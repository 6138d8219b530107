"""What questions bring to the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from phyblock.domain import CATEGORIES, SUBTASK_NAMES
from phyblock.errors import Problem, SpecError
from phyblock.tables.load import Run
from phyblock.tables.measures import Measure
from phyblock.tables.paper_numbers import HUMAN_NOTE
from phyblock.tables.showing import control_words
from phyblock.tables.track_report import (
    FigureMaker,
    HeadlineColumn,
    PaperTable,
    SceneFigure,
    TableMaker,
    TrackReport,
)
from phyblock.tracks.vqa.accuracy import questions_frame
from phyblock.tracks.vqa.answers import OVERALL_CELL, letters_frame, question_digest, showing
from phyblock.tracks.vqa.cards import subtask_cards
from phyblock.tracks.vqa.export import QUESTION_EXPORT
from phyblock.tracks.vqa.figure import vqa_heat_map
from phyblock.tracks.vqa.measures import (
    ACCURACY,
    CATEGORY_NAMES,
    NAME,
    VQA_MEASURES,
    in_subtasks,
    subtask_cells,
)
from phyblock.tracks.vqa.page import question_items
from phyblock.tracks.vqa.table2 import (
    letters_view,
    paper_table2_frame,
    paper_table2_view,
    published_cells,
    table2_frame,
    table2_in_terminal,
    table2_view,
    vqa_intervals,
    vqa_intervals_view,
)

__all__ = ["REPORT"]

_COLUMNS = (
    *(HeadlineColumn(ACCURACY.name, name, CATEGORY_NAMES[name]) for name in CATEGORIES),
    HeadlineColumn(ACCURACY.name, OVERALL_CELL, "Overall"),
)


def _references(_: Run) -> Mapping[str, Mapping[str, float]]:
    printed = published_cells("Random")
    return {"Random, published": {column.heading: printed[column.cell] for column in _COLUMNS}}


def _notes(_: Run) -> Sequence[str]:
    macro = "A category is the unweighted mean of its subtasks, overall that of the categories"
    return (f"Accuracy in percent. {macro}, as far as they were asked.",)


def _how_shown(run: Run) -> tuple[str, ...]:
    shown = showing(run)
    circular = ("circular",) if shown.circular else ()
    letters = ("options on one sheet",) if shown.options_as == "letters" else ()
    return (*circular, *control_words(run, NAME), *letters)


def _check_alike(run: Run, first: Run, _: Sequence[str], __: Measure) -> None:
    circular = [showing(one).circular for one in (run, first)]
    if circular[0] != circular[1]:
        found, allowed = (str(one).lower() for one in circular)
        message = f"counts right answers in another way than {first.path}"
        raise SpecError(Problem(str(run.path), message, "vqa.circular", found, allowed))
    # Digests of the sets that questions were chosen from.
    sets = [question_digest(one) for one in (run, first)]
    if sets[0] != sets[1]:
        message = f"asked questions of another set than {first.path}"
        raise SpecError(Problem(str(run.path), message, "questions", str(sets[0]), str(sets[1])))


REPORT = TrackReport(
    measures=VQA_MEASURES,
    cells=subtask_cells,
    in_cells=in_subtasks,
    headline=lambda _: _COLUMNS,
    references=_references,
    notes=_notes,
    reference_note=HUMAN_NOTE,
    tables={
        "table2": TableMaker(table2_frame, table2_view, in_terminal=table2_in_terminal),
        "vqa_intervals": TableMaker(vqa_intervals, vqa_intervals_view, "table2"),
        "letters": TableMaker(letters_frame, letters_view, "table2"),
        "questions": TableMaker(questions_frame, None, "table2"),
    },
    main_figure="vqa-accuracy",
    figures={
        "vqa-subtasks": FigureMaker("VQA accuracy by subtask", vqa_heat_map),
        "subtask-cards": SceneFigure("A question of each subtask", subtask_cards),
    },
    paper_tables={2: PaperTable(paper_table2_frame, paper_table2_view)},
    check_alike=_check_alike,
    showing=_how_shown,
    part_names={str(short): name for short, name in SUBTASK_NAMES.items()},
    items=question_items,
    export=QUESTION_EXPORT,
)
