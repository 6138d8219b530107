"""Results of plans by level: steps, whole plans, wrong steps by type, outcomes of blocks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from phyblock.scoring.counts import Counts
from phyblock.scoring.plan import BLOCK_OUTCOMES, ERROR_TYPES
from phyblock.sim.film import FilmStep, Tone
from phyblock.tracks.full_planning import PLAN_FLOORS, POSE_COUNTS, PlanRecord, pose_gap
from phyblock.tracks.measures import SampleCounts, each_score, level_cells, read_report

if TYPE_CHECKING:
    from phyblock.data import AssemblyTask
    from phyblock.domain import Block
    from phyblock.records.record import Score


def _steps(score: Score) -> tuple[float, ...]:
    """Count steps; under `membership` they count over again, so no plan has a value of its own."""
    alone = score.criterion != "membership"
    f1 = Counts(score.tp, score.fp, score.fn).f1 or 0.0
    whole = alone and score.fp == score.fn == 0
    return score.tp, score.fp, score.fn, whole, alone * f1, alone


def _wrong_steps(score: Score) -> list[int] | None:
    errors = score.errors or {}
    return [errors.get(name, 0) for name in ERROR_TYPES] if score.criterion == "aov" else None


def _blocks(score: Score) -> tuple[float, ...] | None:
    """Count plans whose order counts."""
    if score.criterion != "aov" or score.kept is None:
        return None
    blocks, outcomes = score.tp + score.fn, score.blocks or {}
    both = blocks + score.tp + score.fp
    distance = 1 - 2 * score.kept / both if both else 0.0
    return (*(outcomes.get(name, 0) for name in BLOCK_OUTCOMES), blocks, distance, 1)


_OUTCOMES = tuple(f"blocks_{name}" for name in BLOCK_OUTCOMES)
COUNTS = (
    SampleCounts("steps", ("tp", "fp", "fn", "whole", "f1", "plans"), rows=each_score(_steps)),
    SampleCounts("blocks", (*_OUTCOMES, "blocks", "distance", "plans"), rows=each_score(_blocks)),
    SampleCounts("wrong_steps", ERROR_TYPES, rows=each_score(_wrong_steps)),
    POSE_COUNTS,
)


def _film(record: PlanRecord, task: AssemblyTask | None) -> Iterator[FilmStep]:
    """Yield each step by the first score that knows single steps, that of the headline.

    A right step puts a block at its place in the goal; a wrong one puts none.
    """
    yield FilmStep(f"{record.model}, {record.scene}", "plain", None, ())
    score = next((score for score in record.scores if score.placed is not None), None)
    if score is None or score.placed is None or score.why is None or record.parse is None:
        yield FilmStep("no step is known", "bad", None, ())
        return
    blocks: tuple[Block, ...] = ()
    steps = zip(record.parse.plan, score.placed, score.why, strict=True)
    for n, (candidate, vertex, why) in enumerate(steps, 1):
        outcome = "placed" if vertex is not None else REPORT.heading("wrong", str(why))
        if task is not None and vertex is not None:
            blocks += (task.scene.blocks[vertex],)
        tone: Tone = "good" if vertex is not None else "bad"
        yield FilmStep(f"{n}. block {candidate}: {outcome}", tone, candidate, blocks)
    tone = "good" if score.tp == record.n_blocks else "bad"
    yield FilmStep(f"{score.tp} of {record.n_blocks} blocks placed", tone, None, blocks)


REPORT = read_report(
    "full_planning",
    COUNTS,
    {"pose_gap": {"value": pose_gap}},
    cells=level_cells,
    floors=PLAN_FLOORS,
    film=_film,
)
