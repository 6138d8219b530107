"""An episode step by step: as a table of text, and as the frames of a film."""

from __future__ import annotations

from collections.abc import Iterator

from phyblock.data import AssemblyTask
from phyblock.domain import Block
from phyblock.sim.dynamics import settle
from phyblock.sim.engine import REFERENCE_ENGINE, described_engine
from phyblock.sim.film import FilmStep, Tone
from phyblock.tables.text_table import Column, TextTable
from phyblock.text import counted
from phyblock.tracks.step_planning.episode_views import ENDING_NAMES, OUTCOME_NAMES
from phyblock.tracks.step_planning.record import EpisodeRecord, EpisodeTurn

__all__ = ["episode_film", "episode_table"]


def _operation(turn: EpisodeTurn) -> str:
    move = turn.parse.move
    if move is None:
        return "(no operation)"
    return "Done" if move == "Done" else f"Move({move})"


def episode_table(record: EpisodeRecord) -> TextTable:
    """Every step of an episode, wrong ones too."""
    columns = ("Step", "Operation", "Outcome", "Rule", "Placed")
    rows = tuple(
        (
            str(turn.step),
            _operation(turn),
            _outcome(turn),
            (turn.parse.rule or "none").replace("_", " "),
            f"{len(turn.world)} of {record.n_blocks}",
        )
        for turn in record.steps
    )
    return TextTable(
        f"{record.sample}: {_ending(record)}",
        tuple(Column(name, is_text=name not in ("Step", "Placed")) for name in columns),
        rows,
    )


def _outcome(turn: EpisodeTurn) -> str:
    name = turn.outcome or "unread"
    # Beyond the outcomes of moves there are ways in which a reply says none.
    return OUTCOME_NAMES.get(name, name.replace("_", " ").capitalize())


def episode_film(record: EpisodeRecord, task: AssemblyTask) -> Iterator[FilmStep]:
    """A frame for the empty ground, one a step, and one for how it ended."""
    yield FilmStep(f"{record.model}, {task.scene.id}", "plain", None, ())
    blocks: tuple[Block, ...] = ()
    for turn in record.steps:
        blocks = tuple(task.scene.blocks[vertex] for vertex in turn.world)
        tone: Tone = {"placed": "good", "done": "plain"}.get(turn.outcome or "", "bad")  # type: ignore[assignment]
        move = turn.parse.move
        caption = f"{turn.step}. {_operation(turn)}" + (
            "" if turn.outcome == "done" else f": {_outcome(turn)}"
        )
        yield FilmStep(caption, tone, move if isinstance(move, int) else None, blocks)
    by = ""
    if record.ending == "collapsed":
        blocks = settle(blocks).blocks
        # Older records say no engine, and no version of it.
        engine, now = record.engine or REFERENCE_ENGINE, described_engine()
        if engine not in (now, now.partition(" ")[0]):
            by = f" (falls in {now}, not {engine})"
    tone = "good" if record.ending == "completed" else "bad"
    placed = record.progress[-1] if record.progress else 0
    caption = (
        f"{placed} of {counted(record.n_blocks, 'block')} placed; ended: {_ending(record)}{by}"
    )
    yield FilmStep(caption, tone, None, blocks)


def _ending(record: EpisodeRecord) -> str:
    return ENDING_NAMES[record.ending]
