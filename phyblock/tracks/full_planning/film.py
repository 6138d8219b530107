"""A plan step by step: as a table of text, and as the frames of a film."""

from __future__ import annotations

from collections.abc import Iterator

from phyblock.data import AssemblyTask
from phyblock.domain import Block
from phyblock.records import Score
from phyblock.scoring.plan import ERROR_TYPES, ErrorType
from phyblock.sim.film import FilmStep, Tone
from phyblock.tables.text_table import Column, TextTable
from phyblock.tables.track_report import EpisodeView
from phyblock.tracks.full_planning.measures import NAME
from phyblock.tracks.full_planning.record import PlanRecord
from phyblock.tracks.full_planning.views import ERROR_NAMES

__all__ = ["PLAN_VIEW"]

_ERRORS: dict[str, ErrorType] = {str(name): name for name in ERROR_TYPES}


def _table(record: PlanRecord) -> TextTable:
    """Every step: the candidate that it names, and what became of it."""
    rows = tuple((str(n), str(one), outcome) for n, one, _, outcome in _steps(record))
    columns = (Column("Step"), Column("Block"), Column("Outcome", is_text=True))
    return TextTable(f"{record.sample}: {_came_to(record)}", columns, rows)


def _film(record: PlanRecord, task: AssemblyTask) -> Iterator[FilmStep]:
    """A frame for the empty ground, one a step, and one for what came of the plan.

    A right step puts a block at its place in the goal; a wrong one puts none.
    """
    yield FilmStep(f"{record.model}, {task.scene.id}", "plain", None, ())
    blocks: tuple[Block, ...] = ()
    for n, candidate, vertex, outcome in _steps(record):
        tone: Tone = "good" if vertex is not None else "bad"
        blocks += () if vertex is None else (task.scene.blocks[vertex],)
        yield FilmStep(f"{n}. block {candidate}: {outcome}", tone, candidate, blocks)
    tone = "good" if len(blocks) == len(task.scene.blocks) else "bad"
    yield FilmStep(_came_to(record), tone, None, blocks)


def _steps(record: PlanRecord) -> Iterator[tuple[int, int, int | None, str]]:
    """Number, candidate, block of the goal that it placed from 0, and what became of each step."""
    score, plan = _score(record), record.parse.plan if record.parse else ()
    placed, why = (score.placed, score.why) if score else (None, None)
    if placed is None or why is None:
        return
    for n, (candidate, vertex, error) in enumerate(zip(plan, placed, why, strict=True), 1):
        outcome = "placed" if vertex is not None else ERROR_NAMES[_ERRORS[str(error)]]
        yield n, candidate, vertex, outcome


def _score(record: PlanRecord) -> Score | None:
    """The first score, which is of the headline setting and matcher, that knows single steps."""
    return next((score for score in record.scores if score.placed is not None), None)


def _came_to(record: PlanRecord) -> str:
    score = _score(record)
    if score is None or score.placed is None:
        return "no step is known"
    return f"{score.tp} of {record.n_blocks} blocks placed"


PLAN_VIEW = EpisodeView(NAME, _table, _film)
