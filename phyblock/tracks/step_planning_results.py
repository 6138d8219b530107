"""Results of episodes: moves, completed goals, how episodes ended, what became of each step."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

from phyblock.scoring.plan import ERROR_TYPES
from phyblock.sim.dynamics import settle
from phyblock.sim.engine import REFERENCE_ENGINE, described_engine
from phyblock.sim.film import FilmStep, Tone
from phyblock.text import counted
from phyblock.tracks.base import ENGINE
from phyblock.tracks.full_planning import POSE_COUNTS, pose_gap
from phyblock.tracks.measures import SampleCounts, Way, each_score, read_report
from phyblock.tracks.step_planning import ENDINGS, STEP_FLOORS, EpisodeRecord

if TYPE_CHECKING:
    from phyblock.data import AssemblyTask
    from phyblock.domain import Block

STEP_OUTCOMES = ("placed", *ERROR_TYPES, "invalid", "unread", "done")
"""What becomes of a step; `unread` are replies in which no single operation could be read."""
_ALIKE = (f"tracks.step_planning.{ENGINE}",)


def _episodes(record: EpisodeRecord) -> Iterator[tuple[Way, tuple[int, ...]]]:
    """Count an episode: its ending, its steps by outcome, and what it took to complete a goal."""
    taken = Counter(one if one in STEP_OUTCOMES else "unread" for one in record.outcomes)
    steps, whole = len(record.outcomes), record.ending == "completed"
    numbers = (whole, 1, steps, whole * steps, whole * record.n_blocks)
    ended = (record.ending == name for name in ENDINGS)
    yield ("", "", ""), (*numbers, *ended, *(taken[name] for name in STEP_OUTCOMES))


COUNTS = (
    SampleCounts(
        "moves",
        ("tp", "fp", "fn"),
        rows=each_score(lambda score: (score.tp, score.fp, score.fn)),
        alike=_ALIKE,
    ),
    SampleCounts(
        "episodes",
        (
            *("completed", "episodes", "steps", "finishing", "fewest"),
            *(f"ended_{name}" for name in ENDINGS),
            *(f"step_{name}" for name in STEP_OUTCOMES),
        ),
        rows=_episodes,
        alike=_ALIKE,
    ),
    POSE_COUNTS,
)


def _film(record: EpisodeRecord, task: AssemblyTask | None) -> Iterator[FilmStep]:
    """Yield the empty ground, every step, wrong ones too, and how the episode ended."""
    yield FilmStep(f"{record.model}, {record.scene}", "plain", None, ())
    blocks: tuple[Block, ...] = ()
    tones: dict[str | None, Tone] = {"placed": "good", "done": "plain"}
    for turn in record.steps:
        if task is not None:
            blocks = tuple(task.scene.blocks[vertex] for vertex in turn.world)
        move, outcome = turn.parse.move, turn.outcome or "unread"
        candidate = move if isinstance(move, int) else None
        operation = f"Move({move})" if candidate is not None else move or "(no operation)"
        ending = "" if outcome == "done" else f": {REPORT.heading('step', outcome)}"
        note = f"{len(turn.world)} of {record.n_blocks} placed"
        note += f", read by {turn.parse.rule.replace('_', ' ')}" if turn.parse.rule else ""
        caption, tone = f"{turn.step}. {operation}{ending}", tones.get(turn.outcome, "bad")
        yield FilmStep(caption, tone, candidate, blocks, note)
    by = ""
    if record.ending == "collapsed" and task is not None:
        blocks = settle(blocks).blocks
        # Older records say no engine, and no version of it.
        engine, now = record.engine or REFERENCE_ENGINE, described_engine()
        if engine not in (now, now.partition(" ")[0]):
            by = f" (falls in {now}, not {engine})"
    placed = record.progress[-1] if record.progress else 0
    how = f"{placed} of {counted(record.n_blocks, 'block')} placed; ended: "
    tone = "good" if record.ending == "completed" else "bad"
    yield FilmStep(f"{how}{REPORT.heading('ended', record.ending)}{by}", tone, None, blocks)


REPORT = read_report(
    "step_planning", COUNTS, {"pose_gap": {"value": pose_gap}}, floors=STEP_FLOORS, film=_film
)
