"""What the step-planning track adds to a record: how the episode went."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from phyblock.records import AskedTurn, Course, Line, Record, Reply
from phyblock.records.line import Whole
from phyblock.tracks.plans import PLAN_COLUMNS, PlanParse, plan_row
from phyblock.tracks.step_planning.prompt import StepOutcome
from phyblock.tracks.step_planning.rules import Ending

__all__ = ["EpisodeRecord", "EpisodeTurn", "MoveParse"]


class MoveParse(Line):
    """The operation that was read in a turn's reply."""

    rule: str | None
    """The rule that matched."""
    move: int | Literal["Done"] | None
    """The candidate's number, `Done`, or null."""
    problem: str | None = None
    """Why no single operation could be read."""


class EpisodeTurn(AskedTurn):
    """One request of an episode, with its reply and what came of it."""

    key: str = ""
    """The scene, the step, and the vote where a step has several."""
    seed: Whole = 0
    """The seed that was sent."""
    step: Whole
    """The step that it belongs to, from 1."""
    parse: MoveParse
    """The operation that was read."""
    outcome: StepOutcome | None = None
    """What became of the step; null for votes that it was not taken with."""
    placed: Whole | None = None
    """The goal block, from 0, that was placed."""
    swapped: tuple[tuple[Whole, ...], ...] = ()
    """Goal blocks whose candidates were exchanged."""
    world: tuple[Whole, ...] = ()
    """The goal blocks that stand after the step."""
    fallen: tuple[Whole, ...] = ()
    """Orders of the blocks that fell when the assembly was let go."""


class EpisodeRecord(Record):
    """An episode of one operation a step."""

    track: Literal["step_planning"]
    """`step_planning`."""
    parse: PlanParse | None = None
    """`plan` holds the moves that were attempted."""
    max_steps: Whole = 0
    """The most steps that the episode can take."""
    setting: str = ""
    """The setting under which a move succeeds."""
    engine: str | None = None
    """The physics engine that blocks were let go in, with its version; null where none were, and
    in records from before there was a choice (PyBullet)."""
    ending: Ending = "unanswered"
    """How it ended."""
    outcomes: tuple[StepOutcome, ...] = ()
    """What became of every step."""
    progress: tuple[Whole, ...] = ()
    """Blocks placed after every step."""
    turns: tuple[EpisodeTurn, ...] = ()
    """Every request, with its reply and what came of it."""

    columns: ClassVar[Mapping[str, str]] = {
        **PLAN_COLUMNS,
        "ending": "object",
        "max_steps": "Int64",
        "outcomes": "object",
        "progress": "object",
    }

    def row(self) -> Mapping[str, Any]:
        """The moves that were attempted, as a plan, and how the episode went."""
        went = ("ending", "max_steps", "outcomes", "progress")
        return {**plan_row(self.parse, self.shown), **{name: getattr(self, name) for name in went}}

    exported: ClassVar[Mapping[str, str]] = {"ending": "string"}

    def export_row(self) -> Mapping[str, Any]:
        """How it ended."""
        return {"ending": self.ending}

    def course(self, matcher: str) -> Course:
        """What became of every step; no matcher has a part in it."""
        del matcher
        steps = (
            (str(turn.parse.move), None if turn.outcome in ("placed", "done") else turn.outcome)
            for turn in self.steps
        )
        return Course(tuple(steps), self.n_blocks - (self.progress[-1] if self.progress else 0))

    @property
    def asked_turns(self) -> tuple[AskedTurn, ...]:
        """Every request, with its reply."""
        return self.turns

    @property
    def replies(self) -> tuple[Reply, ...]:
        """Those of all turns."""
        return tuple(turn.reply for turn in self.turns) or super().replies

    @property
    def limit_usd(self) -> float:
        """What a failed request counts; replies were counted where each was written, as a turn."""
        return super().limit_usd if self.reply is None else 0.0

    @property
    def steps(self) -> tuple[EpisodeTurn, ...]:
        """The turns that a step was taken with: one of each vote."""
        return tuple(turn for turn in self.turns if turn.outcome is not None)
